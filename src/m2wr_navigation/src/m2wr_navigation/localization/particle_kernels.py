# SPDX-License-Identifier: BSD-3-Clause
"""Particle sets: bins of poses, the number of particles, draws, clusters."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

BIN = 0.5                   # side of a bin [m], amcl's
TURNS = 36                  # bins of a full turn: 10 degrees each, amcl's
HALF = 1 << 24              # half the number of bins along an axis
FIBONACCI = 0x9E3779B97F4A7C15 - (1 << 64)      # 2^64 over the golden ratio: spreads keys over a table


@kernel
def _key(x: int, y: int, turn: int) -> int:
    """Return one number for a bin; neighbours in heading wrap."""
    return (((x + HALF) << 32) | ((y + HALF) << 6)) | (turn % TURNS)


@kernel
def _bin(x: float, y: float, theta: float) -> Tuple[int, int, int]:
    """Return the bin of a pose."""
    return (math.floor(x / BIN), math.floor(y / BIN),
            math.floor((theta + math.pi) * TURNS / (2.0 * math.pi)))


@kernel
def _place(table: IndexArray, key: int) -> int:
    """Return where a key is in a table (T,) of -1 and keys, T a power of two, or where it belongs."""
    mask = len(table) - 1
    at = ((key * FIBONACCI) >> 20) & mask
    while table[at] != -1 and table[at] != key:
        at = (at + 1) & mask
    return at


@kernel
def _table(count: int) -> IndexArray:
    """Return an empty table for so many keys."""
    size = 16
    while size < 2 * count:
        size *= 2
    return np.full(size, -1, np.int64)


@kernel
def kld_count(bins: int, error: float, quantile: float) -> int:
    """Return the number of particles for a number of occupied bins.

    Parameters
    ----------
    bins : int
    error : float
        ``kld_err``, bound of the Kullback-Leibler distance.
    quantile : float
        ``kld_z``, of the normal distribution.

    Notes
    -----
    D. Fox, Adapting the sample size in particle filters through KLD-sampling, IJRR 22(12), 2003, with the
    approximation of Wilson and Hilferty.
    """
    if bins < 2:
        return 1
    part = 2.0 / (9.0 * (bins - 1))
    root = 1.0 - part + math.sqrt(part) * quantile
    return math.ceil((bins - 1) / (2.0 * error) * root * root * root)


@kernel
def adaptive_count(poses: FloatArray, least: int, error: float, quantile: float) -> int:
    """Return how many of some draws are enough for the bins that they fall into.

    Parameters
    ----------
    poses : (N, 3) float64
        Draws in random order: x, y [m], theta [rad].
    least : int
        ``min_particles``.
    error : float
        ``kld_err``.
    quantile : float
        ``kld_z``.

    Returns
    -------
    int
        From ``least`` to N.
    """
    table = _table(len(poses))
    bins = 0
    for i in range(len(poses)):
        x, y, turn = _bin(poses[i, 0], poses[i, 1], poses[i, 2])
        key = _key(x, y, turn)
        at = _place(table, key)
        if table[at] == -1:
            table[at] = key
            bins += 1
        if i + 1 >= least and i + 1 >= kld_count(bins, error, quantile):
            return i + 1
    return len(poses)


@kernel
def draw_systematically(weights: FloatArray, start: float, out: IndexArray) -> None:
    """Draw particles by their weights with one random number.

    Parameters
    ----------
    weights : (N,) float64
        With sum 1.
    start : float
        Uniform number in [0, 1).
    out : (M,) int64
        Written: indices of the particles drawn, rising.
    """
    at, total = 0, weights[0]
    for k in range(len(out)):
        target = (k + start) / len(out)
        while total <= target and at + 1 < len(weights):
            at += 1
            total += weights[at]
        out[k] = at


@kernel
def _root(parents: IndexArray, node: int) -> int:
    """Return the root of a node, and shorten its way there."""
    while parents[node] != node:
        parents[node] = parents[parents[node]]
        node = parents[node]
    return node


@kernel
def label_clusters(poses: FloatArray, out: IndexArray) -> int:
    """Group particles in bins that are connected by sides, edges or corners.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y [m], theta [rad].
    out : (N,) int64
        Written: the cluster of each particle, from 0.

    Returns
    -------
    int
        Number of clusters.
    """
    count = len(poses)
    table = _table(count)
    number = np.empty(len(table), np.int64)         # of the bin at a place of the table
    bins = np.empty((count, 3), np.int64)
    found = 0
    for i in range(count):
        x, y, turn = _bin(poses[i, 0], poses[i, 1], poses[i, 2])
        key = _key(x, y, turn)
        at = _place(table, key)
        if table[at] == -1:
            table[at], number[at] = key, found
            bins[found, 0], bins[found, 1], bins[found, 2] = x, y, turn
            found += 1
        out[i] = number[at]
    parents = np.arange(found)
    for k in range(found):
        for near in range(27):
            key = _key(bins[k, 0] + near % 3 - 1, bins[k, 1] + near // 3 % 3 - 1, bins[k, 2] + near // 9 - 1)
            at = _place(table, key)
            if table[at] != -1:
                one, other = _root(parents, k), _root(parents, number[at])
                parents[max(one, other)] = min(one, other)
    labels = np.full(found, -1, np.int64)
    clusters = 0
    for k in range(found):                          # a root comes before its nodes
        root = _root(parents, k)
        if labels[root] == -1:
            labels[root] = clusters
            clusters += 1
        labels[k] = labels[root]
    for i in range(count):
        out[i] = labels[out[i]]
    return clusters


@kernel
def cluster_moments(poses: FloatArray, weights: FloatArray, labels: IndexArray, cluster: int,
                    mean: FloatArray, covariance: FloatArray) -> None:
    """Compute mean and covariance of one cluster's particles.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y [m], theta [rad].
    weights : (N,) float64
        Not negative; those of the cluster may not all be 0.
    labels : (N,) int64
        As of :func:`label_clusters`.
    cluster : int
        Whose moments are wanted.
    mean : (3,) float64
        Written: x, y, and the direction of the mean of unit vectors.
    covariance : (3, 3) float64
        Written; headings as differences to the mean, wrapped [m, m, rad].
    """
    total = x = y = cos = sin = 0.0
    for i in range(len(poses)):
        if labels[i] == cluster:
            total += weights[i]
            x += weights[i] * poses[i, 0]
            y += weights[i] * poses[i, 1]
            cos += weights[i] * math.cos(poses[i, 2])
            sin += weights[i] * math.sin(poses[i, 2])
    mean[0], mean[1], mean[2] = x / total, y / total, math.atan2(sin, cos)
    covariance[:] = 0.0
    away = np.empty(3)
    for i in range(len(poses)):
        if labels[i] == cluster:
            away[0], away[1] = poses[i, 0] - mean[0], poses[i, 1] - mean[1]
            away[2] = (poses[i, 2] - mean[2] + math.pi) % (2.0 * math.pi) - math.pi
            for j in range(3):
                for k in range(3):
                    covariance[j, k] += weights[i] / total * away[j] * away[k]
