# SPDX-License-Identifier: BSD-3-Clause
"""Shapes of the ray scene: they follow the links of the engine."""
import math

import pytest

from conftest import at


def scene_centres(rig, owner):
    return [tuple(rig.simulator.scene.spheres[:3, row]) for row in rig.simulator.scene.rows_of(owner)]


def test_the_scene_follows_what_moves(make_rig, m2wr, build):
    rig = make_rig(build.box("post", 5, 0, 0.5))
    rig.simulator.spawn(m2wr, at(1.0, 2.0, 0.1, math.pi / 2))
    chassis, caster, laser, left, right = scene_centres(rig, "m2wr")
    assert chassis == pytest.approx((1.0, 2.0, 0.1)) and caster == pytest.approx((1.0, 2.35, 0.05))
    assert laser == pytest.approx((1.0, 2.15, 0.15)) and left == pytest.approx((1.2, 1.95, 0.1))
    assert right == pytest.approx((0.8, 1.95, 0.1))
    rig.simulator.set_model_state("m2wr", at(-1.0, 0.0, 0.1), (0, 0, 0), (0, 0, 0))
    rig.simulator.set_model_state("post", at(6.0, 1.0, 0.5), (0, 0, 0), (0, 0, 0))
    rig.simulator.refresh_scene()
    assert scene_centres(rig, "m2wr")[0] == pytest.approx((-1.0, 0.0, 0.1))
    assert scene_centres(rig, "post") == [pytest.approx((6.0, 1.0, 0.5))]


def test_the_scene_is_updated_only_after_a_motion(m2wr_rig):
    rig = m2wr_rig().run(0.01)
    rig.simulator.refresh_scene()
    version = rig.simulator.scene.version
    rig.simulator.refresh_scene()
    assert rig.simulator.scene.version == version
    rig.simulator.reset_world()
    rig.simulator.refresh_scene()
    assert rig.simulator.scene.version > version
