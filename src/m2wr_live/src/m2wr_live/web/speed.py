# SPDX-License-Identifier: BSD-3-Clause
"""The list with which a page sets the real-time factor; it shows the simulation's own one."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, List, Optional

if TYPE_CHECKING:
    from m2wr_live.web.actions import Actions

UNLIMITED = "as fast as possible"
NOT_KNOWN = "not known yet"
OFFERED = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)


def words_of(factor: Optional[float]) -> str:
    """Return how the list shows a real-time factor; 0: no limit, None: not known."""
    if factor is None or not math.isfinite(factor) or factor < 0.0:
        return NOT_KNOWN
    return "%.3g" % factor if factor else UNLIMITED


def options_with(factor: Optional[float]) -> List[str]:
    """Return the options of a list that shows a real-time factor, which may be one that is not offered."""
    own = [] if factor is None or not 0.0 < factor < math.inf else [factor]
    offered = [words_of(value) for value in sorted({*OFFERED, *own})]
    words = words_of(factor)
    return list(dict.fromkeys(([NOT_KNOWN] if words == NOT_KNOWN else []) + offered + [UNLIMITED]))


class SpeedList:
    """The list on one page.

    Parameters
    ----------
    gui : viser.GuiApi
    actions : Actions
    attempt : callable
        Runs an action of the user, and says if it fails.
    """

    def __init__(self, gui: Any, actions: Actions, attempt: Callable[[Callable[[], None]], None]) -> None:
        self._actions = actions
        factor = actions.factor()
        self._list = gui.add_dropdown("Real-time factor", options_with(factor), initial_value=words_of(factor))

        @self._list.on_update
        def _(event: Any) -> None:
            words = str(self._list.value)
            if event.client is None or words == NOT_KNOWN or words not in self._list.options:   # the first: by show()
                return
            attempt(lambda: actions.set_factor(0.0 if words == UNLIMITED else float(words)))

    def show(self) -> None:
        """Show the factor that the simulation has now; called a few times a second."""
        factor = self._actions.factor()
        words, options = words_of(factor), tuple(options_with(factor))
        if words != NOT_KNOWN and self._list.value != words:
            if tuple(self._list.options) != options:
                self._list.options = options
            self._list.value = words
