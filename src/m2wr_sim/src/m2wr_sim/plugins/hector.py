# SPDX-License-Identifier: BSD-3-Clause
"""What the plugins of hector_gazebo_plugins share: their schedule and their tags for errors."""
from __future__ import annotations

from typing import Any, List, Optional, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import GapSchedule
from m2wr_sim.sensors.drift import DriftModel

GREATEST = 1e6          # of an error parameter
DRIFT_FREQUENCY = 1.0 / 3600.0      # Hz


def numbers(spec: PluginReader, tag: str, size: int, default: float) -> List[float]:
    """Return the numbers of a tag, which may hold a single one for all.

    Parameters
    ----------
    spec : PluginReader
    tag : str
    size : int
        How many numbers.
    default : float
        Of all of them, without the tag.

    Raises
    ------
    PluginError
        If it holds something else.
    """
    words = spec.text(tag, "%g" % default).split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    values = values * size if len(values) == 1 else values
    if len(values) != size or not all(abs(value) <= GREATEST for value in values):
        raise PluginError("%s: <%s> holds \"%s\"; expected one or %d numbers, at most %g either way"
                          % (spec.spec.where, tag, " ".join(words), size, GREATEST))
    return values


def drift_model(spec: PluginReader, ctx: PluginContext, prefix: str, size: int) -> DriftModel:
    """Return the errors that the tags with a prefix describe.

    Parameters
    ----------
    spec : PluginReader
    ctx : PluginContext
    prefix : str
        Such as ``accel``; empty: the tags have none, and begin with a small letter.
    size : int
        How many numbers each tag holds.

    Raises
    ------
    PluginError
        If a tag holds something else.
    """
    def read(name: str, default: float) -> List[float]:
        return numbers(spec, prefix + name if prefix else name[0].lower() + name[1:], size, default)

    offset, drift, noise = read("Offset", 0.0), read("Drift", 0.0), read("GaussianNoise", 0.0)
    frequency, scale = read("DriftFrequency", DRIFT_FREQUENCY), read("ScaleError", 1.0)
    if min(frequency + noise + drift) < 0.0:
        raise PluginError("%s: an error of \"%s\" is negative; expected standard deviations and frequencies of at "
                          "least 0" % (spec.spec.where, prefix or "offset, drift"))
    return DriftModel(size, offset, drift, frequency, noise, scale, ctx.rng(prefix or "errors"))


class HectorSensor(Plugin):
    """Measures at ``updateRate`` or ``updatePeriod``, at the beginning of a step, also without subscribers."""

    _rate = 0.0             # Hz, default

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        self._namespace = spec.spec.find("robotNamespace") or ""
        period = spec.number("updatePeriod", 0.0, minimum=0.0)
        rate = spec.number("updateRate", 1.0 / period if period > 0.0 else self._rate, minimum=0.0)
        self._schedule = GapSchedule(rate, ctx.now_ns + int(spec.number("updateOffset", 0.0, minimum=0.0) * 1e9))
        self._errors: List[Any] = []        # (prefix, DriftModel)
        self._set_up(spec)

    def _set_up(self, spec: PluginReader) -> None:
        """Read tags and open topics."""
        raise NotImplementedError

    def _error(self, spec: PluginReader, prefix: str, size: int) -> DriftModel:
        model = drift_model(spec, self._ctx, prefix, size)
        self._errors.append((prefix, model))
        return model

    def _body(self, spec: PluginReader) -> Tuple[int, str]:
        """Return number and name of the link of ``<bodyName>``, by default the model's first."""
        name = spec.spec.find("bodyName") or self._ctx.first_link()
        spec.ignore("bodyName")
        return self._ctx.link(name), name

    def _advertise(self, topic: str, kind: type) -> Any:
        return self._ctx.advertise(topic, kind, 10, self._namespace)

    def next_before(self, now_ns: int) -> Optional[int]:
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def before_step(self, now_ns: int) -> None:
        elapsed = self._schedule.elapsed(now_ns) * 1e-9
        if self._schedule.due(now_ns):
            self._measure(now_ns, elapsed)

    def _measure(self, now_ns: int, elapsed: float) -> None:
        """Measure; ``elapsed`` [s] have passed since the last time."""
        raise NotImplementedError

    def _restart(self) -> None:
        """Discard what was kept of the last measurement."""

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        for prefix, model in self._errors if rewound else ():
            model.restart(self._ctx.rng(prefix or "errors"))
        self._restart()
