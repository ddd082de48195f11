# SPDX-License-Identifier: BSD-3-Clause
"""Output files of a replay; an error in one file does not affect the others."""
import json
import math
import os

from m2wr_gmapping.io import map_file, state
from m2wr_gmapping.io.atomic_files import write_atomically

NAMES = ("trajectory", "tracked", "online", "map", "stats", "save_state")       # options that name files


def pose_lines(stamps, poses):
    """Return the text of a trajectory file: stamp x y z qx qy qz qw."""
    return "".join("{:.9f} {:.6f} {:.6f} 0 0 0 {:.9f} {:.9f}\n".format(
        stamp, x, y, math.sin(0.5 * theta), math.cos(0.5 * theta)) for stamp, (x, y, theta) in zip(stamps, poses))


def missing_folders(options):
    """Return the missing folders of the requested files."""
    asked = [getattr(options, name) for name in NAMES]
    folders = {os.path.dirname(os.path.abspath(path)) for path in asked if path}
    return sorted(folder for folder in folders if not os.path.isdir(folder))


def _write(path, text):
    """Write a file atomically; raises OSError with its name."""
    try:
        write_atomically((path, [text.encode()]))
    except OSError as error:
        raise OSError("cannot write {}: {}; what was there before is kept".format(
            path, error.strerror or error)) from error
    return [path]


def save(replay, options):
    """Write the requested files; return the written paths and the errors (lists).

    Parameters
    ----------
    replay : Replay
    options : argparse.Namespace
    """
    mapper, grid = replay.mapper, replay.grid

    def save_state(path):
        state.save(path, replay.snapshot)
        return [path]

    def save_map(name):
        return map_file.save(name, grid.data, grid.resolution, [grid.origin[0], grid.origin[1], 0.0])
    writers = dict(
        trajectory=lambda path: _write(path, pose_lines(*mapper.trajectory(between_too=False))),
        tracked=lambda path: _write(path, pose_lines(*mapper.trajectory())),
        online=lambda path: _write(path, pose_lines(*zip(*replay.online)) if replay.online else ""),
        map=save_map,
        stats=lambda path: _write(path, json.dumps(replay.statistics(), indent=2, sort_keys=True) + "\n"),
        save_state=save_state)
    written, errors = [], []
    for name in NAMES:
        path = getattr(options, name)
        if not path or (name == "save_state" and replay.snapshot is None):
            continue
        try:
            written += writers[name](path)
        except (OSError, state.StateError) as error:
            errors.append(error)
    return written, errors
