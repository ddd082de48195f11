# SPDX-License-Identifier: BSD-3-Clause
"""Motion along way points that reacts to nothing: actors with a script, and two plugins for any model.

``libm2wr_way_points.so`` is this simulator's own: way points with times, or with one speed. The name
``libTrajectoryActorPlugin.so`` is that of a plugin which worlds with pedestrians use; there it stops before obstacles.
"""
from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Sequence

from m2wr_sim.control.pose_track import PoseScript, PoseTrack
from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import multiply, quaternion_from_rpy, yaw_of
from m2wr_sim.physics.engine import FARTHEST, FASTEST
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.scripted_models import ScriptedModels

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Quaternion

SPEED = 0.8                     # m/s, default of the trajectory plugin
MOST_POINTS = 100000
LONGEST = 1e9                   # s: thirty years
TURNING = 0.3                   # s, for a turn on the spot at a way point


class ScriptedMotion(Plugin):
    """Moves a model along a script, with the others of the world: see :mod:`m2wr_sim.plugins.scripted_models`."""

    places_model = True         # the model is kinematic: forces and contacts do not move it
    _together: Optional[ScriptedModels] = None

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        script = self._read(spec, ctx)
        if script is not None:
            self._together = ctx.shared(ScriptedModels)
            self._member = self._together.join(script, ctx)

    def _read(self, spec: PluginReader, ctx: PluginContext) -> Optional[PoseScript]:
        """Return what to do, None for nothing; PluginError if the tags cannot be used."""
        raise NotImplementedError

    def reset(self, now_ns: int, rewound: bool) -> None:
        if self._together is not None:
            self._together.restart(self._member, now_ns)

    def close(self) -> None:
        if self._together is not None:
            self._together.leave(self._member)


class ActorMotion(ScriptedMotion):
    """The ``<script>`` of an ``<actor>``; it needs no plugin element."""

    def _read(self, spec: PluginReader, ctx: PluginContext) -> Optional[PoseScript]:
        script = ctx.script
        if script is None or not script.trajectories or not script.auto_start:
            return None
        tracks = [PoseTrack(part.times, part.poses, part.tension) for part in script.trajectories]
        return PoseScript(tracks, script.loop, script.delay)


class WayPoints(ScriptedMotion):
    """``libm2wr_way_points.so``: ``<waypoint>`` with ``<pose>``, and with ``<time>`` or all at one ``<speed>``."""

    def _read(self, spec: PluginReader, ctx: PluginContext) -> Optional[PoseScript]:
        spec.ignore("waypoint")
        points = _numbers(spec, ("waypoint/time", "waypoint/pose"))
        poses = [_pose(spec, values) for values in points["waypoint/pose"]]
        _check_count(spec, len(poses), "<waypoint> with <pose>")
        loop, delay = spec.flag("loop", True), spec.number("delay_start", 0.0, 0.0)
        speed, tension = spec.number("speed", SPEED), None
        if spec.text("tension", ""):
            tension = spec.number("tension", 0.0, 0.0)
            if tension > 1.0:
                raise PluginError("%s: <tension> is %g; expected a number from 0 to 1" % (spec.spec.where, tension))
        times = [values[0] for values in points["waypoint/time"] if values]
        if not times:
            return PoseScript([_at_speed(spec, poses, speed, tension)], loop, min(delay, LONGEST))
        if len(times) != len(poses):
            raise PluginError("%s: %d way points have <time>, %d <pose>; expected both in each, or no <time>"
                              % (spec.spec.where, len(times), len(poses)))
        by_time: Dict[float, Pose] = {}
        for time, pose in zip(times, poses):
            if not 0.0 <= time <= LONGEST:
                raise PluginError("%s: <time> of a way point is %g; expected 0 to %g s"
                                  % (spec.spec.where, time, LONGEST))
            by_time[time] = pose
        if times != sorted(by_time):
            ctx.log.warning("%s: way points are not sorted by time, or two have the same; they are taken in the order "
                            "of time, of two the last one", spec.spec.where)
        order = sorted(by_time)
        return PoseScript([PoseTrack(order, [by_time[time] for time in order], tension)], loop, min(delay, LONGEST))


class TrajectoryActor(ScriptedMotion):
    """``libTrajectoryActorPlugin.so``: from ``<target>`` to ``<target>`` and again from the first, at ``<velocity>``.

    It faces where it goes, and stands upright at the height of its own pose.
    """

    def _read(self, spec: PluginReader, ctx: PluginContext) -> Optional[PoseScript]:
        spec.ignore("target", "target_radius", "animation", "animation_factor", "update_frequency", "ignore_obstacle",
                    "ignore_obstacles")
        told = [tag for tag, _ in spec.spec.parameters if tag in ("obstacle", "obstacle_margin")]
        spec.ignore("obstacle", "obstacle_margin")
        if told:
            ctx.log_once(logging.WARNING, "%s: <%s> has no effect: this model stops for nothing", spec.spec.where,
                         told[0])
        targets = [_pose(spec, values) for values in _numbers(spec, ("target",))["target"]]
        _check_count(spec, len(targets), "<target>")
        own = ctx.model_state()
        height, upright = own.position[2], _tilt(own.orientation)
        poses: List[Pose] = []
        for ((x, y, _), _), ((to_x, to_y, _), _) in zip(targets, targets[1:] + targets[:1]):
            turn = upright(math.atan2(to_y - y, to_x - x))
            poses += [((x, y, height), turn), ((to_x, to_y, height), turn)]
        poses.append(poses[0])
        return PoseScript([_at_speed(spec, poses, spec.number("velocity", SPEED), None)])


def _tilt(orientation: Sequence[float]) -> Callable[[float], Quaternion]:
    """Return a function that turns an orientation about the vertical, to a yaw [rad] of where it faces."""
    first = yaw_of(orientation)
    return lambda yaw: multiply(quaternion_from_rpy(0.0, 0.0, yaw - first), orientation)


def _numbers(spec: PluginReader, tags: Sequence[str]) -> Dict[str, List[List[float]]]:
    """Return the numbers of all tags of some names, in document order; PluginError for text and for huge numbers."""
    found: Dict[str, List[List[float]]] = {tag: [] for tag in tags}
    for tag, text in spec.spec.parameters:
        if tag not in found:
            continue
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = [math.nan]
        if not all(abs(value) <= LONGEST for value in values):
            raise PluginError("%s: <%s> holds \"%s\"; expected numbers of at most %g"
                              % (spec.spec.where, tag.rpartition("/")[2], text[:60], LONGEST))
        found[tag].append(values)
    return found


def _pose(spec: PluginReader, values: Sequence[float]) -> Pose:
    """Return the pose of three numbers or six, x y z roll pitch yaw."""
    if len(values) not in (3, 6) or not all(abs(value) <= FARTHEST for value in values[:3]):
        raise PluginError("%s: a way point has the numbers %s; expected x y z or x y z roll pitch yaw, at most %g m "
                          "from the origin" % (spec.spec.where, list(values)[:7], FARTHEST))
    x, y, z, roll, pitch, yaw = (*values, 0.0, 0.0, 0.0)[:6]
    return (x, y, z), quaternion_from_rpy(roll, pitch, yaw)


def _check_count(spec: PluginReader, count: int, what: str) -> None:
    if not 2 <= count <= MOST_POINTS:
        raise PluginError("%s: there are %d %s; expected 2 to %d" % (spec.spec.where, count, what, MOST_POINTS))


def _at_speed(spec: PluginReader, poses: Sequence[Pose], speed: float, tension: Optional[float]) -> PoseTrack:
    """Return a track along poses at one speed [m/s]; one that repeats the last one is left out."""
    if not 0.0 < speed <= FASTEST:
        raise PluginError("%s: the speed is %g; expected more than 0 and at most %g m/s"
                          % (spec.spec.where, speed, FASTEST))
    times, kept = [0.0], [poses[0]]
    for pose in poses[1:]:
        taken = math.sqrt(sum((a - b) ** 2 for a, b in zip(pose[0], kept[-1][0]))) / speed
        if taken < 1e-6:
            if pose[1] == kept[-1][1]:
                continue
            taken = TURNING
        times.append(times[-1] + taken)
        kept.append(pose)
    return PoseTrack(times, kept, tension)
