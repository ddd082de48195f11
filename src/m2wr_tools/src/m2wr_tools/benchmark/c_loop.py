# SPDX-License-Identifier: BSD-3-Clause
"""The same stepping loop written in C, compiled on the spot: the yardstick for the compiled Python loop.

It is no part of the simulator and not built with it; it needs a C compiler and libode's headers.  The world is handed
over as text, in the order in which the engine builds it, so both loops step the same world to the same bits.
"""
import os
import shutil
import subprocess
import tempfile

import numpy as np
import rospkg

from m2wr_sim.errors import SimError
from m2wr_sim.geometry import compose, matrix_from_quaternion, rotate
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.pyode_bodies import ode_quaternion
from m2wr_sim.physics.wheels import initial_link_pose, wheel_poses

_NAMES = {Box: "box", Cylinder: "cylinder", Sphere: "sphere"}


class CompilerMissing(SimError):
    """The loop in C cannot be compiled here."""


def source():
    """Return the path of the loop's C source."""
    return os.path.join(rospkg.RosPack().get_path("m2wr_tools"), "bench", "step_loop.c")


def compile_loop(source, folder):
    """Compile ``source`` into ``folder`` and return the program's path.

    Raises
    ------
    CompilerMissing
        If there is no compiler, or it does not take the source (mostly: libode's headers are not installed).
    """
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise CompilerMissing("no C compiler: looked for $CC, cc and gcc")
    program = os.path.join(folder, "step_loop")
    command = [compiler, "-O2", "-std=c99", "-D_POSIX_C_SOURCE=200112L", source, "-o", program, "-lode", "-lm"]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    except OSError as error:
        raise CompilerMissing("the C compiler cannot be run: %s" % error) from error
    if done.returncode:
        raise CompilerMissing("%s failed (are libode's headers installed? the package is libode-dev):\n%s"
                              % (" ".join(command), done.stdout.strip()))
    return program


class _Classes:
    """Numbers collisions by what contacts they make."""

    def __init__(self):
        self._numbers, self.members = {}, []

    def number(self, collision, wheel, moves):
        key = (collision.surface, type(collision.geometry), collision.max_contacts, wheel, moves)
        if key not in self._numbers:
            self._numbers[key] = len(self.members)
            self.members.append((collision, wheel, moves))
        return self._numbers[key]


def _line(*items):
    return " ".join(item if isinstance(item, str) else "%.17g" % item for item in items)


def _shape(collision, number, pose):
    geometry = collision.geometry
    if isinstance(geometry, Box):
        sizes = tuple(geometry.size)
    elif isinstance(geometry, Cylinder):
        sizes = (geometry.radius, geometry.length)
    elif isinstance(geometry, Sphere):
        sizes = (geometry.radius,)
    else:
        raise SimError("the loop in C knows no %s" % type(geometry).__name__)
    return _line(_NAMES[type(geometry)], number, *(tuple(pose[0]) + ode_quaternion(pose[1]) + sizes))


def _static_lines(model, classes):
    for link in model.links:
        link_pose = initial_link_pose(model.pose, link)
        for collision in link.collisions:
            number, pose = classes.number(collision, False, False), compose(link_pose, collision.pose)
            if isinstance(collision.geometry, Plane):
                nx, ny, nz = collision.geometry.normal
                norm = (nx * nx + ny * ny + nz * nz) ** 0.5
                yield _line("plane", number, nx / norm, ny / norm, nz / norm, nz / norm * pose[0][2])
            else:
                yield _shape(collision, number, pose)


def _robot_lines(model, pose, rates, force, classes):
    wheels, order = wheel_poses(model.links, model.joints), [link.name for link in model.links]
    yield "robot"
    poses = {link.name: initial_link_pose(pose, link) for link in model.links}
    for link in model.links:
        position, orientation = poses[link.name]
        com, com_turn = link.inertial.pose
        shift, turn = rotate(orientation, com), matrix_from_quaternion(com_turn)
        ixx, ixy, ixz, iyy, iyz, izz = link.inertial.inertia
        tensor = turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ turn.T
        yield _line("body", *(position[axis] + shift[axis] for axis in range(3)), *ode_quaternion(orientation),
                    link.inertial.mass, tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2],
                    tensor[1, 2])
        for collision in link.collisions:
            wheel = wheels.get((link.name, collision.name))
            offset, twist = wheel or collision.pose
            number = classes.number(collision, wheel is not None, True)
            yield _shape(collision, number, (tuple(offset[axis] - com[axis] for axis in range(3)), twist))
    for joint in model.joints:
        anchor, orientation = compose(poses[joint.child], joint.pose)
        yield _line("hinge", order.index(joint.child), order.index(joint.parent), *anchor,
                    *rotate(orientation, joint.axis.xyz), rates[joint.name], force)


def world_text(world, robot, places, rates, force, settings, runs, steps):
    """Return the input of the program.

    Parameters
    ----------
    world : World
        Static models only.
    robot : Model
        Links and hinges, without damping, limits or friction in the joints; surfaces rigid and without slip.
    places : list of (x, y, z)
        Where its copies stand, heading +x.
    rates : dict
        Rate of each joint's motor [rad/s].
    force : float
        Greatest torque of the motors [N m].
    settings : EngineSettings
        The program solves every step once, whatever ``friction_solves`` says.
    runs, steps : int
        Number of timed runs and steps in each.

    Raises
    ------
    SimError
        If something in the world is of a kind the program does not know.
    """
    classes, lines = _Classes(), []
    for model in world.models:
        if not model.static:
            raise SimError("the loop in C knows static worlds only; model \"%s\" can move" % model.name)
        lines.extend(_static_lines(model, classes))
    for place in places:
        lines.extend(_robot_lines(robot, (place, (0.0, 0.0, 0.0, 1.0)), rates, force, classes))
    pairs = []
    for row, (one, one_wheel, one_moves) in enumerate(classes.members):
        for column, (two, two_wheel, two_moves) in enumerate(classes.members):
            both = one_moves and two_moves
            surface = pair_surface(one, two, one_wheel, two_wheel, both, settings)
            if surface is not None and (one_moves or two_moves):
                pairs.append(_line("pair", row, column, surface.mu, surface.max_contacts, surface.merge,
                                   surface.ground))
    quick = settings.iterations if settings.solver == "quick" else 0
    head = _line("world", settings.step_ns * 1e-9, settings.erp, settings.cfm, settings.surface_layer,
                 settings.max_correcting_velocity, settings.gravity[2], quick, len(classes.members), runs, steps)
    return "\n".join([head] + pairs + lines) + "\n"


def run_loop(program, text):
    """Run the program; returns the µs of processor time per step of each run and the first body's final position.

    Raises
    ------
    SimError
        If it fails.
    """
    done = subprocess.run([program], input=text, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True)
    if done.returncode:
        raise SimError("the loop in C failed with code %d: %s" % (done.returncode, done.stderr.strip()))
    *times, last = done.stdout.split("\n")[:-1]
    return [1e-3 * float(line) for line in times], tuple(float.fromhex(word) for word in last.split()[1:4])


def temporary_folder():
    """Return a folder for the program; use it as a context manager."""
    return tempfile.TemporaryDirectory(prefix="m2wr_sim_benchmark_")
