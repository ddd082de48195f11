# SPDX-License-Identifier: BSD-3-Clause
"""Topics from which a viewer can show a world: markers of its objects, and the description of the robot.

Markers show collision shapes, which lasers measure and robots collide with. Robots have no markers:
viewers show them by their description and tf.  Ground has a topic of its own, because it is large and never moves.
"""
import copy
import logging
import threading
from typing import Any, Dict, List, Optional, Tuple

import rospy
from geometry_msgs.msg import Point, Pose
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_sim.geometry import compose
from m2wr_sim.model.ground import COLOUR, Ground, ground_of, is_ground, tinted
from m2wr_sim.model.types import Box, Collision, Cylinder, Link, Mesh, MeshFile, Model, Sphere
from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.ros.convert import write_pose
from m2wr_sim.runtime.schedule import StrictSchedule
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger("m2wr_sim")

MOST_TRIANGLES = 5000           # of one mesh; larger meshes take too long to send
MOST_GROUND = 20000             # triangles of one piece of ground, about 2.5 MB
STILL = 5e-4                    # m, and for quaternions: smaller motion is ignored, as bodies at rest creep
OTHER_COLOUR = (0.6, 0.6, 0.6, 1.0)
MATERIALS = {"black": (0.0, 0.0, 0.0), "blue": (0.0, 0.0, 1.0), "green": (0.0, 1.0, 0.0), "grey": (0.7, 0.7, 0.7),
             "darkgrey": (0.175, 0.175, 0.175), "orange": (1.0, 0.5, 0.0), "purple": (1.0, 0.0, 1.0),
             "red": (1.0, 0.0, 0.0), "turquoise": (0.0, 1.0, 1.0), "white": (1.0, 1.0, 1.0),
             "yellow": (1.0, 1.0, 0.0), "wood": (0.72, 0.53, 0.30), "bricks": (0.65, 0.33, 0.24)}


def is_robot(record: Model) -> bool:
    """Return whether a model is a robot: it or one of its sensors has a plugin."""
    return bool(record.plugins) or any(sensor.plugins for link in record.links for sensor in link.sensors)


def colour_of(link: Link, collision: Collision) -> Tuple[float, ...]:
    """Return the colour (r, g, b, a) of a collision.

    It is the colour of the visual of the same shape, else of the link's first visual with a colour.

    Parameters
    ----------
    link : Link
    collision : Collision
    """
    coloured = [visual for visual in link.visuals if visual.rgba or visual.material]
    shape = collision.geometry
    same = [visual for visual in coloured if visual.geometry.__class__ is shape.__class__ and visual.geometry == shape
            or isinstance(visual.geometry, MeshFile) and isinstance(shape, Mesh)
            and visual.geometry.path == shape.source]
    for visual in same + coloured:
        if visual.rgba:
            return tuple(visual.rgba)
        known = MATERIALS.get((visual.material or "").rsplit("/", 1)[-1].lower())
        if known:
            return known + (1.0,)
    return OTHER_COLOUR


def marker_of(collision: Collision, pose: Any, colour: Tuple[float, ...]) -> Optional[Marker]:
    """Return the Marker of a collision without frame and name, or None for a shape that is not shown.

    Planes and heightmaps have none, nor have meshes of more than ``MOST_TRIANGLES``.

    Parameters
    ----------
    collision : Collision
    pose : (position, orientation)
        In the world; metres, quaternion x, y, z, w.
    colour : tuple of 4 floats
        r, g, b, a in 0 to 1.
    """
    shape, marker = collision.geometry, Marker(action=Marker.ADD)
    if isinstance(shape, Box):
        marker.type, size = Marker.CUBE, shape.size
    elif isinstance(shape, Sphere):
        marker.type, size = Marker.SPHERE, (2.0 * shape.radius,) * 3
    elif isinstance(shape, Cylinder):
        marker.type, size = Marker.CYLINDER, (2.0 * shape.radius, 2.0 * shape.radius, shape.length)
    elif isinstance(shape, Mesh) and len(shape.triangles) <= MOST_TRIANGLES:
        marker.type, size = Marker.TRIANGLE_LIST, (1.0, 1.0, 1.0)
        marker.points = [Point(*corner) for corner in shape.vertices[shape.triangles.ravel()].tolist()]
    else:
        return None
    marker.scale.x, marker.scale.y, marker.scale.z = size
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
    write_pose(marker.pose, *pose)
    return marker


def ground_marker(ground: Ground, colour: Tuple[float, ...]) -> Marker:
    """Return the shaded Marker of a piece of ground without frame and name.

    Parameters
    ----------
    ground : Ground
        In the frame of the marker.
    colour : tuple of 3 or 4 floats
        r, g, b in 0 to 1.
    """
    marker = Marker(action=Marker.ADD, type=Marker.TRIANGLE_LIST)
    marker.scale.x = marker.scale.y = marker.scale.z = marker.color.a = marker.pose.orientation.w = 1.0
    marker.color.r, marker.color.g, marker.color.b = colour[:3]
    points = [Point(*point) for point in ground.points.tolist()]
    colours = [ColorRGBA(*rgb, 1.0) for rgb in tinted(ground.shades, colour).tolist()]
    corners = ground.triangles.ravel().tolist()
    marker.points, marker.colors = [points[corner] for corner in corners], [colours[corner] for corner in corners]
    return marker


def moved(marker: Marker, pose: Any) -> Marker:
    """Return a copy of a marker at another pose; the given one may still be in use by a publisher.

    Parameters
    ----------
    marker : visualization_msgs.msg.Marker
    pose : (position, orientation)
        In the frame of the marker; metres, quaternion x, y, z, w.
    """
    other = copy.copy(marker)
    other.pose = Pose()
    write_pose(other.pose, *pose)
    return other


class _Shown:
    """The markers of one model, their links, and the last poses of the links."""

    def __init__(self, model: Any, engine: Any, frame: str) -> None:
        self.model = model
        self.parts: List[Tuple[Any, Any, Marker]] = []
        self._poses: Optional[Dict[Any, Any]] = None
        links = {handle: link for link in model.record.links
                 for name, handle in model.handle.links.items() if name == link.name}
        for handle, collision, _ in engine.collisions(model.handle):
            pose = compose(engine.link_pose(handle), collision.pose)
            if model.record.static and is_ground(collision.geometry, pose):
                continue                # see GroundMarkers
            marker = marker_of(collision, pose, colour_of(links[handle], collision))
            if marker is None:
                if isinstance(collision.geometry, Mesh):
                    log.info("%s: a mesh of %d triangles has no world marker; at most %d are shown",
                             model.name, len(collision.geometry.triangles), MOST_TRIANGLES)
                continue
            marker.header.frame_id, marker.ns, marker.id = frame, model.name, len(self.parts)
            self.parts.append((handle, collision.pose, marker))

    def follow(self, engine: Any) -> bool:
        """Move the markers to the poses of their links; return whether any has moved."""
        poses = {handle: engine.link_pose(handle) for handle in {part[0] for part in self.parts}}
        if self._poses is not None and all(
                abs(one - two) <= STILL for handle, pose in poses.items()
                for one, two in zip(tuple(pose[0]) + tuple(pose[1]),
                                    tuple(self._poses[handle][0]) + tuple(self._poses[handle][1]))):
            return False
        self._poses = poses
        self.parts = [(handle, offset, moved(marker, compose(poses[handle], offset)))
                      for handle, offset, marker in self.parts]
        return True


class LatchedPort:
    """A topic of the simulation's ports whose last message later subscribers receive too."""

    def __init__(self, ports: Any, topic: str, message_class: Any) -> None:
        self._port = ports.advertise(topic, message_class, 1, "")
        self._port.latch()
        self.publish, self.wanted = self._port.publish, self._port.wanted


class MarkerPlugin(Plugin):
    """Publishes markers of the world's models; :meth:`turn` is also called while the simulation is paused."""

    _simulator: Simulator

    def configure(self, spec: Any, ctx: Any) -> None:
        """Do nothing: this plugin belongs to no tag.

        Parameters
        ----------
        spec, ctx
            Not used.
        """

    def next_before(self, now_ns: int) -> Optional[int]:
        return now_ns + self._simulator.step_ns if self._changed() else NEVER

    def before_step(self, now_ns: int) -> None:
        self.turn()

    def _changed(self) -> bool:
        """Return whether there may be something to publish."""
        raise NotImplementedError

    def turn(self) -> None:
        """Publish what has changed."""
        raise NotImplementedError

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Publish what has changed.

        Parameters
        ----------
        now_ns, rewound
            Not used.
        """
        self.turn()


class WorldMarkers(MarkerPlugin):
    """Publishes all markers whenever one was added, removed or moved.

    Parameters
    ----------
    simulator : Simulator
    port : LatchedPort
        For a MarkerArray.
    frame : str
        Frame of the markers; its axes are those of the world.
    rate : float
        Rate of checks for changes [Hz of simulated time]; 0: only at the start.
    """

    def __init__(self, simulator: Simulator, port: LatchedPort, frame: str, rate: float) -> None:
        self._simulator, self._port, self._frame = simulator, port, frame
        self._schedule = StrictSchedule(rate, simulator.now_ns) if rate else None
        self._models: Optional[List[Any]] = None        # of the last check, robots too
        self._seen: Optional[List[Any]] = None          # those of them that have markers
        self._placements: Any = None
        self._shown: List[_Shown] = []
        self._moving = False
        self.look()

    def next_before(self, now_ns: int) -> Optional[int]:
        schedule, step_ns = self._schedule, self._simulator.step_ns
        if schedule is None or not (self._moving or self._changed()):
            return NEVER                    # static models move only by requests, after which this is asked again
        schedule.skip(now_ns)               # checks omitted meanwhile are not made up for
        return max(schedule.next_due(now_ns, step_ns), now_ns + step_ns)

    def _changed(self) -> bool:
        """Return whether models were added, removed or placed since the last check."""
        simulator = self._simulator
        return self._placements != simulator.engine.placements or self._models != list(simulator.models.values())

    def before_step(self, now_ns: int) -> None:
        if self._schedule is not None and self._schedule.due(now_ns):
            self.look(now_ns)

    def turn(self) -> None:
        """Publish changes by services while the simulation is paused; called regularly."""
        if self._simulator.paused and self._schedule is not None:
            self.look()

    def look(self, now_ns: Optional[int] = None) -> None:
        """Publish all markers, after the clock if a time is given, if anything has changed."""
        simulator = self._simulator
        changed, models = False, list(simulator.models.values())
        if models != self._models:
            self._models, models = models, [model for model in models if not is_robot(model.record)]
            if models != self._seen:
                known = {id(shown.model): shown for shown in self._shown}
                self._shown = [known.get(id(model)) or _Shown(model, simulator.engine, self._frame) for model in models]
                self._seen, changed = models, True
                self._moving = not all(model.record.static for model in models)
        elsewhere = self._placements != simulator.engine.placements     # a placed model may be static
        self._placements = simulator.engine.placements
        for shown in self._shown:
            if elsewhere or changed or not shown.model.record.static:
                changed |= shown.follow(simulator.engine)
        if changed:
            if now_ns is not None:
                simulator.ports.moment(now_ns)
            first = Marker(action=Marker.DELETEALL)
            first.header.frame_id = self._frame
            self._port.publish(MarkerArray([first] + [part[2] for shown in self._shown for part in shown.parts]))

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Restart the schedule and publish changes.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Not used.
        """
        if self._schedule is not None:
            self._schedule.restart(now_ns)
            self.look()


class GroundMarkers(MarkerPlugin):
    """Publishes the ground of static models: heightmaps, and meshes that face up everywhere.

    Parameters
    ----------
    simulator : Simulator
    port : LatchedPort
        For a MarkerArray.  Nothing is published until there is ground.
    frame : str
        Frame of the markers; its axes are those of the world.
    """

    def __init__(self, simulator: Simulator, port: LatchedPort, frame: str) -> None:
        self._simulator, self._port, self._frame = simulator, port, frame
        self._models: Optional[List[Any]] = None
        self._placements: Any = None
        self._published: List[Any] = []         # models and poses of the last array
        self.turn()

    def _changed(self) -> bool:
        simulator = self._simulator
        return self._placements != simulator.engine.placements or self._models != list(simulator.models.values())

    def turn(self) -> None:
        """Publish all ground again if a model was added, removed or placed."""
        if not self._changed():
            return
        engine = self._simulator.engine
        self._models, self._placements = list(self._simulator.models.values()), engine.placements
        pieces = [(model, handle, collision, compose(engine.link_pose(handle), collision.pose))
                  for model in self._models if model.record.static
                  for handle, collision, _ in engine.collisions(model.handle)]
        pieces = [piece for piece in pieces if is_ground(piece[2].geometry, piece[3])]
        if [(id(piece[0]), piece[3]) for piece in pieces] == self._published:
            return
        self._published = [(id(piece[0]), piece[3]) for piece in pieces]
        markers = [Marker(action=Marker.DELETEALL)]
        grounds = ground_of([(collision.geometry, pose) for _, _, collision, pose in pieces], MOST_GROUND)
        for (model, handle, collision, _), ground in zip(pieces, grounds):
            link = next(link for link in model.record.links if model.handle.links[link.name] == handle)
            colour = colour_of(link, collision)
            marker = ground_marker(ground, COLOUR if colour is OTHER_COLOUR else colour)
            marker.ns, marker.id = model.name, len(markers)
            markers.append(marker)
        for marker in markers:
            marker.header.frame_id = self._frame
        self._port.publish(MarkerArray(markers))


class DescriptionTopic:
    """Publishes the parameter ``robot_description`` as a latched topic of this name, so that recordings contain it.

    It is read at the start. If it was not set, it is read again after each change of the models.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator, self._models = simulator, 0
        self._publisher: Optional[rospy.Publisher] = None
        self._reader: Optional[threading.Thread] = None
        self._read()

    def turn(self) -> None:
        """Read the parameter again if the number of models has changed; returns at once."""
        models = len(self._simulator.models)
        if models == self._models or self._publisher is not None or (self._reader and self._reader.is_alive()):
            return
        self._models = models
        self._reader = threading.Thread(target=self._read, name="robot_description", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        try:
            text = rospy.get_param("robot_description", None)
        except Exception as error:      # no master: the node detects this elsewhere
            log.debug("robot_description: %s", error)
            return
        if isinstance(text, str) and text.strip():
            self._publisher = rospy.Publisher("robot_description", String, latch=True, queue_size=1)
            self._publisher.publish(text)
