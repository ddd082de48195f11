# SPDX-License-Identifier: BSD-3-Clause
"""What runs leave for the next one: a map, and the experience of all drives, in a folder.

``map.yaml`` and ``map.pgm`` are files of map_saver; ``experience.json`` has the drives, and ``run_N.txt`` the track of
each one with lines 'stamp x y z qx qy qz qw', N being the run's number. Each is replaced as a whole. A file that
cannot be used is named with the reason, and renamed to ``NAME.damaged`` or ``NAME.damaged.2`` and so on: nothing that
was driven is lost.
"""
from __future__ import annotations

import json
import logging
import math
import os
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np

from m2wr_files.atomic_files import write_atomically
from m2wr_maps import map_file
from m2wr_maps.saved_map_reader import MapReadingError, read_map
from m2wr_navigation.best_path.track import Track

if TYPE_CHECKING:
    from m2wr_navigation.best_path.scoring import Scorer
    from m2wr_navigation.best_path.track import ObstacleField
    from m2wr_node.array_types import FloatArray, Int8Array, Vector

log = logging.getLogger(__name__)

FORMAT, VERSION = "m2wr best path", 1
MAP, EXPERIENCE, DAMAGED = "map", "experience.json", ".damaged"
LARGEST = 1 << 25           # bytes of a file of experience
MOST_RUNS = 100             # that are kept: of each start and goal the best one, and the newest ones
MOST_SAMPLES = 100000       # of a track
MOST_FILES = 1000           # damaged ones that are kept
FARTHEST = 1e6              # m: greatest coordinate
GREATEST = 1e12             # greatest number of any kind: times are up to 2e9 s
LONGEST = 1000              # characters of a text
PERIOD = 0.1                # s between two samples of a stored track
SAME_START, SAME_GOAL = 0.5, 0.2        # m: runs between places so near to each other can be compared
REACHED = "reached"


class ExperienceError(ValueError):
    """A file of experience cannot be used; the message says why."""


@dataclass(frozen=True)
class Run:
    """One drive.

    Attributes
    ----------
    how : str
        ``Bug 2``, or the name of the candidate that was driven.
    outcome, reason : str
        ``reached``, or why not.
    track : Track
    plan : (N, 3) float64
        What was followed, N = 0: no single plan [m, m, rad].
    amounts : dict of str to float
        Of each criterion, as measured after the drive.
    total : float
        Score at that time [m].
    number : int
        From 1, in the order of the drives; 0: not yet in a memory.
    """

    how: str
    outcome: str
    reason: str
    track: Track
    plan: FloatArray
    amounts: Dict[str, float]
    total: float
    number: int = 0

    def leads(self, start: Vector, goal: Vector) -> bool:
        """Return whether the run reached this goal from this start.

        Parameters
        ----------
        start, goal : (2,) float
            [m]
        """
        begin, end = self.track.poses[0, :2], self.track.goal
        return self.outcome == REACHED and math.hypot(begin[0] - start[0], begin[1] - start[1]) <= SAME_START \
            and math.hypot(end[0] - goal[0], end[1] - goal[1]) <= SAME_GOAL

    def record(self) -> Dict[str, Any]:
        """Return everything for JSON."""
        rows = np.column_stack([self.track.stamps, self.track.poses])
        rows = rows[::-(-len(rows) // MOST_SAMPLES)]
        return {"number": self.number, "how": self.how, "outcome": self.outcome, "reason": self.reason,
                "goal": self.track.goal.tolist(), "track": np.round(rows, 5).tolist(),
                "plan": np.round(self.plan, 5).tolist(), "amounts": self.amounts, "total": self.total}


@dataclass
class Memory:
    """The content of a folder.

    Attributes
    ----------
    folder : str
    cells : (H, W) int8 or None
        Map: -1 unknown, 0 free, 100 occupied.
    resolution : float
        [m]
    origin : (float, float)
        Corner of cell (0, 0) [m].
    runs : list of Run
        The oldest first.
    """

    folder: str
    cells: Optional[Int8Array] = None
    resolution: float = 0.05
    origin: Tuple[float, float] = (0.0, 0.0)
    runs: List[Run] = field(default_factory=list)

    def best(self, start: Vector, goal: Vector) -> Optional[Tuple[int, Run]]:
        """Return number (from 1) and record of the run with the least score between two places, or None.

        Parameters
        ----------
        start, goal : (2,) float
            [m]
        """
        fitting = [(run.number, run) for run in self.runs if run.leads(start, goal)]
        return min(fitting, key=lambda entry: entry[1].total) if fitting else None

    def add(self, run: Run) -> Run:
        """Append a run; return it with its number.

        Parameters
        ----------
        run : Run
        """
        run = replace(run, number=1 + max((one.number for one in self.runs), default=0))
        self.runs.append(run)
        return run

    def rescore(self, scorer: Scorer, obstacles: ObstacleField) -> None:
        """Score all runs again, by the weights and the obstacles that are known now.

        Parameters
        ----------
        scorer : Scorer
        obstacles : ObstacleField
        """
        scores = [scorer.score(run.track, obstacles) for run in self.runs]
        self.runs = [replace(run, amounts=score.amounts, total=score.total) for run, score in zip(self.runs, scores)]

    def save_map(self) -> None:
        """Write the map; raises OSError if that is not possible."""
        if self.cells is not None:
            os.makedirs(self.folder, exist_ok=True)
            map_file.save(os.path.join(self.folder, MAP), self.cells, self.resolution, (*self.origin, 0.0))

    def save_runs(self) -> None:
        """Write the experience; raises OSError if that is not possible."""
        os.makedirs(self.folder, exist_ok=True)
        entries = self._keep()
        head = json.dumps({"format": FORMAT, "version": VERSION})[:-1]
        text = head + ', "runs": [' + ", ".join(entries) + "]}"
        files = [(os.path.join(self.folder, EXPERIENCE), [text.encode()])]
        if self.runs:       # for plot_map, and other programs that read the format of the TUM data sets
            newest = self.runs[-1]
            files.append((os.path.join(self.folder, "run_{}.txt".format(newest.number)), [_tum(newest.track)]))
        write_atomically(*files)

    def _keep(self) -> List[str]:
        """Drop runs until :func:`load` can read the rest; return their JSON texts.

        The newest one is kept, then the best one of each start and goal, then the newer ones before the older ones.
        """
        best: List[Run] = []
        for run in sorted(self.runs, key=lambda one: one.total):
            if run.outcome == REACHED and not any(other.leads(run.track.poses[0, :2], run.track.goal)
                                                  for other in best):
                best.append(run)
        needed = {id(run) for run in best + self.runs[-1:]}
        newest = len(self.runs) - 1
        order = sorted(range(len(self.runs)), key=lambda k: (k < newest, id(self.runs[k]) not in needed, -k))
        kept: Dict[int, str] = {}
        size = 1000             # for what is around the runs
        for k in order[:MOST_RUNS]:
            text = json.dumps(self.runs[k].record(), allow_nan=False)
            size += len(text) + 2
            if size > LARGEST and kept:
                break
            kept[k] = text
        self.runs = [self.runs[k] for k in sorted(kept)]
        return [kept[k] for k in sorted(kept)]


def _tum(track: Track) -> bytes:
    lines = ["{:.3f} {:.4f} {:.4f} 0 0 0 {:.6f} {:.6f}".format(stamp, x, y, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
             for stamp, (x, y, yaw) in zip(track.stamps, track.poses)]
    return ("\n".join(lines) + "\n").encode()


def load(folder: str, keep_damaged: bool = True) -> Memory:
    """Return what a folder holds; what is missing or damaged is left out.

    Parameters
    ----------
    folder : str
    keep_damaged : bool
        Whether a damaged file is renamed, so that it is not overwritten; otherwise nothing is changed.
    """
    memory = Memory(folder)
    _load_map(memory, keep_damaged)
    path = os.path.join(folder, EXPERIENCE)
    try:
        memory.runs = _read_runs(path)
    except FileNotFoundError:
        pass
    except (OSError, ExperienceError) as error:
        _set_aside(path, error, keep_damaged)
    return memory


def _load_map(memory: Memory, keep_damaged: bool) -> None:
    path = os.path.join(memory.folder, MAP + ".yaml")
    if not os.path.lexists(path):
        return
    try:
        found = read_map(path)
    except MapReadingError as error:
        _set_aside(path, error, keep_damaged)
        return
    memory.cells, memory.resolution, memory.origin = found.data, found.resolution, tuple(found.origin.tolist())


def _set_aside(path: str, error: Exception, keep: bool) -> None:
    if not keep:
        return
    names = [path + DAMAGED] + ["{}{}.{}".format(path, DAMAGED, k) for k in range(2, MOST_FILES + 1)]
    kept = next((name for name in names if not os.path.lexists(name)), names[-1])
    try:
        os.replace(path, kept)
    except OSError as second:
        log.warning("%s cannot be used: %s; it cannot be renamed either: %s", path, error, second)
        return
    log.warning("%s cannot be used and is now %s: %s", path, os.path.basename(kept), error)


def _read_runs(path: str) -> List[Run]:
    with open(path, "rb") as stream:
        data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise ExperienceError("it has more than {} bytes".format(LARGEST))
    try:
        found = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ExperienceError("it is no JSON: {}".format(error)) from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise ExperienceError("its format is not {!r}".format(FORMAT))
    if found.get("version") != VERSION:
        raise ExperienceError("its version is {!r}; expected {}".format(found.get("version"), VERSION))
    runs = found.get("runs")
    if not isinstance(runs, list) or len(runs) > MOST_RUNS:
        raise ExperienceError("runs is no list of at most {}".format(MOST_RUNS))
    return [_run_of(entry, number) for number, entry in enumerate(runs, 1)]


def _run_of(entry: Any, number: int) -> Run:
    if not isinstance(entry, dict):
        raise ExperienceError("run {} is no object".format(number))
    place = "run {}, ".format(number)
    rows, goal = _array(entry, "track", 4, place), _array(entry, "goal", 0, place)
    amounts, total, count = entry.get("amounts"), entry.get("total"), entry.get("number", number)
    how, outcome, reason = (entry.get(name) for name in ("how", "outcome", "reason"))
    if goal.shape != (2,) or not len(rows) or (np.diff(rows[:, 0]) <= 0.0).any():
        raise ExperienceError(place + "track or goal: expected increasing times, and two numbers")
    plan = _array(entry, "plan", 3, place)
    if max(np.abs(part).max() for part in (rows[:, 1:], goal, plan) if part.size) > FARTHEST:
        raise ExperienceError(place + "track, goal or plan: expected coordinates up to {:g}".format(FARTHEST))
    if not _is_number(count) or count != int(count) or count < 1:
        raise ExperienceError(place + "number: expected an integer from 1 on")
    if not isinstance(amounts, dict) or not all(_is_number(value) for value in list(amounts.values()) + [total]):
        raise ExperienceError(place + "amounts or total: expected finite numbers")
    if not (isinstance(how, str) and isinstance(outcome, str) and isinstance(reason, str)):
        raise ExperienceError(place + "how, outcome or reason: expected texts")
    return Run(how[:LONGEST], outcome[:LONGEST], reason[:LONGEST], Track(rows[:, 0], rows[:, 1:], goal),
               plan, {str(key): float(value) for key, value in amounts.items()},
               float(total or 0.0), int(count))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= GREATEST


def _array(entry: Dict[str, Any], name: str, columns: int, place: str) -> FloatArray:
    """Return a table of finite numbers (N, columns), or for 0 columns (N,)."""
    rows = entry.get(name)
    if not isinstance(rows, list) or len(rows) > MOST_SAMPLES:
        raise ExperienceError("{}{}: expected a list of at most {}".format(place, name, MOST_SAMPLES))
    flat = rows if not columns else [value for row in rows if isinstance(row, list) and len(row) == columns
                                     for value in row]
    if len(flat) != len(rows) * max(columns, 1) or not all(_is_number(value) for value in flat):
        raise ExperienceError("{}{}: expected rows of {} finite numbers".format(place, name, max(columns, 1)))
    found = np.array(flat, float)
    return found.reshape(-1, columns) if columns else found
