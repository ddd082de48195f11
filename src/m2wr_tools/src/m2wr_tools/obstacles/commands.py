# SPDX-License-Identifier: BSD-3-Clause
"""The commands add_obstacle, move_obstacle, delete_obstacle and list_obstacles.  Exit code 0 or 1; 2 on misuse."""
from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Union

from m2wr_sim.angles import quaternion_from_rpy, yaw_of
from m2wr_sim.command_line import without_exponent
from m2wr_sim.errors import SimError
from m2wr_tools.obstacles.obstacle import COLOURS, KINDS, Obstacle, draw, read_colour, wall
from m2wr_tools.service_client import no_master, without_remappings

if TYPE_CHECKING:
    import numpy as np

    from m2wr_sim.geometry import Pose, Vector
    from m2wr_tools.obstacles.world import World
    from m2wr_view.outlines import Outline

_DEFAULT_SIZES: Dict[str, Tuple[float, ...]] = {"box": (0.5, 0.5, 0.5), "cylinder": (0.25, 0.5), "sphere": (0.25,)}


def _parser(name: str, text: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=name, description=text)
    parser.add_argument("--gazebo-namespace", default="/gazebo", metavar="NS",
                        help="where the services are (%(default)s)")
    return parser


def make_add_parser() -> argparse.ArgumentParser:
    """Return the parser of add_obstacle."""
    parser = _parser("add_obstacle", "Add an obstacle to a running simulation. Heights are those of the underside: 0 "
                                     "is on the floor.")
    add = parser.add_argument
    add("kind", choices=sorted(KINDS) + ["random", "wall"], help="shape; random: random shape, colour and size")
    add("--size", type=float, nargs="+", metavar="METRES",
        help="box: LENGTH WIDTH HEIGHT; cylinder: RADIUS HEIGHT; sphere: RADIUS; wall: THICKNESS HEIGHT")
    add("--at", type=float, nargs="+", metavar="METRES", help="X Y, or X Y Z")
    add("--yaw", type=float, metavar="RAD", help="heading (0)")
    add("--from", dest="start", type=float, nargs=2, metavar=("X", "Y"), help="one end of a wall")
    add("--to", dest="end", type=float, nargs=2, metavar=("X", "Y"), help="its other end")
    add("--near", metavar="MODEL", help="instead of --at: at a free place near this robot")
    add("--within", type=float, default=2.0, metavar="METRES", help="with --near: maximum distance (%(default)s)")
    add("--clearance", type=float, default=0.3, metavar="METRES",
        help="with --near: minimum distance from all objects (%(default)s)")
    add("--count", type=int, default=1, metavar="N", help="with --near: number of obstacles (%(default)s)")
    add("--seed", type=int, default=0, help="with --near: seed of the random places (%(default)s)")
    weight = parser.add_mutually_exclusive_group()
    weight.add_argument("--static", action="store_true", help="the obstacle is static (default)")
    weight.add_argument("--mass", type=float, metavar="KG", help="mass; a robot can push it")
    add("--colour", "--color", default=None, metavar="COLOUR", help="%s, or #rrggbb" % ", ".join(sorted(COLOURS)))
    add("--name", default="", help="name of the model; with --count the beginning of the names (obstacle1, ...)")
    return parser


def _check_add(parser: argparse.ArgumentParser, given: argparse.Namespace) -> None:
    """Exit with code 2 if options contradict each other."""
    if given.kind == "wall":
        if not (given.start and given.end) or given.at or given.near or given.yaw is not None:
            parser.error("a wall needs --from X Y --to X Y, without --at, --near and --yaw")
        if given.size and len(given.size) != 2:
            parser.error("--size of a wall is THICKNESS HEIGHT")
    elif given.start or given.end:
        parser.error("--from and --to are for a wall only")
    elif (given.at is None) == (given.near is None):
        parser.error("expected either --at X Y [Z] or --near MODEL")
    if given.at and len(given.at) not in (2, 3):
        parser.error("--at takes X Y or X Y Z")
    if given.near is None and given.count != 1:
        parser.error("--count needs --near")
    if given.near is not None and given.yaw is not None:
        parser.error("--yaw needs --at; with --near it is random")
    if not 1 <= given.count <= 100:
        parser.error("--count is %d; expected 1 to 100" % given.count)
    if given.seed < 0:
        parser.error("--seed is %d; expected 0 or more" % given.seed)
    if not (0.0 < given.within <= 100.0 and 0.0 <= given.clearance <= 10.0):
        parser.error("expected --within above 0, up to 100 m, and --clearance from 0 to 10 m")
    if given.kind == "random" and (given.size or given.colour):
        parser.error("random chooses size and colour too: omit --size and --colour")


def read_obstacle(given: argparse.Namespace, generator: np.random.Generator) -> Obstacle:
    """Return the obstacle that the command line describes.

    Parameters
    ----------
    given : argparse.Namespace
        The parsed command line.
    generator : numpy.random.Generator
        For a random obstacle.

    Raises
    ------
    ModelError
        If there is no such obstacle.
    """
    colour = read_colour(given.colour) if given.colour else COLOURS["orange"]
    if given.kind == "random":
        drawn = draw(generator)
        return Obstacle(drawn.kind, drawn.size, given.mass, drawn.colour)
    if given.kind == "wall":
        size, _, _ = wall(given.start, given.end, *(given.size or ()))
        return Obstacle("box", size, given.mass, colour)
    return Obstacle(given.kind, tuple(given.size or _DEFAULT_SIZES[given.kind]), given.mass, colour)


def _describe(name: str, kind: str, size: Sequence[float], place: Vector, yaw: float) -> str:
    """Return a line about an obstacle, without -0.00."""
    x, y, z, heading = (round(value, 2) + 0.0 for value in tuple(place) + (yaw,))
    return "%s: %s of %s m at (%.2f, %.2f, %.2f), heading %.2f rad" % (
        name, kind, " x ".join("%g" % value for value in size), x, y, z, heading)


def _say_added(name: str, obstacle: Obstacle, place: Vector, yaw: float, robots: Mapping[str, Pose],
               footprint: Sequence[Outline]) -> None:
    """Print the added obstacle, and a warning if it overlaps a robot."""
    print("%s, %s" % (_describe(name, obstacle.kind, obstacle.size, place, yaw),
                      "fixed" if obstacle.mass is None else "%g kg" % obstacle.mass))
    from m2wr_tools.obstacles.world import outline_of, overlapped_robots
    outline = outline_of(obstacle.kind, obstacle.size, (place, quaternion_from_rpy(0.0, 0.0, yaw)))
    for robot in overlapped_robots(outline, robots, footprint):
        sys.stderr.write("warning: %s overlaps the robot %s and will push it away; \"rosrun m2wr_sim "
                         "move_obstacle %s --at X Y\" moves it\n" % (name, robot, name))


def add_obstacle(given: argparse.Namespace, world: World) -> None:
    """Run the command add_obstacle.

    Parameters
    ----------
    given : argparse.Namespace
        The parsed command line.
    world : World
        The simulation.

    Raises
    ------
    ObstacleError
        If the robot of ``--near`` does not exist or the simulation refuses.
    """
    import numpy as np

    from m2wr_tools.obstacles.world import ObstacleError, Places, robot_footprint, some_of
    generator = np.random.default_rng(given.seed)
    first = read_obstacle(given, generator)     # a bad size is refused before any call of the simulation
    robots, footprint = world.robots(), robot_footprint()
    if given.near is None:
        if given.kind == "wall":
            _, (x, y), yaw = wall(given.start, given.end)
            place = x, y, 0.0
        else:
            (x, y, z), yaw = (given.at + [0.0])[:3], given.yaw or 0.0
            place = x, y, z
        name = world.add(first, place, yaw, given.name)
        _say_added(name, first, place, yaw, robots, footprint)
        return
    if given.near not in world.names():
        raise ObstacleError("there is no model \"%s\"; in the world are %s" % (given.near, some_of(world.names())))
    start_to_listen()
    places = Places(world.pose(given.near), world.solids(), robots, footprint, given.clearance, given.within, generator)
    for number in range(given.count):
        obstacle = first if number == 0 else read_obstacle(given, generator)
        x, y, yaw = places.draw(obstacle)
        name = given.name
        if not name or given.count > 1:
            name = world.free_name(world.names(), name or "obstacle")
        _say_added(world.add(obstacle, (x, y, 0.0), yaw, name), obstacle, (x, y, 0.0), yaw, {}, footprint)


def start_to_listen() -> None:
    """Register a node, unless this process is one; the world's markers need it, services do not."""
    import rospy

    from m2wr_node.ros.starting import start_node
    if rospy.core.is_initialized():
        return
    start_node("add_obstacle", anonymous=True, disable_rostime=True)
    rospy.rostime.switch_to_wallclock()     # must not hang while the simulation is paused


def make_move_parser() -> argparse.ArgumentParser:
    """Return the parser of move_obstacle."""
    parser = _parser("move_obstacle", "Move a model of a running simulation; it is at rest afterwards.")
    parser.add_argument("name", help="name of the model")
    parser.add_argument("--at", type=float, nargs="+", required=True, metavar="METRES", help="X Y, or X Y Z")
    parser.add_argument("--yaw", type=float, metavar="RAD", help="heading, upright; default: the present attitude")
    return parser


def move_obstacle(given: argparse.Namespace, world: World) -> None:
    """Run the command move_obstacle.

    Parameters
    ----------
    given : argparse.Namespace
        The parsed command line.
    world : World
        The simulation.
    """
    x, y, z = (given.at + [None])[:3]
    world.move(given.name, (x, y, z), given.yaw)
    position, attitude = world.pose(given.name)
    numbers = tuple(round(value, 2) + 0.0 for value in tuple(position) + (yaw_of(attitude),))
    print("%s is at (%.2f, %.2f, %.2f), heading %.2f rad" % ((given.name,) + numbers))


def make_delete_parser() -> argparse.ArgumentParser:
    """Return the parser of delete_obstacle."""
    parser = _parser("delete_obstacle", "Delete models from a running simulation, except robots.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of models")
    parser.add_argument("--all", action="store_true", help="all obstacles added by add_obstacle and by clicks")
    return parser


def delete_obstacle(given: argparse.Namespace, world: World) -> None:
    """Run the command delete_obstacle.

    Parameters
    ----------
    given : argparse.Namespace
        The parsed command line.
    world : World
        The simulation.
    """
    names = sorted(world.obstacles()) if given.all else given.names
    for name in names:
        world.delete(name)
        print("%s is deleted" % name)
    if not names:
        print("no obstacles have been added")


def make_list_parser() -> argparse.ArgumentParser:
    """Return the parser of list_obstacles."""
    return _parser("list_obstacles", "List the obstacles in a simulation that add_obstacle and clicks have added.")


def list_obstacles(_: argparse.Namespace, world: World) -> None:
    """Run the command list_obstacles: print a line for each obstacle.

    Parameters
    ----------
    _ : argparse.Namespace
        The parsed command line.
    world : World
        The simulation.
    """
    found = world.obstacles()
    for name, (kind, size, (position, attitude)) in sorted(found.items()):
        print(_describe(name, kind, size, position, yaw_of(attitude)))
    if not found:
        print("no obstacles have been added")


def _check_move(parser: argparse.ArgumentParser, given: argparse.Namespace) -> None:
    if len(given.at) not in (2, 3):
        parser.error("--at takes X Y or X Y Z")


def _check_delete(parser: argparse.ArgumentParser, given: argparse.Namespace) -> None:
    if given.all == bool(given.names):
        parser.error("expected either names or --all")


def _check_nothing(parser: argparse.ArgumentParser, given: argparse.Namespace) -> None:
    """Accept everything."""


#: Name of a command -> its parser, its check of the options, and its function.
COMMANDS: Dict[str, Tuple[Callable[[], argparse.ArgumentParser],
                          Callable[[argparse.ArgumentParser, argparse.Namespace], None],
                          Callable[[argparse.Namespace, World], None]]] = {
    "add_obstacle": (make_add_parser, _check_add, add_obstacle),
    "move_obstacle": (make_move_parser, _check_move, move_obstacle),
    "delete_obstacle": (make_delete_parser, _check_delete, delete_obstacle),
    "list_obstacles": (make_list_parser, _check_nothing, list_obstacles)}


def parse(command: str, words: Sequence[str]) -> argparse.Namespace:
    """Return the parsed command line; wrong usage ends the program with code 2.

    Parameters
    ----------
    command : str
        One of ``COMMANDS``.
    words : sequence of str
        Its arguments.
    """
    make_parser, check, _ = COMMANDS[command]
    parser = make_parser()
    given = parser.parse_args([without_exponent(word) for word in words])
    check(parser, given)
    return given


def main(command: str, argv: Optional[List[str]] = None) -> int:
    """Run a command.

    Parameters
    ----------
    command : str
        One of ``COMMANDS``.
    argv : list of str, optional
        Command line, the program's name first; default: that of this process.

    Returns
    -------
    int
        The exit code.
    """
    given = parse(command, without_remappings(sys.argv if argv is None else argv)[1:])
    problem: Union[str, SimError, None] = no_master()
    if problem is None:
        from m2wr_tools.obstacles.world import World
        try:
            COMMANDS[command][2](given, World(given.gazebo_namespace))
            return 0
        except SimError as error:
            problem = error
    sys.stderr.write("%s: %s\n" % (command, problem))
    return 1
