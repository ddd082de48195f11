# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles in a running simulation: added, moved, deleted and listed through Gazebo's services."""
from __future__ import annotations

import logging
import math
import re
from typing import TYPE_CHECKING, Any, Collection, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple
from xml.sax.saxutils import escape

import rosgraph
import rosgraph.names
from geometry_msgs.msg import Pose

from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import (
    DeleteModel,
    GetModelProperties,
    GetModelState,
    GetWorldProperties,
    SetModelState,
    SpawnModel,
)
from m2wr_sim.angles import quaternion_from_rpy, yaw_of
from m2wr_sim.errors import SimError
from m2wr_sim.ros.pose_messages import read_pose, write_pose
from m2wr_tools.obstacles.obstacle import read_link
from m2wr_tools.service_client import CallError, Connection

if TYPE_CHECKING:
    import numpy as np

    from m2wr_sim.geometry import Pose as ModelPose
    from m2wr_sim.geometry import Vector
    from m2wr_tools.obstacles.obstacle import Obstacle
    from m2wr_view.outlines import Outline

log = logging.getLogger("m2wr_sim.obstacles")

SERVICE_PATIENCE = 5.0      # s of wall time for the simulation to answer
_MARKERS_PATIENCE = 2.0     # s for the latched markers of the world, where the simulation has any
_NAME = re.compile(r"^[A-Za-z][\w.-]*$")
_INCLUDE = "<sdf version=\"1.6\"><world name=\"world\"><include><uri>model://{}</uri></include></world></sdf>"
_TRIES = 2000               # places drawn for one obstacle before it is given up
_FARTHEST = 1e6             # m; positions beyond are refused


class ObstacleError(SimError):
    """A request cannot be carried out; one sentence for the user."""


def outline_of(kind: str, size: Sequence[float], pose: ModelPose) -> Outline:
    """Return the area of the floor that an obstacle covers.

    Parameters
    ----------
    kind, size
        As in :class:`~m2wr_tools.obstacles.obstacle.Obstacle`.
    pose : tuple
        Position of the middle of its underside [m] and quaternion, in world.

    Raises
    ------
    ObstacleError
        If a number of the pose is not finite.
    """
    import numpy as np

    from m2wr_view.frames import rotation_of
    from m2wr_view.outlines import box_outline, cylinder_outline, sphere_outline
    rotation = rotation_of(pose[1])
    height = 2.0 * size[0] if kind == "sphere" else size[-1]
    centre = np.array(pose[0]) + rotation.dot((0.0, 0.0, 0.5 * height))
    if kind == "box":
        outline = box_outline(np.array(size), centre, rotation, -math.inf, math.inf)
    elif kind == "sphere":
        outline = sphere_outline(size[0], centre, -math.inf, math.inf)
    else:
        outline = cylinder_outline(size[0], size[1], centre, rotation, -math.inf, math.inf)
    if outline is None:
        raise ObstacleError("obstacle at (%g, %g, %g) m: expected finite numbers" % tuple(pose[0]))
    return outline


class World:
    """The models of a simulation behind Gazebo's services.

    Parameters
    ----------
    namespace : str
        Of the services.

    Raises
    ------
    ObstacleError
        By every method, if the simulation is not there or refuses.
    """

    def __init__(self, namespace: str = "/gazebo") -> None:
        self._root = namespace.rstrip("/")
        self._connections: Dict[str, Connection] = {}

    def _call(self, name: str, kind: Any, *arguments: object) -> Any:
        service, known = "%s/%s" % (self._root, name), name in self._connections
        try:
            if not known:       # kept open: there are several calls for each model
                self._connections[name] = Connection(service, kind, SERVICE_PATIENCE)
            answer = self._connections[name](*arguments)
        except CallError as error:
            if name in self._connections:
                self._connections.pop(name).close()
            if known:           # the simulation may have been started again
                return self._call(name, kind, *arguments)
            raise ObstacleError("no simulation answers: %s. Start one, for example with \"roslaunch m2wr_sim "
                                "bug2.launch\"" % error) from error
        if not answer.success:
            raise ObstacleError("%s: %s" % (service, answer.status_message))
        return answer

    def names(self) -> List[str]:
        """Return the names of all models."""
        return list(self._call("get_world_properties", GetWorldProperties).model_names)

    def pose(self, name: str) -> ModelPose:
        """Return ``(position, quaternion)`` of a model."""
        return read_pose(self._call("get_model_state", GetModelState, name, "").pose)

    def kind_of(self, name: str) -> Tuple[str, Optional[Tuple[str, Tuple[float, ...]]]]:
        """Return ``("robot", None)``, ``("obstacle", (kind, size))`` or ``("model", None)``."""
        properties = self._call("get_model_properties", GetModelProperties, name)
        shape = read_link(properties.body_names[0]) if len(properties.body_names) == 1 else None
        if shape is not None:
            return "obstacle", shape
        return ("robot" if properties.joint_names and not properties.is_static else "model"), None

    def obstacles(self) -> Dict[str, Tuple[str, Tuple[float, ...], ModelPose]]:
        """Return ``{name: (kind, size, pose)}`` of the obstacles that this module has added."""
        found: Dict[str, Tuple[str, Tuple[float, ...], ModelPose]] = {}
        for name in self.names():
            _, shape = self.kind_of(name)
            if shape is not None:
                found[name] = shape + (self.pose(name),)
        return found

    def robots(self) -> Dict[str, ModelPose]:
        """Return ``{name: pose}`` of all robots: models that have joints and are not fixed."""
        return {name: self.pose(name) for name in self.names() if self.kind_of(name)[0] == "robot"}

    def solids(self) -> List[Outline]:
        """Return the outlines of all obstacles of robots, without the robots.

        Without the topic of world markers, as with another simulator, these are the obstacles of this module.
        """
        import rospy
        from visualization_msgs.msg import Marker, MarkerArray

        from m2wr_view.solids import Solids
        topic, own = self._root + "/world_markers", self.obstacles()
        others: List[Outline] = []
        try:
            known = dict(rospy.get_published_topics())
        except OSError:         # no master any more: the next call reports it
            known = {}
        if topic in known:
            try:
                message, solids = rospy.wait_for_message(topic, MarkerArray, timeout=_MARKERS_PATIENCE), Solids()
                # markers are published after a delay; the services give the present state
                there = set(self.names()) - set(own)
                solids.update([marker for marker in message.markers
                               if marker.action == Marker.DELETEALL or marker.ns in there])
                others = solids.blocking
            except rospy.ROSException:
                log.warning("no message on %s within %g s; only the obstacles of this command are taken into account",
                            topic, _MARKERS_PATIENCE)
        return list(others) + [outline_of(*own[name]) for name in sorted(own)]

    def free_name(self, taken: Collection[str], stem: str = "obstacle") -> str:
        """Return ``obstacle1``, ``obstacle2``, ...: the first free name.

        Parameters
        ----------
        taken : collection of str
            Names in use.
        stem : str
            The name without its number.
        """
        number = 1
        while "%s%d" % (stem, number) in taken:
            number += 1
        return "%s%d" % (stem, number)

    def add(self, obstacle: Obstacle, position: Vector, yaw: float = 0.0, name: str = "") -> str:
        """Add an obstacle to the world.

        Parameters
        ----------
        obstacle : m2wr_tools.obstacles.obstacle.Obstacle
        position : (float, float, float)
            Of the middle of its underside [m].
        yaw : float
            [rad]
        name : str
            Empty: a free one.

        Returns
        -------
        str
            Its name.

        Raises
        ------
        ObstacleError
            If the name or the pose is not valid, the name is in use, or the simulation refuses.
        """
        taken = self.names()
        name = name or self.free_name(taken)
        if not _NAME.match(name):
            raise ObstacleError("name \"%s\": expected letters, digits, dots, - and _, a letter first" % name)
        if name in taken:
            raise ObstacleError("name \"%s\" is taken; in the world are %s" % (name, some_of(taken)))
        self._spawn(name, obstacle.sdf(name), position, yaw)
        return name

    def add_model(self, model: str, position: Vector, yaw: float = 0.0) -> str:
        """Add a model that the simulation finds as ``model://NAME``.

        Parameters
        ----------
        model : str
            Name of its folder.
        position : (float, float, float)
            Of its frame [m].
        yaw : float
            [rad]

        Returns
        -------
        str
            Its name in the world.

        Raises
        ------
        ObstacleError
            If the pose is not valid, or the simulation refuses.
        """
        name = self.free_name(self.names(), re.sub(r"[^\w.-]", "_", model) + "_")
        self._spawn(name, _INCLUDE.format(escape(model)), position, yaw)
        return name

    def _spawn(self, name: str, sdf: str, position: Vector, yaw: float) -> None:
        _check_place(position, yaw)
        pose = Pose()
        write_pose(pose, position, quaternion_from_rpy(0.0, 0.0, yaw))
        self._call("spawn_sdf_model", SpawnModel, name, sdf, "", pose, "")

    def move(self, name: str, position: Tuple[float, float, Optional[float]], yaw: Optional[float] = None) -> None:
        """Move a model; it is at rest afterwards.

        Parameters
        ----------
        name : str
            Name of the model.
        position : (float, float, float or None)
            x, y, z of its frame in world [m]; z None: as it is.
        yaw : float, optional
            Heading [rad], upright; None: the present attitude.
        """
        self._known(name)
        old, attitude = self.pose(name)
        place = position[0], position[1], old[2] if position[2] is None else position[2]
        _check_place(place, yaw or 0.0)
        state = ModelState(model_name=name)
        write_pose(state.pose, place, attitude if yaw is None else quaternion_from_rpy(0.0, 0.0, yaw))
        self._call("set_model_state", SetModelState, state)

    def delete(self, name: str, robots_too: bool = False) -> None:
        """Delete a model.

        Parameters
        ----------
        name : str
            Name of the model.
        robots_too : bool
            Whether robots may be deleted.

        Raises
        ------
        ObstacleError
            If there is no such model, it is a robot, or the simulation refuses.
        """
        self._known(name)
        if not robots_too and self.kind_of(name)[0] == "robot":
            raise ObstacleError("\"%s\" is a robot; \"rosservice call %s/delete_model %s\" deletes it anyway"
                                % (name, self._root, name))
        self._call("delete_model", DeleteModel, name)

    def _known(self, name: str) -> None:
        names = self.names()
        if name not in names:
            raise ObstacleError("there is no model \"%s\"; in the world are %s" % (name, some_of(names)))


def some_of(names: Iterable[str], most: int = 12) -> str:
    """Return names as a list in text, the first few if there are many.

    Parameters
    ----------
    names : iterable of str
        In any order; they are sorted.
    most : int
        Largest number of names.
    """
    ordered = sorted(names)
    return ", ".join(ordered[:most]) + (" and %d more" % (len(ordered) - most) if len(ordered) > most else "")


def _check_place(position: Vector, yaw: float) -> None:
    if not all(math.isfinite(value) and abs(value) <= _FARTHEST for value in tuple(position) + (yaw,)):
        raise ObstacleError("place %s with heading %s: expected finite numbers, not beyond %g m" % (
            tuple(position), yaw, _FARTHEST))


# ---- near robots ---------------------------------------------------------------------------------------------------

def robot_footprint() -> Sequence[Outline]:
    """Return the outlines of the robot in the parameter ``robot_description``; those of m2wr if there is none."""
    from m2wr_view.errors import ViewError
    from m2wr_view.outlines import M2WR_FOOTPRINT
    caller = rosgraph.names.make_caller_id("m2wr_obstacles")
    try:
        text = rosgraph.Master(caller).getParam(rosgraph.names.resolve_name("robot_description", caller))
        from m2wr_view.solids import read_robot
        footprint = read_robot(text).footprint if isinstance(text, str) else None
    except (OSError, rosgraph.MasterException, ViewError):
        footprint = None
    return footprint or M2WR_FOOTPRINT


def overlapped_robots(outline: Outline, robots: Mapping[str, ModelPose], footprint: Sequence[Outline]) -> List[str]:
    """Return the names of the robots, sorted, that an outline overlaps.

    Parameters
    ----------
    outline : Outline
        In world.
    robots : dict
        Pose of each robot, by name.
    footprint : sequence of Outline
        Of every robot, in its own frame.
    """
    return [name for name, pose in sorted(robots.items()) if _gap(outline, pose, footprint) <= 0.0]


def _gap(outline: Outline, pose: ModelPose, footprint: Sequence[Outline]) -> float:
    """Return the distance [m] of an outline from a robot at a pose."""
    import numpy as np

    from m2wr_view.outlines import footprint_distances
    return float(footprint_distances(np.array([[pose[0][0], pose[0][1], yaw_of(pose[1])]]), outline, footprint)[0])


class Places:
    """Draws random places near a robot that are free.

    Parameters
    ----------
    centre : tuple
        Pose of the robot.
    solids : list of Outline
        Obstacles; each placed one is added.
    robots : dict
        Poses of all robots.
    footprint : sequence of Outline
        Of every robot.
    clearance, within : float
        Least distance from anything, and greatest of the middle from the robot's [m].
    generator : numpy.random.Generator
    """

    def __init__(self, centre: ModelPose, solids: Iterable[Outline], robots: Mapping[str, ModelPose],
                 footprint: Sequence[Outline], clearance: float, within: float, generator: np.random.Generator) -> None:
        self._centre, self._solids, self._robots, self._footprint = centre, list(solids), robots, footprint
        self._clearance, self._within, self._generator = clearance, within, generator

    def draw(self, obstacle: Obstacle) -> Tuple[float, float, float]:
        """Return ``(x, y, yaw)`` [m, rad] for an obstacle and add it there; ObstacleError if no place is free."""
        for _ in range(_TRIES):
            angle, yaw = self._generator.uniform(-math.pi, math.pi, 2)
            distance = self._within * math.sqrt(self._generator.uniform())      # even over the disc
            x, y = (round(float(middle + distance * turn), 3) for middle, turn in
                    zip(self._centre[0], (math.cos(angle), math.sin(angle))))
            yaw = round(float(yaw), 3)
            outline = outline_of(obstacle.kind, obstacle.size, ((x, y, 0.0), quaternion_from_rpy(0.0, 0.0, yaw)))
            if self._is_free(outline):
                self._solids.append(outline)
                return x, y, yaw
        raise ObstacleError("no room for a %s of %s m within %g m of (%.2f, %.2f), %g m from everything; take a "
                            "smaller one, fewer, or a greater --within" % (
                                obstacle.kind, " x ".join("%g" % value for value in obstacle.size), self._within,
                                self._centre[0][0], self._centre[0][1], self._clearance))

    def _is_free(self, outline: Outline) -> bool:
        import numpy as np

        from m2wr_view.outlines import footprint_distances
        if any(_gap(outline, pose, self._footprint) < self._clearance for pose in self._robots.values()):
            return False
        origin = np.zeros((1, 3))
        return all(footprint_distances(origin, solid, [outline])[0] >= self._clearance for solid in self._solids)
