# SPDX-License-Identifier: BSD-3-Clause
"""A plugin that records its calls, for tests of the simulator."""
from m2wr_sim.plugins.base import Plugin

MS = 1000000


class Trace(Plugin):
    """Records when it is called; acts before every step and after every third."""

    calls, fails_in = [], ()

    def _note(self, name, now_ns):
        self.calls.append((name, now_ns // MS))
        if name in self.fails_in:
            raise RuntimeError("broken in %s" % name)

    def configure(self, spec, ctx):
        self._ctx = ctx
        self._port = ctx.advertise("/trace", str)
        ctx.subscribe("/orders", str, self._order)
        self._note("configure", ctx.now_ns)

    def _order(self, message):
        self.calls.append(("order", message))
        if "order" in self.fails_in:
            raise RuntimeError("broken in order")

    def next_before(self, now_ns):
        if "next_before" in self.fails_in:
            self._note("next_before", now_ns)
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns):
        self._note("before", now_ns)

    def next_after(self, now_ns):
        if "next_after" in self.fails_in:
            self._note("next_after", now_ns)
        return (now_ns // (3 * MS) + 1) * 3 * MS

    def after_step(self, now_ns):
        self._note("after", now_ns)

    def reset(self, now_ns, rewound):
        self._note("rewound" if rewound else "reset", now_ns)

    def close(self):
        self._note("close", 0)
