# SPDX-License-Identifier: BSD-3-Clause
"""Heights of obstacles count from the ground that carries a robot: the floor, or a plate on it."""
import numpy as np
import pytest

from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import CARRIED, STEP, ground_height, obstacle_outlines

MODEL = ('<model name="{name}"><static>{static}</static><pose>{pose}</pose><link name="l"><collision name="c">'
         "<geometry>{shape}</geometry></collision></link></model>")
BOX, DISC = "<box><size>{} {} {}</size></box>", "<cylinder><radius>{}</radius><length>{}</length></cylinder>"


def world(*models):
    parts = [MODEL.format(name="m%d" % k, shape=shape, pose=pose, static=static)
             for k, (shape, pose, static) in enumerate(models)]
    return read_world('<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>{}</world>'
                      "</sdf>".format("".join(parts)))


PLATE = (BOX.format(20, 20, 0.1), "0 0 0 0 0 0.3", 1)           # its top is at 0.05 m
POST = (DISC.format(0.1, 1.0), "3 0 0.5 0 0 0", 1)
CARPET = (BOX.format(1, 1, 0.04), "3 3 0.07 0 0 0", 1)          # from 0.05 to 0.09 m
PAD = (BOX.format(1, 1, 0.04), "3 -3 0.02 0 0 0", 1)            # all of it is below the top of the plate


def test_a_plate_is_the_ground_of_what_stands_on_it():
    read = world(PLATE, POST, CARPET, PAD)
    assert ground_height(read) == pytest.approx(0.05)
    assert [outline.name for outline in obstacle_outlines(read)] == ["m1", "m2"]
    assert {outline.name for outline in obstacle_outlines(read, place=(30.0, 0.0))} == {"m0", "m1", "m2", "m3"}


@pytest.mark.parametrize("model", [
    (BOX.format(1.0, 2.0 * CARRIED - 0.1, 0.1), "0 0 0 0 0 0", 1),          # the robot is only partly on it
    (BOX.format(9.0, 9.0, 2.1 * STEP), "0 0 0 0 0 0", 1),                   # too high
    (BOX.format(9.0, 9.0, 0.1), "0 0 0 0.01 0 0", 1),                       # not level
    (BOX.format(9.0, 9.0, 0.1), "0 0 0 0 0 0", 0),                          # not fixed
    (DISC.format(5.0, 0.1), "0 0 0.05 1.5708 0 0", 1)], ids=["narrow", "high", "tilted", "moves", "lying"])
def test_what_does_not_carry_a_robot_is_an_obstacle(model):
    read = world(model)
    assert ground_height(read) == 0.0 and len(obstacle_outlines(read)) == 1


def test_boxes_on_their_side_and_discs_carry_a_robot_too():
    assert ground_height(world((BOX.format(0.1, 9, 9), "0 0 0 0 1.5707963267948966 0", 1))) == pytest.approx(0.05)
    read = world((DISC.format(2.0, 0.06), "1 0 0 0 0 0", 1))
    assert ground_height(read) == pytest.approx(0.03)
    assert ground_height(read, (2.8, 0.0)) == 0.0
    assert np.isclose(ground_height(read, (2.4, 0.0)), 0.03)
