# SPDX-License-Identifier: BSD-3-Clause
"""Which recovery behaviours there are, in which order, and with which parameters: those of move_base or of its list."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Dict, List, Mapping, Tuple

from m2wr_navigation import registry
from m2wr_navigation.parameters import read

if TYPE_CHECKING:
    from m2wr_navigation.recoveries.recovery import Costmaps, Recovery

    Listed = List[Tuple[str, str, Dict[str, Any]]]

CLEAR, ROTATE = "clear_costmap_recovery/ClearCostmapRecovery", "rotate_recovery/RotateRecovery"
BACK_UP = "m2wr_navigation/BackUpRecovery"


def default_list(values: Mapping[str, Any], circumscribed: float) -> Listed:
    """Return name, type and parameters of the behaviours that move_base has without ``recovery_behaviors``.

    They are those of the original and, after the first turn, ``back_up``. It does nothing where the robot can turn.
    Where it cannot, neither turns nor cleared costmaps help, and few controllers back.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of move_base.
    circumscribed : float
        Circumscribed radius of the robot [m].
    """
    turn: Listed = []
    back: Listed = []
    if values["clearing_rotation_allowed"]:
        turn.append(("rotate_recovery", ROTATE, {}))
        back.append(("back_up", BACK_UP, {}))
    return [("conservative_reset", CLEAR, {"reset_distance": values["conservative_reset_dist"]}), *turn, *back,
            ("aggressive_reset", CLEAR, {"reset_distance": 4.0 * circumscribed}), *turn]


def listed(given: Any) -> Tuple[Listed, str]:
    """Return the behaviours of ``recovery_behaviors``, and why it cannot be used, if so.

    Parameters
    ----------
    given : object
        A list of {name, type}.
    """
    found: Listed = []
    for entry in given if isinstance(given, list) else [given]:
        if not (isinstance(entry, dict) and isinstance(entry.get("name"), str) and isinstance(entry.get("type"), str)):
            return [], "it has the entry {!r}; expected a name and a type".format(entry)
        if entry["name"] in (name for name, _, _ in found):
            return [], "the name {} is there twice".format(entry["name"])
        found.append((entry["name"], entry["type"], {}))
    return found, ""


def made(values: Mapping[str, Any], circumscribed: float, costmaps: Costmaps,
         given: Callable[[str], Any]) -> Tuple[List[Recovery], List[str]]:
    """Return the recovery behaviours, and sentences about parameters that cannot be used.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of move_base.
    circumscribed : float
        Circumscribed radius of the robot [m].
    costmaps : Costmaps
    given : callable of str to object
        The value of a parameter of move_base's namespace, such as ``recovery_behaviors`` or the mapping below a
        behaviour's name; None: there is none.
    """
    wanted = default_list(values, circumscribed)
    warnings: List[str] = []
    own = given("recovery_behaviors")
    if own is not None:
        found, fault = listed(own)
        if fault:
            warnings.append("parameter ~recovery_behaviors is not used, but the default: {}".format(fault))
        else:
            wanted = found
    recoveries: List[Recovery] = []
    for name, kind_name, defaults in wanted:
        try:
            kind = registry.find(registry.RECOVERIES, kind_name)
        except registry.UnknownPluginError as error:
            warnings.append("recovery behaviour {} is left out: {}".format(name, error))
            continue
        # the real rotate_recovery reads the limits of the base from there
        base = _mapping(given("TrajectoryPlannerROS")) if kind_name == ROTATE else {}
        settings, faults = read(kind.PARAMETERS, {**base, **defaults, **_mapping(given(name))}, "~" + name)
        warnings += faults
        recoveries.append(kind(name, settings, costmaps))
    return recoveries, warnings


def _mapping(given: Any) -> Dict[str, Any]:
    return given if isinstance(given, dict) else {}
