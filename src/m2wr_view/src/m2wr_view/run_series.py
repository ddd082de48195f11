# SPDX-License-Identifier: BSD-3-Clause
"""Time series of a recorded run: clearance from the obstacles, speeds, odometry against truth.

Arrays in, arrays out; what was not recorded is None.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.bag_file import read_messages
from m2wr_view.frames import yaw_of
from m2wr_view.outlines import M2WR_FOOTPRINT, footprint_distances, point_distances
from m2wr_view.solids import Solids, read_robot

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline
    from m2wr_view.run_log import RunLog

MARKERS, COMMANDS, ODOMETRY = "/gazebo/world_markers", "/cmd_vel", "/odom"
ROBOT_STATES, DESCRIPTION = "/gazebo/robot_states", "/robot_description"
MOST_POSES = 4000           # at which clearance is measured; more are thinned out


class Speeds(NamedTuple):
    """Times [s], linear [m/s] and angular [rad/s] velocities, each (n,)."""

    times: FloatArray
    linear: FloatArray
    angular: FloatArray


class Truth(NamedTuple):
    """True poses (n,) in world, and the error of the odometry: along and across the true heading [m], turn [rad]."""

    times: FloatArray
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    along: FloatArray
    across: FloatArray
    turn: FloatArray


def read_world(path: str) -> Optional[Solids]:
    """Return the :class:`~m2wr_view.solids.Solids` of a bag as they stood at the end; None if not recorded."""
    solids = None
    for _, message, _ in read_messages(path, {MARKERS: "visualization_msgs/MarkerArray"}):
        solids = solids or Solids()
        solids.update(message.markers)
    return solids


def read_footprint(path: str) -> Sequence[Outline]:
    """Return the outlines of the robot of a bag, those of m2wr where no description was recorded."""
    for _, message, _ in read_messages(path, {DESCRIPTION: "std_msgs/String"}):
        return read_robot(message.data).footprint or M2WR_FOOTPRINT
    return M2WR_FOOTPRINT


def clearance_series(log: RunLog, obstacles: Sequence[Outline],
                     footprint: Sequence[Outline] = M2WR_FOOTPRINT) -> Optional[Tuple[FloatArray, FloatArray]]:
    """Return times (n,) [s] and the distance (n,) [m] from robot to nearest obstacle; None without either of them.

    Parameters
    ----------
    log : RunLog
        The run.
    obstacles : sequence of Outline
        In world.
    footprint : sequence of Outline
        Of the robot, in its own frame.
    """
    drive = log.drive
    if drive is None or not len(drive.times) or not obstacles:
        return None
    stride = -(-len(drive.times) // MOST_POSES)
    poses = np.column_stack((drive.x, drive.y, drive.yaw))[::stride]
    reach = max(float(np.max(np.hypot(*part.vertices.T))) + part.radius for part in footprint)
    centre = np.array([point_distances(poses[:, :2], obstacle) for obstacle in obstacles])
    least = np.full(len(poses), np.inf)
    for index in np.argsort(centre.min(axis=1)):
        # the outline is no nearer than the robot's centre is, less its reach
        near = np.flatnonzero(centre[index] - reach < least)
        if len(near):
            least[near] = np.minimum(least[near], footprint_distances(poses[near], obstacles[index], footprint))
    return drive.times[::stride], least


def odometry_speeds(path: str) -> Optional[Speeds]:
    """Return the measured :class:`Speeds` of a bag, or None."""
    rows = [(message.header.stamp.to_sec(), message.twist.twist.linear.x, message.twist.twist.angular.z)
            for _, message, _ in read_messages(path, {ODOMETRY: "nav_msgs/Odometry"})]
    return Speeds(*np.array(rows).T) if rows else None


def commanded_speeds(path: str) -> Optional[Speeds]:
    """Return the commanded :class:`Speeds` of a bag by the recorder's time, or None."""
    rows = [(recorded.to_sec(), message.linear.x, message.angular.z)
            for _, message, recorded in read_messages(path, {COMMANDS: "geometry_msgs/Twist"})]
    return Speeds(*np.array(rows).T) if rows else None


def steady(times: FloatArray) -> FloatArray:
    """Return times (n,) [s] of a topic with a rate of its own, without the jitter of the recorder.

    Times within half a period of a regular grid, which fits most of them, move onto it; the others stay.
    """
    if len(times) < 3:
        return times
    period = float(np.median(np.diff(times)))
    if not period > 0.0:
        return times
    beat = np.round((times - times[0]) / period) * period
    beat = beat + np.median(times - beat)
    return np.maximum.accumulate(np.where(np.abs(times - beat) < 0.5 * period, beat, times))


def truth_against_odometry(path: str, log: RunLog, robot: str = "m2wr") -> Optional[Truth]:
    """Return the :class:`Truth` of a run, or None if it or the odometry was not recorded.

    States have no stamp, so the recorder's time is used; it is early by a clock message now and then, which
    :func:`steady` corrects.

    Parameters
    ----------
    path : str
        A finished bag.
    log : RunLog
        The run.
    robot : str
        Name of its model.
    """
    rows = []
    for _, message, recorded in read_messages(path, {ROBOT_STATES: "gazebo_msgs/ModelStates"}):
        if robot in message.name:
            pose = message.pose[message.name.index(robot)]
            turn = pose.orientation
            rows.append((recorded.to_sec(), pose.position.x, pose.position.y,
                         yaw_of((turn.x, turn.y, turn.z, turn.w))))
    drive = log.drive
    if not rows or drive is None or len(drive.times) < 2:
        return None
    times, x, y, yaw = np.array(rows).T
    times = steady(times)
    yaw = np.unwrap(yaw)
    inside = (drive.times >= times[0]) & (drive.times <= times[-1])
    if not inside.any():
        return None
    at = drive.times[inside]
    true_x, true_y, true_yaw = (np.interp(at, times, values) for values in (x, y, yaw))
    off_x, off_y = drive.x[inside] - true_x, drive.y[inside] - true_y
    cosine, sine = np.cos(true_yaw), np.sin(true_yaw)
    turn = np.remainder(drive.yaw[inside] - true_yaw + np.pi, 2.0 * np.pi) - np.pi
    return Truth(at, true_x, true_y, true_yaw, cosine * off_x + sine * off_y, cosine * off_y - sine * off_x, turn)
