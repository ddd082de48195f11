# SPDX-License-Identifier: BSD-3-Clause
"""What a viewer needs to show a world from topics alone: markers of everything that stands about, the robots' text.

Markers are of collision shapes, for that is what lasers see and robots bump into; robots themselves are left to viewers
that know their description and tf.
"""
import copy
import logging
import threading

import rospy
from geometry_msgs.msg import Point, Pose
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_sim.geometry import compose
from m2wr_sim.model.types import Box, Cylinder, Mesh, Sphere
from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.ros.convert import write_pose
from m2wr_sim.runtime.schedule import StrictSchedule

log = logging.getLogger("m2wr_sim")

MOST_TRIANGLES = 5000           # of one mesh; more would take longer to send than anybody looks at it
STILL = 5e-4                    # m, and of quaternions: what moves less stays where it is shown; bodies at rest creep
OTHER_COLOUR = (0.6, 0.6, 0.6, 1.0)
MATERIALS = {"black": (0.0, 0.0, 0.0), "blue": (0.0, 0.0, 1.0), "green": (0.0, 1.0, 0.0), "grey": (0.7, 0.7, 0.7),
             "darkgrey": (0.175, 0.175, 0.175), "orange": (1.0, 0.5, 0.0), "purple": (1.0, 0.0, 1.0),
             "red": (1.0, 0.0, 0.0), "turquoise": (0.0, 1.0, 1.0), "white": (1.0, 1.0, 1.0),
             "yellow": (1.0, 1.0, 0.0), "wood": (0.72, 0.53, 0.30), "bricks": (0.65, 0.33, 0.24)}


def is_robot(record):
    """Tell whether a model has plugins of its own, which makes it a robot rather than part of its surroundings."""
    return bool(record.plugins) or any(sensor.plugins for link in record.links for sensor in link.sensors)


def colour_of(link, collision):
    """Return the colour (r, g, b, a) of a collision: that of the visual with its shape, else of the link's first."""
    coloured = [visual for visual in link.visuals if visual.rgba or visual.material]
    same = [visual for visual in coloured if visual.geometry.__class__ is collision.geometry.__class__
            and visual.geometry == collision.geometry]
    for visual in same + coloured:
        if visual.rgba:
            return tuple(visual.rgba)
        known = MATERIALS.get(visual.material.rsplit("/", 1)[-1].lower())
        if known:
            return known + (1.0,)
    return OTHER_COLOUR


def marker_of(collision, pose, colour):
    """Return the Marker of a collision at a pose in world, without frame and name; None for what is not shown.

    Planes and heightmaps are ground; meshes are shown up to ``MOST_TRIANGLES``.
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


def moved(marker, pose):
    """Return a marker like this one at another pose; this one stays as it is, it may be on its way to somebody."""
    other = copy.copy(marker)
    other.pose = Pose()
    write_pose(other.pose, *pose)
    return other


class _Shown:
    """One model among the markers: which link each marker hangs on, and where the links were last."""

    def __init__(self, model, engine, frame):
        self.model, self.parts, self._poses = model, [], None
        links = {handle: link for link in model.record.links
                 for name, handle in model.handle.links.items() if name == link.name}
        for handle, collision, _ in engine.collisions(model.handle):
            pose = compose(engine.link_pose(handle), collision.pose)
            marker = marker_of(collision, pose, colour_of(links[handle], collision))
            if marker is None:
                if isinstance(collision.geometry, Mesh):
                    log.info("%s: a mesh of %d triangles is not among the world markers, which stop at %d",
                             model.name, len(collision.geometry.triangles), MOST_TRIANGLES)
                continue
            marker.header.frame_id, marker.ns, marker.id = frame, model.name, len(self.parts)
            self.parts.append((handle, collision.pose, marker))

    def follow(self, engine):
        """Bring the markers to where their links are now; returns whether anything has moved."""
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
    """A topic of the simulation's ports whose last message late subscribers get as well."""

    def __init__(self, ports, topic, message_class):
        self._port = ports.advertise(topic, message_class, 1, "")
        self._port.latch()
        self.publish, self.wanted = self._port.publish, self._port.wanted


class WorldMarkers(Plugin):
    """Publishes every marker there is, whenever one has come, gone or moved.

    Parameters
    ----------
    simulator : Simulator
    port : LatchedPort
        For a MarkerArray.
    frame : str
        Frame of the markers; its axes are those of the world.
    rate : float
        Looks for changes a second of simulated time [Hz]; 0 looks once, at the start.
    """

    def __init__(self, simulator, port, frame, rate):
        self._simulator, self._port, self._frame = simulator, port, frame
        self._schedule = StrictSchedule(rate, simulator.now_ns) if rate else None
        self._models, self._seen, self._placements, self._shown, self._moving = None, None, None, [], False
        self.look()

    def configure(self, spec, ctx):
        """Nothing to configure: this plugin stands for no tag."""

    def next_before(self, now_ns):
        schedule, step_ns = self._schedule, self._simulator.step_ns
        if schedule is None or not (self._moving or self._changed()):
            return NEVER                    # what cannot move by itself is looked at again when somebody has been here
        schedule.skip(now_ns)               # the looks left out meanwhile are not made up for
        return max(schedule.next_due(now_ns, step_ns), now_ns + step_ns)

    def _changed(self):
        """Tell whether models have come or gone, or been put somewhere, since the last look."""
        simulator = self._simulator
        return self._placements != simulator.engine.placements or self._models != list(simulator.models.values())

    def before_step(self, now_ns):
        if self._schedule.due(now_ns):
            self.look(now_ns)

    def turn(self):
        """Follow what services change while time stands still; called every now and then."""
        if self._simulator.paused and self._schedule is not None:
            self.look()

    def look(self, now_ns=None):
        """Publish all markers if anything has changed since the last look; the clock first, where a time is given."""
        simulator = self._simulator
        changed, models = False, list(simulator.models.values())
        if models != self._models:
            self._models, models = models, [model for model in models if not is_robot(model.record)]
            if models != self._seen:
                known = {id(shown.model): shown for shown in self._shown}
                self._shown = [known.get(id(model)) or _Shown(model, simulator.engine, self._frame) for model in models]
                self._seen, changed = models, True
                self._moving = not all(model.record.static for model in models)
        elsewhere = self._placements != simulator.engine.placements     # what was put somewhere may be static
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

    def reset(self, now_ns, rewound):
        if self._schedule is not None:
            self._schedule.restart(now_ns)
            self.look()


class DescriptionTopic:
    """Publishes the parameter ``robot_description`` as a latched topic of that name, so that recordings hold it.

    It is read at the start and, while there was none, after every change of the models.
    """

    def __init__(self, simulator):
        self._simulator, self._publisher, self._models, self._reader = simulator, None, 0, None
        self._read()

    def turn(self):
        """Read the parameter again if models have come; called every now and then, returns at once."""
        models = len(self._simulator.models)
        if models == self._models or self._publisher is not None or (self._reader and self._reader.is_alive()):
            return
        self._models = models
        self._reader = threading.Thread(target=self._read, name="robot_description", daemon=True)
        self._reader.start()

    def _read(self):
        try:
            text = rospy.get_param("robot_description", None)
        except Exception as error:      # the master has gone: the node will learn of it elsewhere
            log.debug("robot_description: %s", error)
            return
        if isinstance(text, str) and text.strip():
            self._publisher = rospy.Publisher("robot_description", String, latch=True, queue_size=1)
            self._publisher.publish(text)
