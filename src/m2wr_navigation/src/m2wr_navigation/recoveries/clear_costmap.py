# SPDX-License-Identifier: BSD-3-Clause
"""``clear_costmap_recovery/ClearCostmapRecovery``: forgets obstacles that sensors have seen."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Tuple

from m2wr_navigation.parameters import Parameter, flag, names, text
from m2wr_navigation.recoveries.recovery import Recovery, Step

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation


class ClearCostmap(Recovery):
    """Clears all outside of a square around the robot, in one cycle.

    The layers are those of ``layer_names`` that there are; if there is none of them, all layers with obstacles.
    """

    PARAMETERS = {
        "reset_distance": Parameter(3.0, "m", 0.0, 1e6, "side of the square around the robot"),
        "layer_names": names([], "layers that are cleared; empty: all that hold obstacles"),
        "affected_maps": text("both", "global, local or both"),
        "invert_area_to_clear": flag(False, "whether the inside of the square is cleared"),
        "force_updating": flag(False, "accepted, without effect: a costmap is updated before the next plan"),
    }

    def step(self, situation: Situation) -> Step:
        wanted = self.values["affected_maps"]
        done = []
        for which in ("global", "local"):
            if wanted in (which, "both") or wanted not in ("global", "local", "both"):
                layers, told = self._layers(which)
                count = self.costmaps.clear(which, layers, self.values["reset_distance"],
                                            self.values["invert_area_to_clear"])
                done.append("{} occupied cells of {} in the {} costmap{}".format(
                    count, ", ".join(layers) or "no layer", which, told))
        return Step(None, True, "{} cleared {} {:g} m around the robot: {}".format(
            self.name, "within" if self.values["invert_area_to_clear"] else "all but",
            self.values["reset_distance"], "; ".join(done)))

    def _layers(self, which: str) -> Tuple[List[str], str]:
        """Return the layers to clear in a costmap, and a remark if they are not those that were asked for."""
        there = self.costmaps.layer_names(which)
        asked: List[str] = self.values["layer_names"]
        found = [name for name in there if name in asked]
        if asked and not found:
            return there, " (it has none of {})".format(", ".join(asked))
        return found or there, ""
