# SPDX-License-Identifier: BSD-3-Clause
"""The same stepping loop in C, compiled when it is needed: the reference for the speed of the compiled Python loop.

It is not a part of the simulator and not built with it; it needs a C compiler and libode's headers.  The program reads
the world as text, in the order in which the engine builds it, so both loops give the same result to the bit.
"""
from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from typing import TYPE_CHECKING, Dict, Iterable, Iterator, List, Tuple, Union

import numpy as np
import rospkg

from m2wr_sim.errors import SimError
from m2wr_sim.geometry import compose, matrix_from_quaternion, rotate
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.pyode_bodies import ode_quaternion
from m2wr_sim.physics.wheels import initial_link_pose, wheel_poses

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.types import Collision, Model, World
    from m2wr_sim.physics.engine import EngineSettings

_NAMES = {Box: "box", Cylinder: "cylinder", Sphere: "sphere"}


class CompilerMissing(SimError):
    """The loop in C cannot be compiled here."""


def source() -> str:
    """Return the path of the loop's C source."""
    return os.path.join(rospkg.RosPack().get_path("m2wr_tools"), "bench", "step_loop.c")


def compile_loop(source: str, folder: str) -> str:
    """Compile the loop.

    Parameters
    ----------
    source : str
        Path of the C source.
    folder : str
        Where to write the program.

    Returns
    -------
    str
        Path of the program.

    Raises
    ------
    CompilerMissing
        If there is no compiler, or it fails, mostly because libode's headers are not installed.
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
    """Gives collisions with the same kinds of contacts the same number."""

    def __init__(self) -> None:
        self._numbers: Dict[Tuple[object, ...], int] = {}
        self.members: List[Tuple[Collision, bool, bool]] = []

    def number(self, collision: Collision, wheel: bool, moves: bool) -> int:
        key = (collision.surface, type(collision.geometry), collision.max_contacts, wheel, moves)
        if key not in self._numbers:
            self._numbers[key] = len(self.members)
            self.members.append((collision, wheel, moves))
        return self._numbers[key]


def _line(*items: Union[str, float]) -> str:
    return " ".join(item if isinstance(item, str) else "%.17g" % item for item in items)


def _shape(collision: Collision, number: int, pose: Pose) -> str:
    geometry = collision.geometry
    if isinstance(geometry, Box):
        sizes = tuple(geometry.size)
    elif isinstance(geometry, Cylinder):
        sizes = (geometry.radius, geometry.length)
    elif isinstance(geometry, Sphere):
        sizes = (geometry.radius,)
    else:
        raise SimError("the loop in C does not support %s" % type(geometry).__name__)
    return _line(_NAMES[type(geometry)], number, *(tuple(pose[0]) + ode_quaternion(pose[1]) + sizes))


def _static_lines(model: Model, classes: _Classes) -> Iterator[str]:
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


def _robot_lines(model: Model, pose: Pose, rates: Dict[str, float], force: float, classes: _Classes) -> Iterator[str]:
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
            yield _shape(collision, number, ((offset[0] - com[0], offset[1] - com[1], offset[2] - com[2]), twist))
    for joint in model.joints:
        anchor, orientation = compose(poses[joint.child], joint.pose)
        yield _line("hinge", order.index(joint.child), order.index(joint.parent), *anchor,
                    *rotate(orientation, joint.axis.xyz), rates[joint.name], force)


def world_text(world: World, robot: Model, places: Iterable[Vector], rates: Dict[str, float], force: float,
               settings: EngineSettings, runs: int, steps: int) -> str:
    """Return the input of the program.

    Parameters
    ----------
    world : World
        Static models only.
    robot : Model
        Links and hinges, without damping, limits or friction in the joints; surfaces rigid and without slip.
    places : list of (x, y, z)
        Positions of its copies [m], heading +x.
    rates : dict
        Rate of each joint's motor [rad/s].
    force : float
        Maximum torque of the motors [N m].
    settings : EngineSettings
        The program solves every step once; ``friction_solves`` has no effect.
    runs, steps : int
        Number of timed runs and steps in each.

    Raises
    ------
    SimError
        If the world has something that the program does not support.
    """
    classes = _Classes()
    lines: List[str] = []
    for model in world.models:
        if not model.static:
            raise SimError("the loop in C supports static worlds only; model \"%s\" can move" % model.name)
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


def run_loop(program: str, text: str) -> Tuple[List[float], Tuple[float, ...]]:
    """Run the program.

    Parameters
    ----------
    program : str
        Its path.
    text : str
        Its input, from :func:`world_text`.

    Returns
    -------
    list of float, (float, float, float)
        Processor time of a step in each run [us]; final position of the first body [m].

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


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for the program, as a context manager."""
    return tempfile.TemporaryDirectory(prefix="m2wr_sim_benchmark_")
