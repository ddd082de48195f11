# SPDX-License-Identifier: BSD-3-Clause
"""Tables of parameters: names, defaults, ranges and meanings, with conversion of the values that a user gives."""
from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Dict, Iterable, List, Mapping, Tuple

from m2wr_node.numbers import number


@dataclass(frozen=True)
class Parameter:
    """One parameter.

    Attributes
    ----------
    default : bool, int, float, str or list of str
        Its type is that of the parameter.
    unit : str
        Empty: none.
    low, high : float
        Range, both ends included; a number outside is clipped.
    meaning : str
        One sentence.
    changeable : bool
        Whether dynamic_reconfigure offers it.
    refuses_below : bool
        Whether a number below the range is refused, because the lower end would make no sense in its place.
    """

    default: Any
    unit: str
    low: float
    high: float
    meaning: str
    changeable: bool = True
    refuses_below: bool = False


class Configurable:
    """What has a table of parameters: planners, controllers, recovery behaviours, costmap layers.

    Parameters
    ----------
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    """

    #: Parameters below its namespace.
    PARAMETERS: ClassVar[Dict[str, Parameter]] = {}
    #: Old names of parameters that files still use, with the present ones.
    ALIASES: ClassVar[Dict[str, str]] = {}

    @classmethod
    def renamed(cls, given: Mapping[str, Any]) -> Dict[str, Any]:
        """Return parameters with the present name of each; a value under the present name wins.

        Parameters
        ----------
        given : mapping of str to object
            As files name them.
        """
        found = {name: value for name, value in given.items() if name not in cls.ALIASES}
        for old, present in cls.ALIASES.items():
            if old in given:
                found.setdefault(present, given[old])
        return found

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values: Dict[str, Any] = dict(values)

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take new values of all parameters, between two calls of anything else.

        Parameters
        ----------
        values : mapping of str to object
            As in the constructor.
        """
        self.values = dict(values)


def flag(default: bool, meaning: str, changeable: bool = True) -> Parameter:
    """Return a parameter that is true or false.

    Parameters
    ----------
    default : bool
    meaning : str
    changeable : bool
    """
    return Parameter(default, "", 0, 1, meaning, changeable)


def text(default: str, meaning: str, changeable: bool = False) -> Parameter:
    """Return a parameter that is a text.

    Parameters
    ----------
    default : str
    meaning : str
    changeable : bool
    """
    return Parameter(default, "", 0, 0, meaning, changeable)


def names(default: List[str], meaning: str) -> Parameter:
    """Return a parameter that is a list of names.

    Parameters
    ----------
    default : list of str
    meaning : str
    """
    return Parameter(default, "", 0, 0, meaning, False)


def converted(parameter: Parameter, value: object) -> Any:
    """Return a value in the parameter's type and range, or None if it cannot be used.

    Integers become floats, whole floats integers, 0 and 1 truth values, and a number outside the range the nearest
    end, as in dynamic_reconfigure, unless it is below the range of a parameter that refuses this.

    Parameters
    ----------
    parameter : Parameter
    value : object
        As the parameter server holds it.
    """
    default = parameter.default
    if isinstance(default, str):
        return value if isinstance(value, str) else None
    if isinstance(default, list):
        return list(value) if isinstance(value, list) and all(isinstance(name, str) for name in value) else None
    if isinstance(default, bool):
        return bool(value) if isinstance(value, (bool, int)) and value in (0, 1) else None
    amount = number(value)
    if amount is None or math.isnan(amount) or (parameter.refuses_below and amount < parameter.low):
        return None
    amount = min(max(amount, parameter.low), parameter.high)
    if isinstance(default, int):
        return int(round(amount)) if math.isfinite(amount) else None
    return float(amount)


def read(table: Mapping[str, Parameter], given: Mapping[str, object], place: str) -> Tuple[Dict[str, Any], List[str]]:
    """Return the value of every parameter of a table, and warnings about values that were not taken as they are.

    Parameters
    ----------
    table : mapping of str to Parameter
    given : mapping of str to object
        Values by name; names that the table does not have are ignored.
    place : str
        Namespace, for messages, such as ``~local_costmap``.

    Returns
    -------
    values : dict of str to object
    warnings : list of str
    """
    values, warnings = {}, []
    for name, parameter in table.items():
        values[name] = parameter.default
        if name not in given:
            continue
        value = converted(parameter, given[name])
        if value is None:
            warnings.append("parameter {}/{} is {!r}; expected {}; {!r} is used".format(
                place, name, given[name], expected_of(parameter), parameter.default))
            continue
        values[name] = value
        if number(given[name]) is not None and not isinstance(value, (bool, str, list)) \
                and abs(float(value) - float(number(given[name]) or 0.0)) > 1e-9 * max(1.0, abs(float(value))):
            warnings.append("parameter {}/{} is {!r}; expected {}; {!r} is used".format(
                place, name, given[name], expected_of(parameter), value))
    return values, warnings


def expected_of(parameter: Parameter) -> str:
    """Return what a parameter accepts, for a message."""
    default = parameter.default
    if isinstance(default, bool):
        return "true or false"
    if isinstance(default, str):
        return "a text"
    if isinstance(default, list):
        return "a list of names"
    kind = "a whole number" if isinstance(default, int) else "a number"
    unit = " " + parameter.unit if parameter.unit else ""
    return "{} from {:g} to {:g}{}".format(kind, parameter.low, parameter.high, unit)


#: Names from older versions and other packages, with the present ones.
RENAMED = {"max_vel_rot": "max_vel_theta", "min_vel_rot": "min_vel_theta", "max_rot_vel": "max_vel_theta",
           "min_rot_vel": "min_vel_theta", "max_rotational_vel": "max_vel_theta",
           "rot_stopped_vel": "theta_stopped_vel",
           "max_trans_vel": "max_vel_trans", "min_trans_vel": "min_vel_trans", "acc_lim_th": "acc_lim_theta",
           "acc_limit_trans": "acc_lim_trans"}


def unknown(given: Iterable[str], known: Iterable[str], place: str) -> List[str]:
    """Return one sentence for each name without effect, with the most similar known name.

    Parameters
    ----------
    given : iterable of str
        Names on the parameter server.
    known : iterable of str
        Names that are read.
    place : str
        Namespace, for messages.
    """
    names = sorted(known)
    sentences = []
    for name in sorted(set(given) - set(names)):
        near = [RENAMED[name]] if RENAMED.get(name) in names else difflib.get_close_matches(name, names, 1, 0.6)
        sentences.append("parameter {}/{} has no effect{}".format(
            place, name, "; did you mean {}?".format(near[0]) if near else ""))
    return sentences
