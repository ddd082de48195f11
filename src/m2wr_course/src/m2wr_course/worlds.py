# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 5: a world in which Bug 2 must follow two walls and reaches its goal."""
from __future__ import annotations

from typing import Iterator

from m2wr_course.finding import Finding
from m2wr_sim.api.loading import read_world
from m2wr_tools.bug2_runner import run_bug2

START, GOAL, WALLS, LIMIT = (0.0, 8.0), (0.0, -4.0), 2, 900.0


def two_walls(path: str) -> Iterator[Finding]:
    """Exercise 5.

    Parameters
    ----------
    path : str
        World file; start and goal are those of ``bug2.launch``.

    Yields
    ------
    Finding
    """
    run = run_bug2(read_world(path), START, GOAL, limit=LIMIT)
    hits = run.points("wall_following")
    yield Finding(len(hits) >= WALLS, "Bug 2 meets a wall %d times%s" % (
        len(hits), "".join(", at (%.1f, %.1f)" % hit for hit in hits)),
        "place obstacles across the line from (0, 8) to (0, -4) in %d places, at least a metre apart" % WALLS)
    yield Finding(run.outcome == "goal_reached",
                  "the run ends after %.0f s: %s (%s)" % (run.time, run.outcome, run.reason),
                  "leave a free path: gaps of at least 1.4 m, and no obstacle closer than 0.8 m to the goal")
    yield Finding(not run.contacts, "the robot has contact with %s" % (
        ", ".join(sorted({contact.second for contact in run.contacts})) or "nothing"),
        "no obstacle may be within 0.5 m of the start, or lower than the laser, 0.15 m")
