# SPDX-License-Identifier: BSD-3-Clause
"""Writes a made log: a bag with /scan and /tf, ground truth beside it, the recipe, and the building as a world."""
from __future__ import annotations

import json
import math
import os
from dataclasses import asdict
from typing import TYPE_CHECKING, List, Tuple

import numpy as np
import rosbag
import rospy
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_files.atomic_files import write_atomically
from m2wr_tools.slam_benchmark.laser_logs import EPOCH, planar_transform
from m2wr_tools.slam_logs.sensing import MOUNT, RANGE_MIN

if TYPE_CHECKING:
    from m2wr_tools.slam_logs.log_sets import MadeLog

DELAY = 2.0                 # greatest delay of a late scan [s]


def arrivals(log: MadeLog, rng: np.random.Generator) -> List[Tuple[float, int]]:
    """Return (time of arrival [s], index of the scan) of all scans that arrive, in order.

    Parameters
    ----------
    log : MadeLog
    rng : numpy.random.Generator
    """
    faults, stamps = log.recipe.faults, log.drive.stamps[log.taken]
    times = stamps.copy()
    kept = rng.random(len(stamps)) >= faults.dropped
    kept[0] = True
    late = rng.random(len(stamps)) < faults.late
    times[late] += rng.uniform(0.0, DELAY, int(late.sum()))
    for index in np.flatnonzero(rng.random(len(stamps) - 1) < faults.swapped):
        times[index] = max(times[index], times[index + 1] + 1e-3)
    return sorted((float(times[index]), int(index)) for index in np.flatnonzero(kept))


def _scan(log: MadeLog, index: int) -> LaserScan:
    laser = log.recipe.laser
    message = LaserScan(angle_min=-0.5 * laser.field, angle_max=0.5 * laser.field,
                        angle_increment=laser.field / (laser.beams - 1), range_min=RANGE_MIN,
                        range_max=laser.range_max, ranges=log.ranges[index].tolist())
    message.header.stamp = rospy.Time.from_sec(EPOCH + float(log.drive.stamps[log.taken[index]]))
    message.header.frame_id = "laser"
    return message


def write_bag(log: MadeLog, path: str, rng: np.random.Generator) -> None:
    """Write /tf (odom -> base_link -> laser) at every record, and /scan as the scans arrive.

    Parameters
    ----------
    log : MadeLog
    path : str
    rng : numpy.random.Generator
        For drops, swaps and delays.
    """
    messages = arrivals(log, rng)
    with rosbag.Bag(path, "w") as bag:
        following = 0
        for seconds, pose in zip(log.drive.stamps, log.odometry):
            stamp = rospy.Time.from_sec(EPOCH + float(seconds))
            bag.write("/tf", TFMessage([planar_transform("odom", "base_link", stamp, *pose),
                                        planar_transform("base_link", "laser", stamp, *MOUNT)]), stamp)
            while following < len(messages) and messages[following][0] <= seconds:
                time, index = messages[following]
                bag.write("/scan", _scan(log, index), rospy.Time.from_sec(EPOCH + time))
                following += 1


def drift(log: MadeLog) -> float:
    """Return the error of odometry at the end of the drive, relative to its length."""
    end, start = log.drive.poses[-1], log.drive.poses[0]
    c, s = math.cos(start[2]), math.sin(start[2])
    dx, dy = end[0] - start[0], end[1] - start[1]
    true = c * dx + s * dy, c * dy - s * dx
    return float(np.hypot(log.odometry[-1, 0] - true[0], log.odometry[-1, 1] - true[1]) / max(log.drive.length, 1e-9))


def write(log: MadeLog, folder: str, rng: np.random.Generator) -> str:
    """Write NAME.bag, NAME.graph (stamp x y theta of the base at each scan), NAME.json and NAME.world.

    The bag is written last and under its name when it is complete.

    Parameters
    ----------
    log : MadeLog
    folder : str
    rng : numpy.random.Generator

    Returns
    -------
    str
        Path of the bag.
    """
    base = os.path.join(folder, log.recipe.name)
    truth = ["%.6f %.6f %.6f %.8f\n" % (EPOCH + log.drive.stamps[record], *log.drive.poses[record])
             for record in log.taken]
    details = dict(asdict(log.recipe), metres=round(log.drive.length, 2), seconds=float(log.drive.stamps[-1]),
                   spins=len(log.drive.spins), drift=round(drift(log), 4))
    details["laser"]["nominal"] = list(MOUNT)
    write_atomically((base + ".graph", ["".join(truth).encode()]),
                     (base + ".json", [json.dumps(details, indent=1, sort_keys=True).encode()]),
                     (base + ".world", [log.plan.sdf().encode()]))
    write_bag(log, base + ".bag.part", rng)
    os.replace(base + ".bag.part", base + ".bag")
    return base + ".bag"
