# SPDX-License-Identifier: BSD-3-Clause
"""Output files of a replay; an error in one file does not affect the others."""
from __future__ import annotations

import json
import math
import os
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, Tuple

from m2wr_files.atomic_files import write_atomically
from m2wr_gmapping.graph_view import graph_of
from m2wr_gmapping.io import state
from m2wr_maps import map_file

if TYPE_CHECKING:
    import argparse

    from m2wr_gmapping.replay.replay_command import Replay
    from m2wr_node.array_types import FloatArray

NAMES = ("trajectory", "tracked", "online", "graph", "map", "stats", "save_state")       # options that name files


def pose_lines(stamps: Iterable[float], poses: Iterable[FloatArray]) -> str:
    """Return the text of a trajectory file: stamp x y z qx qy qz qw.

    Parameters
    ----------
    stamps : iterable of K float
        [s]
    poses : iterable of K (3,) float64
        In ``map`` [m, m, rad].
    """
    return "".join("{:.9f} {:.6f} {:.6f} 0 0 0 {:.9f} {:.9f}\n".format(
        stamp, x, y, math.sin(0.5 * theta), math.cos(0.5 * theta)) for stamp, (x, y, theta) in zip(stamps, poses))


def missing_folders(options: argparse.Namespace) -> List[str]:
    """Return the missing folders of the requested files."""
    asked = [getattr(options, name) for name in NAMES]
    folders = {os.path.dirname(os.path.abspath(path)) for path in asked if path}
    return sorted(folder for folder in folders if not os.path.isdir(folder))


def _write(path: str, text: str) -> List[str]:
    """Write a file atomically; raises OSError with its name."""
    try:
        write_atomically((path, [text.encode()]))
    except OSError as error:
        raise OSError("cannot write {}: {}; what was there before is kept".format(
            path, error.strerror or error)) from error
    return [path]


def save(replay: Replay, options: argparse.Namespace) -> Tuple[List[str], List[Exception]]:
    """Write the requested files.

    Parameters
    ----------
    replay : Replay
        After a run that gave a map.
    options : argparse.Namespace

    Returns
    -------
    list of str, list of Exception
        The written paths, and an error for each file that could not be written.
    """
    mapper, grid, snapshot = replay.mapper, replay.grid, replay.snapshot
    assert mapper is not None and grid is not None

    def save_state(path: str) -> List[str]:
        if snapshot is None:
            return []
        state.save(path, snapshot)
        return [path]

    def save_map(name: str) -> List[str]:
        return map_file.save(name, grid.data, grid.resolution, [grid.origin[0], grid.origin[1], 0.0])

    writers: Dict[str, Callable[[str], List[str]]] = dict(
        trajectory=lambda path: _write(path, pose_lines(*mapper.trajectory(between_too=False))),
        tracked=lambda path: _write(path, pose_lines(*mapper.trajectory())),
        online=lambda path: _write(path, pose_lines(*zip(*replay.online)) if replay.online else ""),
        graph=lambda path: _write(path, graph_of(mapper).text() + "\n"),
        map=save_map,
        stats=lambda path: _write(path, json.dumps(replay.statistics(), indent=2, sort_keys=True) + "\n"),
        save_state=save_state)
    written: List[str] = []
    errors: List[Exception] = []
    for name in NAMES:
        path = getattr(options, name)
        if not path:
            continue
        try:
            written += writers[name](path)
        except (OSError, state.StateError) as error:
            errors.append(error)
    return written, errors
