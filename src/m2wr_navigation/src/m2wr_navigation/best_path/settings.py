# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a drive: planners, controller, criteria."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, List, Mapping, Sequence, Tuple

from m2wr_navigation import registry
from m2wr_navigation.best_path.candidates import PLANNERS
from m2wr_navigation.best_path.scoring import make_scorer
from m2wr_navigation.parameters import Parameter, flag, names, read, text, unknown

if TYPE_CHECKING:
    from m2wr_navigation.best_path.pilot import Maker
    from m2wr_navigation.best_path.scoring import Scorer

PARAMETERS: Dict[str, Parameter] = {
    "planners": names(list(PLANNERS), "planners that give candidates"),
    "controller": text("m2wr_navigation/PurePursuit", "controller that drives; its parameters are below its name"),
    "unknown": flag(True, "whether paths may lead through unknown space", False),
}
CRITERIA = "criteria"       # namespace of the criteria
SPEED = 0.6                 # m/s: as Bug 2 towards the goal (motion_plan.bug2.APPROACH_SPEED), so that times compare


@dataclass(frozen=True)
class Settings:
    """What a drive needs besides the survey.

    Attributes
    ----------
    scorer : Scorer
    make : callable
        Returns a new controller.
    planners : sequence of str
        As in ``registry.PLANNERS``.
    unknown : bool
        Whether paths may lead through unknown cells.
    """

    scorer: Scorer
    make: Maker
    planners: Sequence[str]
    unknown: bool


def _mapping(value: object) -> Mapping[str, object]:
    return value if isinstance(value, Mapping) else {}


def make_settings(given: Mapping[str, object], place: str) -> Tuple[Settings, List[str]]:
    """Return settings from the parameters of a user, and warnings about those that were not taken.

    Parameters
    ----------
    given : mapping of str to object
        Of :data:`PARAMETERS`; ``criteria``; below the controller's name its own ones.
    place : str
        Namespace, for messages.

    Raises
    ------
    UnknownPluginError
        If there is no such planner or controller.
    """
    values, warnings = read(PARAMETERS, given, place)
    for planner in values["planners"]:
        registry.find(registry.PLANNERS, planner)
    kind, short = registry.find(registry.CONTROLLERS, values["controller"]), registry.short_name(values["controller"])
    own = kind.renamed(_mapping(given.get(short, {})))
    if "max_vel_x" in kind.PARAMETERS:
        own.setdefault("max_vel_x", SPEED)
    settings, found = read(kind.PARAMETERS, own, place + "/" + short)
    scorer, more = make_scorer(_mapping(given.get(CRITERIA, {})), place + "/" + CRITERIA)
    warnings += found + unknown(own, kind.PARAMETERS, place + "/" + short) + more
    return Settings(scorer, lambda: kind(settings), values["planners"], values["unknown"]), warnings
