# SPDX-License-Identifier: BSD-3-Clause
"""Planners and methods in many worlds, on all cores; what was driven is kept in a file and not driven again."""
from __future__ import annotations

import hashlib
import json
import math
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Sequence, Tuple

import numpy as np

from m2wr_navigation.compare.comparison import Comparison
from m2wr_navigation.compare.drawing import thinned
from m2wr_navigation.compare.statistics import bootstrap, wilson

if TYPE_CHECKING:
    from m2wr_navigation.compare.drive import Robot
    from m2wr_navigation.compare.scenes import Scene

    Record = Dict[str, Any]

APART = 0.1                 # m between two points of a stored path
LARGEST_FILE = 200e6        # bytes of records that are read


def _content(world: str) -> str:
    """Return a digest of the world's file; empty: it is no file, but a name or a text."""
    try:
        with open(world, "rb") as stream:
            return hashlib.sha256(stream.read()).hexdigest()
    except (OSError, ValueError):
        return ""


@dataclass(frozen=True)
class Job:
    """One drive.

    Attributes
    ----------
    scene : Scene
    name : str
        Of the planner or method.
    robot : Robot
    limit : float
        Greatest simulated time [s].
    seed : int
        Of the noise of the sensors.
    """

    scene: Scene
    name: str
    robot: Robot
    limit: float
    seed: int

    @property
    def key(self) -> str:
        """What makes it the same drive."""
        body = self.robot.body
        told = json.dumps([asdict(self.scene), _content(self.scene.world), self.name, str(self.robot.model),
                           body.turning_radius, body.axle_x, body.laser, sorted(self.robot.limits.items()), self.limit,
                           self.seed])
        return hashlib.sha256(told.encode()).hexdigest()[:24]


@lru_cache(maxsize=2)
def _comparison(scene: Scene, limit: float, seed: int, robot_key: int) -> Comparison:
    return Comparison(scene.world, scene.start, scene.goal, limit, seed, _ROBOTS[robot_key])


_ROBOTS: Dict[int, Robot] = {}


def run(job: Job) -> Record:
    """Return the record of a drive."""
    robot_key = hash((str(job.robot.model), tuple(sorted(job.robot.limits.items()))))
    _ROBOTS[robot_key] = job.robot
    comparison = _comparison(job.scene, job.limit, job.seed, robot_key)
    entry, = comparison.entries([job.name])
    record = entry.record()
    record.update(key=job.key, scene=job.scene.name, optimum_m=comparison.optimum.length,
                  path=np.round(thinned(entry.path, APART), 2).tolist())
    return record


def stored(path: str) -> Dict[str, Record]:
    """Return the records of a file of earlier drives by their keys; a line that was cut off is left out.

    Parameters
    ----------
    path : str

    Raises
    ------
    ValueError
        If it is not such a file.
    """
    if not os.path.exists(path):
        return {}
    if os.path.getsize(path) > LARGEST_FILE:
        raise ValueError("{} has more than {:.0f} MB; expected records of drives".format(path, LARGEST_FILE / 1e6))
    found: Dict[str, Record] = {}
    with open(path, encoding="utf-8") as file:
        lines = file.read().split("\n")
    for number, line in enumerate(lines, 1):
        try:
            record = json.loads(line) if line else {}
        except ValueError:
            if number < len(lines) - 1:
                raise ValueError("{}, line {}: not JSON; expected a record of a drive".format(path, number)) from None
            continue
        if isinstance(record, dict) and isinstance(record.get("key"), str):
            found[record["key"]] = record
    return found


def _drop_cut_line(path: str) -> None:
    """Remove what follows the last end of a line, so that the next record begins a line."""
    if os.path.exists(path):
        with open(path, "rb+") as file:
            text = file.read()
            file.truncate(text.rfind(b"\n") + 1)


def drive_all(jobs: Sequence[Job], path: str, workers: int,
              driven_by: Callable[[Job], Record] = run) -> Iterator[Tuple[Record, bool]]:
    """Yield the record of each job, and whether it was driven now; new ones are added to a file at once.

    Parameters
    ----------
    jobs : sequence of Job
    path : str
        The file of records.
    workers : int
        Processes.
    driven_by : callable, optional
        Gives the record of a job, with its key; a function of a module.
    """
    known = stored(path)
    left = []
    for job in jobs:
        if job.key in known:
            yield known[job.key], False
        else:
            left.append(job)
    if not left:
        return
    _drop_cut_line(path)
    with open(path, "a", encoding="utf-8") as file, ProcessPoolExecutor(workers) as pool:
        waiting = [pool.submit(driven_by, job) for job in left]
        try:
            for done in as_completed(waiting):
                record = done.result()
                file.write(json.dumps(record, allow_nan=False) + "\n")
                file.flush()
                yield record, True
        finally:
            for one in waiting:
                one.cancel()


def summary(name: str, records: Sequence[Record]) -> Record:
    """Return the figures of a planner or method over all worlds; means are over its successes.

    Parameters
    ----------
    name : str
    records : sequence of dict
        Of all names.
    """
    mine = [record for record in records if record["name"] == name]
    good = [record for record in mine if record["success"]]
    found: Record = {"name": name, "kind": mine[0]["kind"] if mine else "", "worlds": len(mine),
                     "successes": len(good), "success_interval": list(wilson(len(good), len(mine))),
                     "contacts": sum(record["contacts"] for record in mine),
                     "met": sum(record.get("met", 0) for record in mine),
                     "struck": sum(record.get("struck", 0) for record in mine)}
    for key, used in (("ratio", good), ("time", good), ("clearance", good), ("cpu_ms", mine)):
        values = [record[key] for record in used if record[key] is not None]
        found[key] = [value if math.isfinite(value) else None for value in bootstrap(values)]
    return found


def ranked(records: Sequence[Record]) -> List[Record]:
    """Return the summaries of all names: most successes first, then the shortest paths."""
    names = sorted({record["name"] for record in records})
    return sorted((summary(name, records) for name in names),
                  key=lambda one: (-one["successes"] / max(one["worlds"], 1), one["ratio"][0] or math.inf))
