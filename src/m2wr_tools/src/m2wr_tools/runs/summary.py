# SPDX-License-Identifier: BSD-3-Clause
"""A run in numbers: how far, how long, how close to the obstacles of the world file."""
import math
from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import M2WR_FOOTPRINT, least_clearance


@dataclass(frozen=True)
class Summary:
    """A run in numbers; lengths in metres, times in simulated seconds, None for what was not recorded.

    ``duration`` lasts until the final state, ``least_clearance`` is infinite in a world without obstacles, and
    ``state_changes`` does not count the state that the run began with.
    """

    path_length: Optional[float]
    straight_distance: Optional[float]
    end_distance: Optional[float]
    duration: Optional[float]
    least_clearance: Optional[float]
    clearance_time: Optional[float]
    clearance_position: Optional[Tuple[float, float]]
    clearance_name: str
    state_changes: Optional[int]
    final_state: Optional[str]
    contacts: Optional[int]
    mean_factor: Optional[float]


def summarise(log, world, footprint=M2WR_FOOTPRINT):
    """Return the :class:`Summary` of a run in a world; obstacles stand where the world file puts them.

    Parameters
    ----------
    log : m2wr_view.run_log.RunLog
        The run.
    world : m2wr_sim.model.types.World
        The world it took place in.
    footprint : sequence of Outline
        The robot from above, in the frame of link_chassis.
    """
    return summarise_log(log, obstacle_outlines(world), footprint)


def summarise_log(log, obstacles, footprint=M2WR_FOOTPRINT):
    """Return the :class:`Summary` of a run among outlines of obstacles; None where those are not known."""
    path_length = end_distance = duration = clearance = time = position = straight = None
    name, start = "", log.start
    final_state = log.states[-1][1] if log.states else None
    if log.times is not None and len(log.times):
        start = start or (log.x[0], log.y[0])
        path_length = float(np.sum(np.hypot(np.diff(log.x), np.diff(log.y))))
        end = log.states[-1][0] if final_state in ("goal_reached", "goal_unreachable") else log.times[-1]
        duration = max(0.0, float(end - log.times[0]))
        closest = None if obstacles is None else least_clearance(
            np.column_stack((log.x, log.y, log.yaw)), obstacles, footprint)
        if closest is not None:
            clearance, name = closest.distance, closest.name
        if closest is not None and closest.index is not None:
            time = float(log.times[closest.index] - log.times[0])
            position = (float(log.x[closest.index]), float(log.y[closest.index]))
        if log.goal is not None:
            end_distance = math.hypot(log.goal[0] - log.x[-1], log.goal[1] - log.y[-1])
    if start is not None and log.goal is not None:
        straight = math.hypot(log.goal[0] - start[0], log.goal[1] - start[1])
    return Summary(path_length, straight, end_distance, duration, clearance, time, position, name,
                   len(log.states) - 1 if log.states else None, final_state, log.contacts, log.mean_factor)


def format_table(summary):
    """Return the summary as text: one line for each value, what was not recorded named as such."""
    length, clearance = _text("%.2f m", summary.path_length), _text("%.3f m", summary.least_clearance)
    if summary.path_length is not None and summary.straight_distance:
        length += " (%.2f times the straight line)" % (summary.path_length / summary.straight_distance)
    if summary.clearance_position is not None:
        clearance += " to %s, at (%.2f, %.2f) after %.1f s" % (
            (summary.clearance_name or "an obstacle",) + summary.clearance_position + (summary.clearance_time,))
    elif summary.least_clearance == math.inf:
        clearance = "no obstacles in the world"
    rows = (("outcome", (summary.final_state or "not recorded").replace("_", " ")),
            ("simulated time", _text("%.1f s", summary.duration)),
            ("path length", length),
            ("start to goal, straight", _text("%.2f m", summary.straight_distance)),
            ("distance to goal at the end", _text("%.2f m", summary.end_distance)),
            ("least clearance", clearance),
            ("state changes", _text("%d", summary.state_changes)),
            ("contacts", _text("%d", summary.contacts)),
            ("mean real-time factor", _text("%.2f", summary.mean_factor)))
    width = max(len(name) for name, _ in rows)
    return "\n".join("%-*s  %s" % (width, name, value) for name, value in rows)


def _text(form, value):
    return "not recorded" if value is None else form % value
