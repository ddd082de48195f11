# SPDX-License-Identifier: BSD-3-Clause
"""A robot whose drive is the only plugin that acts is driven without asking the others, to the same place."""
from dataclasses import replace

import numpy as np
import pytest

from m2wr_sim.api import Sim, read_robot
from m2wr_sim.api.quiet_run import QuietRun

DRIVE = "libgazebo_ros_diff_drive.so"


def robot(**tags):
    """Return m2wr with other parameters of its drive."""
    record = read_robot("m2wr")
    plugins = tuple(replace(spec, parameters=tuple(
        (name, value) for name, value in spec.parameters if name not in tags) + tuple(tags.items()))
        if spec.filename == DRIVE else spec for spec in record.plugins)
    return replace(record, plugins=plugins)


def quiet(sim):
    return QuietRun(sim.simulator, sim.drive())


@pytest.mark.parametrize("step", [0.001, 0.02, 0.03])
@pytest.mark.parametrize("rate", ["7", "20", "50", "100"])
def test_poses_are_those_of_the_event_queue(step, rate):
    with Sim("world02", robot(updateRate=rate), (0.0, 8.0, 0.3), sensing="now", step=step) as one, Sim(
            "world02", robot(updateRate=rate), (0.0, 8.0, 0.3), sensing="now", step=step) as other:
        run, simulator = quiet(other), other.simulator
        assert run.possible()
        for linear, angular in np.random.default_rng(1).uniform((-0.2, -1.0), (0.6, 1.0), (12, 2)):
            one.step((linear, angular), 4 * step)
            run.run(linear, angular, simulator.now_ns + 4 * simulator.step_ns)
            assert one.pose() == other.pose() and one.time == other.time
        for sim in (one, other):        # the rest of the run is not disturbed
            sim.step((0.3, 0.0), 0.3)
        assert one.pose() == other.pose()


@pytest.mark.parametrize("tags", [dict(odometrySource="encoder"), dict(wheelAcceleration="1.0")])
def test_a_drive_that_acts_in_each_update_is_asked(tags):
    with Sim("empty", robot(**tags), sensing="now") as sim:
        assert not quiet(sim).possible()


@pytest.mark.parametrize("options", [dict(sensing="due"), dict(sensing="now", command_timeout=0.5)])
def test_a_robot_that_senses_or_forgets_is_asked(options):
    with Sim("empty", "m2wr", **options) as sim:
        assert not quiet(sim).possible()


def test_a_world_with_moving_obstacles_is_asked():
    with Sim("moving_20", "m2wr", sensing="now") as sim:
        assert not quiet(sim).possible()


def test_a_drive_with_a_callback_is_asked():
    with Sim("empty", "m2wr", sensing="now") as sim:
        run = quiet(sim)
        assert run.possible()
        sim.drive().callbacks.append(print)
        assert not run.possible()
