# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of amcl: those of the original with its names and defaults, and a few of our own."""
from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping

from m2wr_navigation.parameters import Parameter, flag, text

MOST_PARTICLES = 100000     # 2.4 MB of poses; the original stops at 10000
MOST_BEAMS = 10000
ODOMETRY_MODELS = ("diff", "omni", "diff-corrected", "omni-corrected")
LASER_MODELS = ("likelihood_field", "likelihood_field_prob", "beam")
WEIGHTINGS = ("tempered", "original")


def _p(default: float, unit: str, low: float, high: float, meaning: str) -> Parameter:
    return Parameter(default, unit, low, high, meaning)


#: Parameter name -> parameter.
PARAMETERS: Dict[str, Parameter] = {
    "use_map_topic": flag(False, "take the map from the topic map, not from the service static_map", False),
    "first_map_only": flag(False, "ignore all maps after the first one of the topic", False),
    "gui_publish_rate": _p(-1.0, "Hz", -1.0, 100.0, "accepted, without effect as in the original"),
    "save_pose_rate": _p(0.5, "Hz", -1.0, 10.0, "how often the pose is stored as initial_pose_*; 0 or less: never"),
    "laser_min_range": _p(-1.0, "m", -1.0, 1000.0, "shorter ranges are ignored; -1: the scan's own limit"),
    "laser_max_range": _p(-1.0, "m", -1.0, 1000.0, "longer ranges are ignored; -1: the scan's own limit"),
    "laser_max_beams": _p(30, "beams", 2, MOST_BEAMS, "greatest number of beams of a scan that are used"),
    "min_particles": _p(100, "", 1, MOST_PARTICLES, "least number of particles"),
    "max_particles": _p(5000, "", 1, MOST_PARTICLES, "greatest number of particles"),
    "kld_err": _p(0.01, "", 1e-4, 1.0, "bound of the distance between particles and distribution"),
    "kld_z": _p(0.99, "", 0.0, 10.0, "quantile of the normal distribution itself: 2.33 is 99 %, 0.99 is 84 %"),
    "odom_alpha1": _p(0.2, "", 0.0, 10.0, "noise of a turn from the turn"),
    "odom_alpha2": _p(0.2, "", 0.0, 10.0, "noise of a turn from the way"),
    "odom_alpha3": _p(0.2, "", 0.0, 10.0, "noise of the way from the way"),
    "odom_alpha4": _p(0.2, "", 0.0, 10.0, "noise of the way from the turn"),
    "odom_alpha5": _p(0.2, "", 0.0, 10.0, "noise across the way, of omni models"),
    "odom_model_type": text("diff", "diff, omni, diff-corrected or omni-corrected", True),
    "laser_model_type": text("likelihood_field", "likelihood_field, likelihood_field_prob or beam", True),
    "laser_z_hit": _p(0.95, "", 0.0, 1.0, "share of beams that hit the map's obstacles"),
    "laser_z_short": _p(0.1, "", 0.0, 1.0, "share of beams that hit something before them; beam model"),
    "laser_z_max": _p(0.05, "", 0.0, 1.0, "share of beams without return; beam model"),
    "laser_z_rand": _p(0.05, "", 0.0, 1.0, "share of beams that end anywhere"),
    "laser_sigma_hit": _p(0.2, "m", 0.001, 10.0, "deviation of the beams that hit"),
    "laser_lambda_short": _p(0.1, "1/m", 0.0, 10.0, "how fast short ranges become rarer; beam model"),
    "laser_likelihood_max_dist": _p(2.0, "m", 0.05, 20.0, "distances to obstacles are told apart up to here"),
    "do_beamskip": flag(False, "leave out beams that few particles explain; likelihood_field_prob"),
    "beam_skip_distance": _p(0.5, "m", 0.0, 2.0, "a beam is explained if it ends this near to an obstacle"),
    "beam_skip_threshold": _p(0.3, "", 0.0, 1.0, "share of particles that must explain a beam"),
    "beam_skip_error_threshold": _p(0.9, "", 0.0, 1.0, "share of left out beams from which all are used"),
    "update_min_d": _p(0.2, "m", 0.0, 5.0, "motion after which the filter is updated"),
    "update_min_a": _p(math.pi / 6.0, "rad", 0.0, 2.0 * math.pi, "turn after which the filter is updated"),
    "resample_interval": _p(2, "updates", 1, 20, "updates between two resamplings"),
    "selective_resampling": flag(False, "resample only if half the particles have most of the weight"),
    "transform_tolerance": _p(0.1, "s", 0.0, 2.0, "how far ahead the transform is valid"),
    "recovery_alpha_slow": _p(0.001, "", 0.0, 0.5, "rate of the slow average weight; 0: no random particles"),
    "recovery_alpha_fast": _p(0.1, "", 0.0, 1.0, "rate of the fast average weight; 0: no random particles"),
    "tf_broadcast": flag(True, "publish the transform of the map to the odometry's frame"),
    "odom_frame_id": text("odom", "frame of the odometry", True),
    "base_frame_id": text("base_link", "frame of the robot", True),
    "global_frame_id": text("map", "frame of the map and of the poses", True),
    "initial_pose_x": _p(0.0, "m", -1e6, 1e6, "mean of the first pose"),
    "initial_pose_y": _p(0.0, "m", -1e6, 1e6, "mean of the first pose"),
    "initial_pose_a": _p(0.0, "rad", -1e6, 1e6, "mean of the first heading"),
    "initial_cov_xx": _p(0.25, "m^2", 0.0, 1e6, "variance of the first pose"),
    "initial_cov_yy": _p(0.25, "m^2", 0.0, 1e6, "variance of the first pose"),
    "initial_cov_aa": _p((math.pi / 12.0) ** 2, "rad^2", 0.0, 1e3, "variance of the first heading"),
    "std_warn_level_x": _p(0.2, "m", 0.0, 1e6, "deviation of the pose from which the diagnostics warn"),
    "std_warn_level_y": _p(0.2, "m", 0.0, 1e6, "deviation of the pose from which the diagnostics warn"),
    "std_warn_level_yaw": _p(0.1, "rad", 0.0, 10.0, "deviation of the heading from which the diagnostics warn"),
    "force_update_after_initialpose": flag(False, "update with the next scan after an initial pose"),
    "force_update_after_set_map": flag(False, "update with the next scan after a map of set_map"),
    # of our own
    "scan_matching": flag(True, "fit each scan to the map around the filter's pose: better than a cell, no jumps"),
    "odom_learning": flag(True, "learn and correct odometry's errors of scale and of the straight line"),
    "laser_weighting": text("tempered", "tempered: product over beams, as of few independent ones; original: "
                                        "1 + the sum of cubes, as amcl's likelihood_field and beam", True),
    "seed": Parameter(0, "", 0, 2.0**31 - 1, "seed of all random numbers", False),
}

#: Names of the original's launch files that have no effect here, with the reason.
IGNORED: Dict[str, str] = {}
CHOICES = {"odom_model_type": ODOMETRY_MODELS, "laser_model_type": LASER_MODELS, "laser_weighting": WEIGHTINGS}


def checked(values: Mapping[str, Any]) -> List[str]:
    """Repair values that do not go together, and say so.

    Parameters
    ----------
    values : dict of str to object
        Every parameter; changed in place.

    Returns
    -------
    list of str
        One sentence for each value that was replaced.
    """
    values, warnings = values if isinstance(values, dict) else dict(values), []
    for name, choices in CHOICES.items():
        if values[name] not in choices:
            warnings.append("parameter ~{} is {!r}; expected {}; {!r} is used".format(
                name, values[name], " or ".join(choices), PARAMETERS[name].default))
            values[name] = PARAMETERS[name].default
    if values["min_particles"] > values["max_particles"]:
        warnings.append("parameters ~min_particles {} and ~max_particles {}: expected the first not above the second; "
                        "{} is used for both".format(values["min_particles"], values["max_particles"],
                                                     values["min_particles"]))
        values["max_particles"] = values["min_particles"]
    frames = {name: values[name].lstrip("/") for name in ("odom_frame_id", "base_frame_id", "global_frame_id")}
    for name, frame in frames.items():
        if not frame:
            warnings.append("parameter ~{} is empty; expected the name of a frame; {!r} is used".format(
                name, PARAMETERS[name].default))
            frames[name] = PARAMETERS[name].default
    values.update(frames)
    return warnings
