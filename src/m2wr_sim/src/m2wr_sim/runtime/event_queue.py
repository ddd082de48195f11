# SPDX-License-Identifier: BSD-3-Clause
"""Event queue: stores at which simulated time each plugin wants to act or measure, and calls it then."""
from __future__ import annotations

from typing import Any, Callable, List, Optional, Sequence, Tuple

from m2wr_sim.plugins.base import Plugin

#: A plugin, its context, and its name for messages.
Entry = Tuple[Any, Any, str]

_NEVER_NS = 1 << 62


def _overrides(plugin: Plugin, name: str) -> bool:
    """Return whether a plugin overrides a method of the base class, which does nothing."""
    return getattr(getattr(plugin, name), "__func__", None) is not getattr(Plugin, name)


class EventQueue:
    """Calls plugins, in their order, before and after steps.

    Parameters
    ----------
    failed : callable
        ``failed(entry)`` is called while an exception of the plugin ``entry[0]`` is handled.
    catch_up : callable
        Makes the engine catch up with the simulated time, before a plugin reads its state.

    Attributes
    ----------
    calm_ns : int
        No plugin wants to act before the steps that end up to this time [ns].
    sample_ns : int
        No plugin wants to measure before this time [ns].
    valid_ns : int
        In lazy stepping the last answers of the plugins are used up to this time [ns]; 0: all are queried next.
    stale : bool
        Whether :meth:`fill` must be called first, because plugins were added or removed.
    """

    def __init__(self, failed: Callable[[Entry], None], catch_up: Callable[[], None]) -> None:
        self._failed, self._catch_up = failed, catch_up
        self._before: List[List[Any]] = []
        self._after: List[List[Any]] = []
        self._acting: List[Tuple[Entry, Callable[[int], None]]] = []
        self.calm_ns, self.sample_ns, self.valid_ns, self.stale = 0, 0, 0, True

    def fill(self, entries: Sequence[Entry]) -> None:
        """Replace the plugins; :meth:`act` must be called with ``query_all`` afterwards."""
        before, after, acting = ([entry for entry in entries if _overrides(entry[0], name)]
                                 for name in ("next_before", "next_after", "after_step"))
        # time of the next call as last returned by the plugin, the plugin, its method
        self._before, self._after = ([[_NEVER_NS, entry, getattr(entry[0], name)] for entry in group]
                                     for name, group in (("next_before", before), ("next_after", after)))
        self._acting, self.stale = [(entry, entry[0].after_step) for entry in acting], False

    def act(self, now_ns: int, step_ns: int, query_all: bool) -> None:
        """Call the plugins that act before the next step, and compute how far the engine may run.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        step_ns : int
            Step size [ns].
        query_all : bool
            Whether to ask all plugins for their next time; if not, their last answers are used.
        """
        first_ns, calm_ns, sample_ns = now_ns + step_ns, _NEVER_NS, _NEVER_NS
        for row in self._before:
            if query_all:
                try:                    # as _next_time, but inline, because this is the most frequent case
                    wanted_ns = row[2](now_ns)
                    row[0] = _NEVER_NS if wanted_ns is None else wanted_ns
                except Exception:
                    self._failed(row[1])
                    row[0] = _NEVER_NS
            if row[0] <= first_ns:
                entry = row[1]
                self._catch_up()
                self._next_time(entry, entry[0].before_step, first_ns)
                row[0] = self._next_time(entry, row[2], first_ns)
            if row[0] < calm_ns:
                calm_ns = row[0]
        for row in self._after:
            if query_all:
                row[0] = self._next_time(row[1], row[2], now_ns)
            if row[0] < sample_ns:
                sample_ns = row[0]
        self.calm_ns, self.sample_ns = calm_ns - step_ns, sample_ns

    def measure(self, now_ns: int, again: bool) -> None:
        """Let plugins measure the state after a step.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        again : bool
            Whether to ask the plugins that were due for their next time.
        """
        self._catch_up()
        for entry, after_step in self._acting:
            try:                        # as _next_time, but inline
                after_step(now_ns)
            except Exception:
                self._failed(entry)
        if again:
            for row in self._after:
                if row[0] <= now_ns:
                    row[0] = self._next_time(row[1], row[2], now_ns)
            self.sample_ns = min([row[0] for row in self._after], default=_NEVER_NS)

    def _next_time(self, entry: Entry, function: Callable[[int], Optional[int]], time_ns: int) -> int:
        """Call a function of a plugin; return the time that it returns, or never."""
        try:
            wanted_ns = function(time_ns)
        except Exception:               # the simulation continues without that plugin
            self._failed(entry)
            return _NEVER_NS
        return _NEVER_NS if wanted_ns is None else wanted_ns
