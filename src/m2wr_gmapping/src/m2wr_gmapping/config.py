# SPDX-License-Identifier: BSD-3-Clause
"""Parameters: names, defaults, units and ranges, with conversion of the values that a user gives."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Mapping, Optional, Tuple

import numpy as np

from m2wr_node.numbers import number

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

INFINITY = math.inf


class ConfigError(ValueError):
    """A parameter has a value that cannot be used; the message names its range."""


@dataclass(frozen=True)
class Parameter:
    """One private parameter: default, unit, allowed range (both ends included) and meaning."""

    default: object
    unit: str
    low: float
    high: float
    meaning: str


def _p(default: object, unit: str, low: float, high: float, meaning: str) -> Parameter:
    return Parameter(default, unit, low, high, meaning)


MOST_NOISE = 1e9            # squares and products of it are finite
MOST_CELLS = 1e9            # of the initial map; one byte each in every published map

# public name -> parameter. A default of None is replaced by another value, which the meaning names.
PARAMETERS = {
    "throttle_scans": _p(1, "", 0, 10**9, "process one of this many scans; 0 counts as 1"),
    "base_frame": _p("base_link", "", 0, 0, "robot frame in which the laser is mounted"),
    "map_frame": _p("map", "", 0, 0, "frame of map and poses"),
    "odom_frame": _p("odom", "", 0, 0, "frame of the odometry"),
    "map_update_interval": _p(5.0, "s", 0.0, INFINITY, "least time between two maps, by scan stamps"),
    "transform_publish_period": _p(0.05, "s", 0.0, INFINITY, "period of map -> odom; 0: never"),
    "tf_delay": _p(None, "s", 0.0, INFINITY, "added to the stamp of map -> odom; default transform_publish_period"),
    "occ_thresh": _p(0.25, "", 0.0, 1.0, "a cell is occupied if hits / visits is greater"),
    "maxRange": _p(None, "m", 0.0, INFINITY, "longer beams are ignored; default range_max of the first scan - 0.01"),
    "maxUrange": _p(None, "m", 0.0, INFINITY, "longer beams only clear space up to this range; default maxRange"),
    "sigma": _p(0.05, "m^2", 1e-9, INFINITY, "denominator of the score's exponent"),
    "kernelSize": _p(1, "cells", 0, 10, "half width of the neighbourhood searched; only with compatible"),
    "lstep": _p(0.05, "m", 1e-9, INFINITY, "first step of the hill climb; only with compatible"),
    "astep": _p(0.05, "rad", 1e-9, INFINITY, "first step of the hill climb; only with compatible"),
    "iterations": _p(5, "", 0, 1000, "halvings of the steps; only with compatible"),
    "lsigma": _p(0.075, "m^2", 1e-9, INFINITY, "denominator of a beam's log-likelihood"),
    "ogain": _p(3.0, "", 1e-9, INFINITY, "smoothing of the weights"),
    "lskip": _p(0, "beams", 0, 10**6, "beams skipped between two matched ones"),
    "minimumScore": _p(0.0, "beams", -INFINITY, INFINITY, "a match is accepted if its score is greater"),
    "llsamplerange": _p(0.01, "m", -INFINITY, INFINITY, "accepted, without effect as in the original"),
    "llsamplestep": _p(0.01, "m", -INFINITY, INFINITY, "accepted, without effect as in the original"),
    "lasamplerange": _p(0.005, "rad", -INFINITY, INFINITY, "accepted, without effect as in the original"),
    "lasamplestep": _p(0.005, "rad", -INFINITY, INFINITY, "accepted, without effect as in the original"),
    "srr": _p(0.1, "m/m", 0.0, MOST_NOISE, "translation noise from translation"),
    "srt": _p(0.2, "rad/m", 0.0, MOST_NOISE, "heading noise from translation"),
    "str": _p(0.1, "m/rad", 0.0, MOST_NOISE, "translation noise from turning"),
    "stt": _p(0.2, "rad/rad", 0.0, MOST_NOISE, "heading noise from turning"),
    "linearUpdate": _p(1.0, "m", 0.0, INFINITY, "distance after which a scan is processed"),
    "angularUpdate": _p(0.5, "rad", 0.0, INFINITY, "rotation after which a scan is processed"),
    "temporalUpdate": _p(-1.0, "s", -INFINITY, INFINITY, "time after which a scan is processed; < 0: never"),
    "resampleThreshold": _p(0.5, "", 0.0, 1.0, "resample when Neff is below this share of the particles"),
    "particles": _p(30, "", 1, 10000, "number of particles"),
    "min_particles": _p(None, "", 1, 10000, "least number of particles, while they agree; default particles"),
    "xmin": _p(-100.0, "m", -1e6, 1e6, "initial extent of the map"),
    "ymin": _p(-100.0, "m", -1e6, 1e6, "initial extent of the map"),
    "xmax": _p(100.0, "m", -1e6, 1e6, "initial extent of the map"),
    "ymax": _p(100.0, "m", -1e6, 1e6, "initial extent of the map"),
    "delta": _p(0.05, "m", 0.001, 10.0, "cell size"),
    "compatible": _p(False, "", 0, 1, "the original algorithm: hill climb, no tracking, no loop closing"),
    "track_between": _p(True, "", 0, 1, "also match the scans between processed ones"),
    "loop_closing": _p(True, "", 0, 1, "search for loop closures and optimise the trajectory"),
    "seed": _p(0, "", 0, 2**63 - 1, "seed of all random numbers"),
    "threads": _p(1, "", 0, 256, "threads that share the particles; 0: one per core"),
}
WHOLE = {"min_particles"}   # integers whose default is another parameter
# unknown parameters that cause no warning
TOLERATED = {"inverted_laser"}


def _converted(name: str, value: object) -> Any:
    """Return the value in the parameter's type, converted as by roscpp; None if it cannot be converted."""
    default = PARAMETERS[name].default
    if isinstance(default, str):
        return value if isinstance(value, str) else None
    if isinstance(default, bool):
        return bool(value) if isinstance(value, (bool, int)) else None
    amount = number(value)
    if amount is None or math.isnan(amount):
        return None
    if isinstance(default, int) or name in WHOLE:
        if math.isinf(amount):
            return None
        return int(math.floor(amount + 0.5)) if amount >= 0 else -int(math.floor(0.5 - amount))
    return float(amount)


@dataclass(frozen=True)
class GmappingConfig:
    """All parameters, checked. See ``PARAMETERS`` for units and meanings."""

    values: Mapping[str, Any]
    unknown: Tuple[str, ...] = ()
    unusable: Tuple[str, ...] = ()

    @classmethod
    def from_mapping(cls, given: Optional[Mapping[str, object]] = None) -> GmappingConfig:
        """Read parameters by their public names.

        Parameters
        ----------
        given : mapping of str to object, optional
            Integers are converted to floats, and floats are rounded to integers. A value of another type is listed in
            ``unusable`` and the default is used; an unknown name is listed in ``unknown``.

        Raises
        ------
        ConfigError
            If a value is outside its range.
        """
        values: Dict[str, Any] = {name: parameter.default for name, parameter in PARAMETERS.items()}
        unknown, unusable = [], []
        for name, value in (given or {}).items():
            if name not in PARAMETERS:
                if name not in TOLERATED:
                    unknown.append(name)
                continue
            converted = _converted(name, value)
            if converted is None:
                unusable.append("{}: {!r}".format(name, value))
                continue
            parameter = PARAMETERS[name]
            if not isinstance(converted, str) and not parameter.low <= converted <= parameter.high:
                raise ConfigError("parameter {} is {}; expected {} to {}{}".format(
                    name, value, parameter.low, parameter.high, " " + parameter.unit if parameter.unit else ""))
            values[name] = converted
        for low, high in (("xmin", "xmax"), ("ymin", "ymax")):
            if not values[low] < values[high]:
                raise ConfigError("parameters {} {} and {} {}: expected the first below the second".format(
                    low, values[low], high, values[high]))
        columns, rows = ((values[high] - values[low]) / values["delta"] for low, high in (
            ("xmin", "xmax"), ("ymin", "ymax")))
        if columns * rows > MOST_CELLS:
            raise ConfigError("xmin to xmax and ymin to ymax are {:.0f} x {:.0f} cells of delta {} m; expected at most "
                              "{:g} in all. The map grows as needed".format(
                                  columns, rows, values["delta"], MOST_CELLS))
        if values["min_particles"] is None:
            values["min_particles"] = values["particles"]
        if values["min_particles"] > values["particles"]:
            raise ConfigError("parameters min_particles {} and particles {}: expected the first not above the "
                              "second".format(values["min_particles"], values["particles"]))
        values["throttle_scans"] = max(1, values["throttle_scans"])
        if values["tf_delay"] is None:
            values["tf_delay"] = values["transform_publish_period"]
        return cls(values, tuple(unknown), tuple(unusable))

    def __getitem__(self, name: str) -> Any:
        """Return a value by its public name."""
        return self.values[name]

    def score_warning(self, ranges: int) -> Optional[str]:
        """Return a warning if no scan with so many ranges can reach ``minimumScore``, else None."""
        beams = ranges // (self["lskip"] + 1)
        if self["minimumScore"] < beams:
            return None
        return "minimumScore {:g} can never be reached: a score is at most the beams matched, {} here; {}".format(
            self["minimumScore"], beams, "no scan will be matched" if self["compatible"]
            else "half the beams of a scan are used instead")

    @property
    def noise(self) -> FloatArray:
        """Noise of odometry (2, 2), of translation and of heading, each by distance and by rotation."""
        return np.array([[self["srr"], self["str"]], [self["srt"], self["stt"]]], float)
