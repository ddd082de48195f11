# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a run: distance, time, clearance from the obstacles of the world file."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import M2WR_FOOTPRINT, least_clearance

if TYPE_CHECKING:
    from m2wr_sim.model.types import World
    from m2wr_view.outlines import Outline
    from m2wr_view.run_log import RunLog


@dataclass(frozen=True)
class Summary:
    """Figures of a run; lengths in metres, times in simulated seconds, None for what was not recorded.

    ``duration`` ends at the final state, ``least_clearance`` is infinite in a world without obstacles, and
    ``state_changes`` does not count the first state of the run.
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


def summarise(log: RunLog, world: World, footprint: Sequence[Outline] = M2WR_FOOTPRINT) -> Summary:
    """Return the :class:`Summary` of a run in a world; the obstacles are at the places of the world file.

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


def summarise_log(log: RunLog, obstacles: Optional[Sequence[Outline]],
                  footprint: Sequence[Outline] = M2WR_FOOTPRINT) -> Summary:
    """Return the :class:`Summary` of a run among obstacles.

    Parameters
    ----------
    log : RunLog
        The run.
    obstacles : sequence of Outline or None
        In world; None if not known.
    footprint : sequence of Outline
        The robot from above, in the frame of link_chassis.
    """
    path_length = end_distance = duration = clearance = time = position = straight = None
    name, start = "", log.start
    final_state = log.states[-1][1] if log.states else None
    drive = log.drive
    if drive is not None and len(drive.times):
        start = start or (drive.x[0], drive.y[0])
        path_length = float(np.sum(np.hypot(np.diff(drive.x), np.diff(drive.y))))
        end = drive.times[-1]
        if log.states and final_state in ("goal_reached", "goal_unreachable"):
            end = log.states[-1][0]
        duration = max(0.0, float(end - drive.times[0]))
        closest = None if obstacles is None else least_clearance(
            np.column_stack((drive.x, drive.y, drive.yaw)), obstacles, footprint)
        if closest is not None:
            clearance, name = closest.distance, closest.name
        if closest is not None and closest.index is not None:
            time = float(drive.times[closest.index] - drive.times[0])
            position = (float(drive.x[closest.index]), float(drive.y[closest.index]))
        if log.goal is not None:
            end_distance = math.hypot(log.goal[0] - drive.x[-1], log.goal[1] - drive.y[-1])
    if start is not None and log.goal is not None:
        straight = math.hypot(log.goal[0] - start[0], log.goal[1] - start[1])
    return Summary(path_length, straight, end_distance, duration, clearance, time, position, name,
                   len(log.states) - 1 if log.states else None, final_state, log.contacts, log.mean_factor)


def format_table(summary: Summary) -> str:
    """Return the summary as text: one line for each value."""
    length, clearance = _text("%.2f m", summary.path_length), _text("%.3f m", summary.least_clearance)
    if summary.path_length is not None and summary.straight_distance:
        length += " (%.2f times the straight line)" % (summary.path_length / summary.straight_distance)
    if summary.clearance_position is not None and summary.clearance_time is not None:
        clearance += " to %s, at (%.2f, %.2f) after %.1f s" % (
            summary.clearance_name or "an obstacle", *summary.clearance_position, summary.clearance_time)
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


def _text(form: str, value: Optional[float]) -> str:
    return "not recorded" if value is None else form % value
