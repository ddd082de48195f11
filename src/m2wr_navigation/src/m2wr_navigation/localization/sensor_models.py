# SPDX-License-Identifier: BSD-3-Clause
"""The sensor models of amcl: log-weights of poses from a scan."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, NamedTuple, Optional

import numpy as np

from m2wr_navigation.localization import sensor_kernels as kernels

if TYPE_CHECKING:
    from m2wr_navigation.localization.beams import Beams
    from m2wr_navigation.localization.localization_map import LocalizationMap
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

INDEPENDENT = 15.0          # beams of a scan whose errors are independent: neighbours see the same errors of the map
INDEPENDENT_APART = 4.0     # likewise, while the robot may be in several places: consecutive scans share errors too
MATCH_BEAMS = 180           # beams that a scan match uses
MATCH_NEAR = 0.3            # end points farther from the map's obstacles have no weight in a match [m]
MATCH_SPREAD = 0.05         # deviation of an end point in a match: about a cell [m]
MATCH_ROUNDS = 10
LEAST_LIKELIHOOD = 1e-9     # of a beam, so that its logarithm is finite
LEAST_SHARE = 0.3           # of the beams that must end near obstacles, for a match to be used


@dataclass(frozen=True)
class Fit:
    """How a scan fits from some poses.

    Attributes
    ----------
    log_weights : (N,) float64
        Logarithms of the weights' factors.
    goodness : (N,) float64
        Mean over the beams, on a scale that does not depend on their number: what the recovery averages.
    """

    log_weights: FloatArray
    goodness: FloatArray


class Match(NamedTuple):
    """A scan fitted to the map.

    Attributes
    ----------
    pose : (3,) float64
        x, y [m], theta [rad].
    share : float
        Of the beams with a return that end near obstacles of the map; NaN: there are none.
    covariance : (3, 3) float64
        Of the pose, by the given one and the scan together [m, m, rad].
    """

    pose: FloatArray
    share: float
    covariance: FloatArray


def weigh(poses: FloatArray, beams: Beams, grid: LocalizationMap, values: Mapping[str, Any],
          converged: bool, independent: float = INDEPENDENT) -> Optional[Fit]:
    """Return the weights of poses by the chosen sensor model.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y [m], theta [rad] of the base in the map's frame.
    beams : Beams
    grid : LocalizationMap
    values : mapping of str to object
        Parameters of ``amcl_parameters``.
    converged : bool
        Whether the particles agree, so that beams may be skipped.
    independent : float
        Number of beams whose errors are independent.

    Returns
    -------
    Fit or None
        None if no beam can be used.
    """
    model = values["laser_model_type"]
    used = beams.spread(values["laser_max_beams"], model != "beam")
    if not len(used):
        return None
    placed, sums = grid.to_grid(poses), np.empty((len(poses), 2))
    if model == "beam":
        blocked, free = grid.clear_distance()
        parameters = np.array([values["laser_" + name] for name in (
            "z_hit", "z_short", "z_max", "z_rand", "sigma_hit", "lambda_short")] + [beams.reach])
        kernels.beam_sums(placed, beams.mount, np.ascontiguousarray(beams.polar[:, used]), blocked, free,
                          grid.resolution, parameters, sums)
    else:
        rays = _rays(beams, used, grid.resolution)
        reach = values["laser_likelihood_max_dist"]
        fields = grid.fields(reach)
        if model == "likelihood_field_prob" and values["do_beamskip"] and converged:
            rays = _explained(placed, rays, fields, values)
        kernels.field_sums(placed, rays, fields, likelihoods(values, beams.reach), sums)
        used = used[:rays.shape[1]]
    goodness = (1.0 + sums[:, 0]) / (1.0 + len(used))
    if model == "likelihood_field_prob":
        return Fit(sums[:, 1], goodness)
    if values["laser_weighting"] == "original":
        return Fit(np.log1p(sums[:, 0]), goodness)
    return Fit(sums[:, 1] * min(1.0, independent / len(used)), goodness)


def likelihoods(values: Mapping[str, Any], reach: float) -> Float32Array:
    """Return p^3 and ln p (256, 2) of beams that end at distances of 0 to 255 steps from obstacles.

    p = z_hit exp(-d^2 / (2 sigma_hit^2)) + z_rand / reach, amcl's likelihood field.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of ``amcl_parameters``.
    reach : float
        Greatest range of the laser [m].
    """
    distance = np.linspace(0.0, values["laser_likelihood_max_dist"], 256)
    p = values["laser_z_hit"] * np.exp(-0.5 * np.square(distance / values["laser_sigma_hit"]))
    p = np.maximum(p + values["laser_z_rand"] / reach, LEAST_LIKELIHOOD)
    return np.stack([p ** 3, np.log(p)], -1).astype(np.float32)


def _rays(beams: Beams, used: IndexArray, cell: float) -> Float32Array:
    """Return end points [cells] and directions (4, B) of some beams in the base frame."""
    ends = beams.ends[:, used]
    return np.concatenate([ends / cell, ends - beams.mount[:, None]]).astype(np.float32)


def _explained(placed: FloatArray, rays: Float32Array, fields: Uint8Array, values: Mapping[str, Any]) -> Float32Array:
    """Return the rays (4, B) that enough particles explain; all of them if too many would be left out."""
    shares = np.empty(rays.shape[1])
    kernels.near_share(placed, rays, fields,
                       255.0 * values["beam_skip_distance"] / values["laser_likelihood_max_dist"], shares)
    kept = shares > values["beam_skip_threshold"]
    if np.mean(~kept) >= values["beam_skip_error_threshold"] or not kept.any():
        return rays
    return np.ascontiguousarray(rays[:, kept])


def match(pose: FloatArray, covariance: FloatArray, beams: Beams, grid: LocalizationMap,
          values: Mapping[str, Any], rounds: int = MATCH_ROUNDS) -> Match:
    """Fit a scan to the map, near a pose.

    Parameters
    ----------
    pose : (3,) float64
        x, y [m], theta [rad] of the base in the map's frame.
    covariance : (3, 3) float64
        Of the pose [m, m, rad]. Where the scan says nothing, as along a corridor, the pose is kept.
    beams : Beams
    grid : LocalizationMap
    values : mapping of str to object
    rounds : int
        Steps of the fit; 0: only look how the pose fits.

    Returns
    -------
    Match
    """
    used: IndexArray = beams.spread(MATCH_BEAMS)
    if not len(used):
        return Match(pose, float("nan"), covariance)
    cell, turn = grid.resolution, grid.origin[2]
    to_cells = np.diag([1.0 / cell, 1.0 / cell, 1.0])
    cos, sin = np.cos(turn), np.sin(turn)
    into = to_cells @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    prior = np.linalg.inv(into @ covariance @ into.T)
    out, information = np.empty(3), np.empty(6)
    limit = values["laser_likelihood_max_dist"]
    spread = MATCH_SPREAD * max(1.0, len(used) / INDEPENDENT) ** 0.5
    share = kernels.refine_pose(
        grid.to_grid(pose[None])[0], _rays(beams, used, cell), grid.fields(limit), limit / 255.0 / cell,
        np.array([spread, min(MATCH_NEAR, limit)]) / cell, prior, rounds, out, information)
    found: FloatArray = np.linalg.inv(information[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])])
    back = np.linalg.inv(into)
    return Match(grid.from_grid(out[None])[0], share, back @ found @ back.T)
