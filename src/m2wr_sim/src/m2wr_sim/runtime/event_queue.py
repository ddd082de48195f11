# SPDX-License-Identifier: BSD-3-Clause
"""What plugins want to do next: they are asked, their answers noted, and they are called when it is time."""
from m2wr_sim.plugins.base import Plugin

_NEVER_NS = 1 << 62


def _overrides(plugin, name):
    """Tell whether a plugin has a method of its own where the base class has one that does nothing."""
    return getattr(getattr(plugin, name), "__func__", None) is not getattr(Plugin, name)


class EventQueue:
    """Calls plugins, in their order, before and after steps.

    Parameters
    ----------
    failed : callable
        ``failed(entry)`` is called while an exception of the plugin ``entry[0]`` is handled.
    catch_up : callable
        Brings the bodies to where they are now, for a plugin that is about to look at them.

    Attributes
    ----------
    calm_ns : int
        No plugin wants to act before the steps that end up to this time [ns].
    sample_ns : int
        No plugin wants to measure before this time [ns].
    stale : bool
        Whether :meth:`fill` must be called before anything else, for plugins have come or gone.
    """

    def __init__(self, failed, catch_up):
        self._failed, self._catch_up = failed, catch_up
        self._before = self._after = self._acting = ()
        self.calm_ns, self.sample_ns, self.stale = 0, 0, True

    def fill(self, entries):
        """Take the plugins there are now; they must be asked anew then."""
        before, after, acting = ([entry for entry in entries if _overrides(entry[0], name)]
                                 for name in ("next_before", "next_after", "after_step"))
        # with the time at which each wants to be called, as it has said last
        self._before, self._after = ([[_NEVER_NS, entry, getattr(entry[0], name)] for entry in asked]
                                     for name, asked in (("next_before", before), ("next_after", after)))
        self._acting, self.stale = [(entry, entry[0].after_step) for entry in acting], False

    def act(self, now_ns, step_ns, anew):
        """Let plugins act before the next step that want to, and find out how far the engine may run for their sake.

        ``anew`` asks all of them, else their last answers hold.
        """
        first_ns, calm_ns, sample_ns = now_ns + step_ns, _NEVER_NS, _NEVER_NS
        for row in self._before:
            if anew:
                try:                    # as in _wish, without a call: most of what there is to do goes through here
                    wanted_ns = row[2](now_ns)
                    row[0] = _NEVER_NS if wanted_ns is None else wanted_ns
                except Exception:
                    self._failed(row[1])
                    row[0] = _NEVER_NS
            if row[0] <= first_ns:
                entry = row[1]
                self._catch_up()
                self._wish(entry, entry[0].before_step, first_ns)
                row[0] = self._wish(entry, row[2], first_ns)
            if row[0] < calm_ns:
                calm_ns = row[0]
        for row in self._after:
            if anew:
                row[0] = self._wish(row[1], row[2], now_ns)
            if row[0] < sample_ns:
                sample_ns = row[0]
        self.calm_ns, self.sample_ns = calm_ns - step_ns, sample_ns

    def measure(self, now_ns, again):
        """Let plugins look at the state; ``again`` asks those that wanted to when they want to do so next."""
        self._catch_up()
        for entry, after_step in self._acting:
            try:                        # as in _wish, without a call
                after_step(now_ns)
            except Exception:
                self._failed(entry)
        if again:
            for row in self._after:
                if row[0] <= now_ns:
                    row[0] = self._wish(row[1], row[2], now_ns)
            self.sample_ns = min([row[0] for row in self._after], default=_NEVER_NS)

    def _wish(self, entry, function, time_ns):
        """Call a function of a plugin; returns the time it names, if any."""
        try:
            wanted_ns = function(time_ns)
        except Exception:               # the simulation goes on without that plugin
            self._failed(entry)
            return _NEVER_NS
        return _NEVER_NS if wanted_ns is None else wanted_ns
