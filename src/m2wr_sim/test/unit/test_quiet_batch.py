# SPDX-License-Identifier: BSD-3-Clause
"""Worlds whose drive is the only plugin that acts are stepped together, to the numbers of single ones."""
from dataclasses import replace

import numpy as np
import pytest

from m2wr_sim.api import Sim, read_robot, read_world
from m2wr_sim.api.quiet_batch import QuietBatch, is_quiet
from m2wr_sim.model.types import Collision, Link, Mesh, Model

DRIVE = "libgazebo_ros_diff_drive.so"


def robot(**tags):
    """Return m2wr with other parameters of its drive."""
    record = read_robot("m2wr")
    plugins = tuple(replace(spec, parameters=tuple(
        (name, value) for name, value in spec.parameters if name not in tags) + tuple(tags.items()))
        if spec.filename == DRIVE else spec for spec in record.plugins)
    return replace(record, plugins=plugins)


def batch_of(sims, steps):
    """Return a batch of worlds, and the array of its scans."""
    ranges = np.zeros((len(sims), 720), np.float32)
    batch = QuietBatch([(sim.simulator, sim.drive(), sim.lasers()[0], steps * sim.simulator.step_ns) for sim in sims],
                       ranges)
    for index in range(len(sims)):
        batch.begin(index)
    return batch, ranges


def quiet(sim):
    return is_quiet(sim.simulator, sim.drive())


@pytest.mark.parametrize("step", [0.001, 0.02, 0.03])
@pytest.mark.parametrize("rate", ["7", "20", "50", "100"])
def test_poses_and_scans_are_those_of_the_event_queue(step, rate):
    options = dict(world="world02", robot=robot(updateRate=rate), sensing="now", step=step)
    places = [(0.0, 8.0, 0.3), (1.0, 7.5, -1.0)]
    alone = [Sim(pose=pose, seed=seed, **options) for seed, pose in enumerate(places)]
    together = [Sim(pose=pose, seed=seed, **options) for seed, pose in enumerate(places)]
    for sim in alone + together:
        sim.reset()
    batch, ranges = batch_of(together, 4)
    assert batch.quiet.all()
    for commands in np.random.default_rng(1).uniform((-0.2, -1.0), (0.6, 1.0), (12, 2, 2)):
        batch.step(np.arange(2), commands.tolist())
        for index, (one, other) in enumerate(zip(alone, together)):
            result = one.step(commands[index], 4 * step)
            assert one.pose() == other.pose() and one.time == other.time
            np.testing.assert_array_equal(ranges[index], result.scan.ranges)
            np.testing.assert_allclose(batch.motions[index, :7], sum(one.pose(), ()), rtol=0.0, atol=1e-12)
    for one, other in zip(alone, together):     # the rest of the run is not disturbed
        one.step((0.3, 0.0), 0.3)
        other.step((0.3, 0.0), 0.3)
        assert one.pose() == other.pose() and one.simulator.steps == other.simulator.steps
    for sim in alone + together:
        sim.close()


def test_meshes_need_another_scan_and_contacts_are_told():
    """A wall of two triangles stands ahead of one robot, a solid one ahead of the other."""
    corners = np.array([(1.5, -2.0, 0.0), (1.5, 2.0, 0.0), (1.5, 2.0, 2.0), (1.5, -2.0, 2.0)])
    sheet = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    wall = Model("wall", (Link("link", collisions=(Collision("shape", sheet),)),), static=True)
    world = read_world("empty")
    meshed = replace(world, models=tuple(world.models) + (wall,))
    options = dict(robot="m2wr", sensing="now", step=0.01)
    alone, together = ([Sim(one, **options) for one in (meshed, "empty")] for _ in range(2))
    for sim in alone + together:
        sim.reset()
    batch, ranges = batch_of(together, 10)
    assert batch.quiet.all() and batch._packed.tolist() == [False, True]
    for count in range(60):
        told = batch.step(np.arange(2), [(0.5, 0.0), (0.5, 0.0)])
        results = [sim.step((0.5, 0.0), 0.1) for sim in alone]
        for index, result in enumerate(results):
            np.testing.assert_array_equal(ranges[index], result.scan.ranges)
            assert together[index].pose() == alone[index].pose()
        assert told == [index for index, result in enumerate(results) if result.contacts]
        if told:
            break
    assert told == [0] and count > 10
    for sim in alone + together:
        sim.close()


@pytest.mark.parametrize("tags", [dict(odometrySource="encoder"), dict(wheelAcceleration="1.0")])
def test_a_drive_that_acts_in_each_update_is_asked(tags):
    with Sim("empty", robot(**tags), sensing="now") as sim:
        assert not quiet(sim)


@pytest.mark.parametrize("options", [dict(sensing="due"), dict(sensing="now", command_timeout=0.5)])
def test_a_robot_that_senses_or_forgets_is_asked(options):
    with Sim("empty", "m2wr", **options) as sim:
        assert not quiet(sim)


def test_a_world_with_moving_obstacles_is_asked():
    with Sim("moving_20", "m2wr", sensing="now") as sim:
        assert not quiet(sim)


def test_a_drive_with_a_callback_is_asked():
    with Sim("empty", "m2wr", sensing="now") as sim:
        assert quiet(sim)
        sim.drive().callbacks.append(print)
        assert not quiet(sim)


def test_steps_are_compiled_with_the_options_of_the_engine():
    """A function inherits fastmath from the first one that calls it, and the engines would no longer agree."""
    kernels = pytest.importorskip("m2wr_sim.api.quiet_kernels")
    from m2wr_sim.physics import step_kernels
    for kernel in (kernels.drive_all, kernels.read_all, kernels.scan_all, step_kernels.run):
        assert not kernel.targetoptions.get("fastmath"), kernel


def test_another_engine_is_stepped_one_by_one():
    with Sim("empty", "m2wr", sensing="now", engine="pyode") as sim:
        batch, _ = batch_of([sim], 10)
        assert quiet(sim) and not batch.quiet.any()
