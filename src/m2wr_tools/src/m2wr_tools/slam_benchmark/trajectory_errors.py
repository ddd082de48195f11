# SPDX-License-Identifier: BSD-3-Clause
"""Errors of a trajectory: relative poses against relations, or against ground truth poses of the scans.

After Kuemmerle, Steder, Dornhege, Ruhnke, Grisetti, Stachniss, Kleiner: On measuring the accuracy of SLAM algorithms,
Autonomous Robots 27, 2009: the pose of one scan seen from another does not depend on the frame of the map.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple

import numpy as np

from m2wr_maps.se2 import between, compose, wrap
from m2wr_tools.slam_benchmark.laser_logs import EPOCH, LogError, odometry, opened

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray
    from m2wr_tools.slam_benchmark.laser_logs import Log

DIRECT = 1e-3           # greatest difference of stamps between pose and scan [s]
AGAIN = 20.0            # least time between two visits of a loop closure [s]
NEAR = 1.5              # and their greatest distance [m]
MOST_PAIRS, MOST_POSES = 4000, 3000
SOON = 10.0             # greatest time between the poses of a relation that measures the live pose locally [s]


def rows(path: str, columns: int) -> FloatArray:
    """Return the numbers of a text file; shorter lines are skipped, # starts a comment.

    Parameters
    ----------
    path : str
        File.
    columns : int
        Numbers per line.

    Returns
    -------
    (K, columns) float64

    Raises
    ------
    LogError
        If the file cannot be read or has no such line.
    """
    found = []
    try:
        with opened(path) as stream:
            for line in stream:
                words = line.split("#", 1)[0].split()
                if len(words) >= columns:
                    found.append([float(word) for word in words[:columns]])
    except (OSError, EOFError, ValueError) as error:
        raise LogError("{}: {}".format(path, error)) from error
    if not found:
        raise LogError("{}: no line with {} numbers".format(path, columns))
    return np.array(found)


def trajectory(path: str) -> Tuple[FloatArray, FloatArray]:
    """Return stamps (K,) and poses (K, 3) of a file with the lines stamp x y z qx qy qz qw."""
    table = rows(path, 8)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return table[:, 0], np.column_stack([table[:, 1:3], 2.0 * np.arctan2(table[:, 6], table[:, 7])])


def nearest(stamps: FloatArray, wanted: FloatArray) -> IndexArray:
    """Return the index of the stamp nearest to each requested one.

    Parameters
    ----------
    stamps : (K,) float64
        Sorted stamps [s].
    wanted : (N,) float64
        Requested stamps [s].
    """
    after = np.clip(np.searchsorted(stamps, wanted), 1, max(1, len(stamps) - 1))
    if len(stamps) == 1:
        return np.zeros(np.shape(wanted), int)
    return np.where(wanted - stamps[after - 1] <= stamps[after] - wanted, after - 1, after)


def poses_at(wanted: FloatArray, stamps: FloatArray, poses: FloatArray,
             raw: Optional[Tuple[FloatArray, FloatArray]] = None, live: bool = False) -> FloatArray:
    """Return the poses at requested stamps; between poses of the trajectory raw odometry is used.

    Parameters
    ----------
    wanted : (N,) float64
        Requested stamps [s].
    stamps : (K,) float64
        Stamps of the trajectory [s].
    poses : (K, 3) float64
        Poses of the trajectory [m, m, rad].
    raw : tuple or None
        Stamps and poses of raw odometry.
    live : bool
        Whether odometry continues from the pose before, as for a robot that cannot know the next one.
    """
    at = nearest(stamps, wanted)
    if live:
        at = np.clip(np.searchsorted(stamps, wanted + DIRECT) - 1, 0, len(stamps) - 1)
    found = poses[at].copy()
    far = np.abs(stamps[at] - wanted) > DIRECT
    if raw is not None and far.any():
        begin, end = raw[1][nearest(raw[0], stamps[at[far]])], raw[1][nearest(raw[0], wanted[far])]
        found[far] = compose(poses[at[far]], between(begin, end))
    return found


def _summary(measured: FloatArray, right: FloatArray, again: BoolArray) -> Dict[str, Any]:
    """Return mean errors of relative poses (N, 3), of all and of loop closures (``again``)."""
    metres = np.hypot(measured[:, 0] - right[:, 0], measured[:, 1] - right[:, 1])
    degrees = np.degrees(np.abs(wrap(measured[:, 2] - right[:, 2])))
    result = dict(pairs=len(metres), metres=float(metres.mean()), degrees=float(degrees.mean()))
    if again.any():
        result.update(again_metres=float(metres[again].mean()), again_degrees=float(degrees[again].mean()),
                      again_worst_metres=float(metres[again].max()))
    return result


def against_relations(stamps: FloatArray, poses: FloatArray, relations: FloatArray,
                      raw: Optional[Tuple[FloatArray, FloatArray]] = None) -> Dict[str, Any]:
    """Return the mean errors (dict) against relations.

    Parameters
    ----------
    stamps : (K,) float64
        Stamps of the trajectory [s].
    poses : (K, 3) float64
        Poses of the trajectory [m, m, rad].
    relations : (R, 8) float64
        stamp, stamp, x, y, z, roll, pitch, yaw.
    raw : tuple or None
        Stamps and poses of raw odometry.
    """
    first, second = (poses_at(relations[:, column], stamps, poses, raw) for column in (0, 1))
    return _summary(between(first, second), relations[:, [2, 3, 7]],
                    np.abs(relations[:, 1] - relations[:, 0]) > AGAIN)


def _common(stamps: FloatArray, poses: FloatArray, truth: FloatArray) -> Tuple[FloatArray, FloatArray, FloatArray]:
    """Return stamps, poses and true poses of those poses of a trajectory that have a ground truth."""
    truth = truth[np.argsort(truth[:, 0], kind="stable")]
    at = nearest(truth[:, 0], stamps)
    fits = np.abs(truth[at, 0] - stamps) <= DIRECT
    if fits.sum() < 2:
        raise LogError("no pose of the truth is at a scan of the trajectory")
    return stamps[fits], poses[fits], truth[at[fits], 1:4]


def against_poses(stamps: FloatArray, poses: FloatArray, truth: FloatArray) -> Dict[str, Any]:
    """Return the mean errors (dict) against ground truth poses: of successive poses, and of loop closures.

    Parameters
    ----------
    stamps : (K,) float64
        Stamps of the trajectory [s].
    poses : (K, 3) float64
        Poses of the trajectory [m, m, rad].
    truth : (K, 4) float64
        stamp, x, y, theta.

    Raises
    ------
    LogError
        If fewer than two poses of the trajectory have a ground truth.
    """
    stamps, poses, true = _common(stamps, poses, truth)
    some = np.arange(0, len(stamps), -(-len(stamps) // MOST_POSES))
    apart = np.hypot(true[some, None, 0] - true[None, some, 0], true[some, None, 1] - true[None, some, 1])
    pairs = some[np.argwhere(np.triu(
        (apart < NEAR) & (np.abs(stamps[some, None] - stamps[None, some]) > AGAIN), 1)).reshape(-1, 2)]
    pairs = pairs[::max(1, -(-len(pairs) // MOST_PAIRS))]
    result = _summary(between(poses[:-1], poses[1:]), between(true[:-1], true[1:]), np.zeros(len(poses) - 1, bool))
    if len(pairs):
        first, second = pairs.T
        again = _summary(between(poses[first], poses[second]), between(true[first], true[second]),
                         np.ones(len(pairs), bool))
        result.update((name, value) for name, value in again.items() if name.startswith("again"))
    return result


def live_errors(stamps: FloatArray, poses: FloatArray, truth: FloatArray, kind: str,
                raw: Optional[Tuple[FloatArray, FloatArray]] = None) -> Dict[str, Any]:
    """Return the mean errors (dict) of poses as they were known at their time: within 10 s, and of loop closures.

    Parameters
    ----------
    stamps : (K,) float64
        Stamps of the poses [s].
    poses : (K, 3) float64
        [m, m, rad]
    truth : (R, 8) or (K, 4) float64
        Relations, or ground truth poses.
    kind : str
        ``relations``, ``graph`` or ``ref``.
    raw : tuple or None
        Stamps and poses of raw odometry.
    """
    if kind == "relations":
        first, second = (poses_at(truth[:, column], stamps, poses, raw, live=True) for column in (0, 1))
        measured, right = between(first, second), truth[:, [2, 3, 7]]
        apart = np.abs(truth[:, 1] - truth[:, 0])
        soon, again = apart <= SOON, apart > AGAIN
        found = _summary(measured, right, again)
        near = _summary(measured[soon], right[soon], again[soon]) if soon.any() else {}
    else:
        found = against_poses(stamps, poses, truth)
        stamps, poses, true = _common(stamps, poses, truth)
        last = np.searchsorted(stamps, stamps + SOON, side="right") - 1
        pairs = last > np.arange(len(last))
        near = _summary(between(poses, poses[last])[pairs], between(true, true[last])[pairs],
                        np.zeros(int(pairs.sum()), bool)) if pairs.any() else {}
    result = {"live_" + name: value for name, value in found.items() if name.startswith("again")}
    result.update(("live_" + name, near[name]) for name in ("metres", "degrees") if name in near)
    return result


def odometry_errors(raw: Tuple[FloatArray, FloatArray], truth: FloatArray, kind: str) -> Dict[str, Any]:
    """Return how wrong odometry alone is (dict): at loop closures, and at most, as a share of the length.

    Parameters
    ----------
    raw : tuple
        Stamps (K,) and poses (K, 3) of odometry.
    truth : (R, 8) or (K, 4) float64
        Relations, or ground truth poses.
    kind : str
        ``relations``, ``graph`` or ``ref``.
    """
    if kind == "relations":
        found = against_relations(*raw, truth)
        return {"odometry_" + name: value for name, value in found.items() if name.startswith("again")}
    at = truth[np.argsort(truth[:, 0], kind="stable")]
    poses = poses_at(at[:, 0], *raw)
    found = against_poses(at[:, 0], poses, at)
    result = {"odometry_" + name: value for name, value in found.items() if name.startswith("again")}
    length = float(np.hypot(*np.diff(at[:, 1:3], axis=0).T).sum())
    if length > 0.0:
        off = between(poses[0], poses) - between(at[0, 1:], at[:, 1:])
        result["odometry_drift"] = float(np.hypot(off[:, 0], off[:, 1]).max()) / length
    return result


def score(log: Log, path: str, online: Optional[str] = None,
          recorded: Optional[Tuple[FloatArray, FloatArray]] = None,
          base: Optional[FloatArray] = None) -> Optional[Dict[str, Any]]:
    """Return the errors (dict) of a trajectory file against the best ground truth of a log, with its ``kind``; or None.

    Parameters
    ----------
    log : Log
        The log.
    path : str
        File with the final poses.
    online : str, optional
        File with the poses as they were known at their time; with it the result has ``live_`` errors.
    recorded : tuple, optional
        Stamps and poses of the odometry in a bag; with it, or for a CARMEN log, the result has ``odometry_`` errors.
    base : (3,) float64, optional
        True pose of the base in that of the files; see ``LogDetails.base_correction``.
    """
    kinds = [kind for kind in ("relations", "graph", "ref") if kind in log.truth]
    if not kinds:
        return None
    kind, shift, raw = kinds[0], 0.0, None
    if not log.is_bag:
        shift, raw = EPOCH, odometry(log.path)
        recorded = raw
    truth = rows(log.truth[kind], 8 if kind == "relations" else 4)
    right = np.zeros(3) if base is None else base
    stamps, poses = trajectory(path)
    poses = compose(poses, right)
    if kind == "relations":
        found = against_relations(stamps - shift, poses, truth, raw)
    else:
        found = against_poses(stamps - shift, poses, truth)
    if online is not None:
        stamps, poses = trajectory(online)
        found.update(live_errors(stamps - shift, compose(poses, right), truth, kind, raw))
    if recorded is not None:
        found.update(odometry_errors(recorded, truth, kind))
    return dict(found, kind=kind)
