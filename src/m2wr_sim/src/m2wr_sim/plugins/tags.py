# SPDX-License-Identifier: BSD-3-Clause
"""Typed access to the tags of a plugin."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import FrozenSet, Iterable, List, Optional, Sequence, Tuple, Union

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Vector
from m2wr_sim.model.types import PluginSpec
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE


class PluginReader:
    """Reads the tags of a plugin and records which ones were read.

    Parameters
    ----------
    spec : PluginSpec
    known : iterable of str
        Further tags that are not reported as unread.

    Attributes
    ----------
    problems : list of str
        A sentence about each value that is invalid and was replaced by its default.
    defaults : list of (str, object)
        Each missing tag and the default that was used for it.
    """

    def __init__(self, spec: PluginSpec, known: Iterable[str] = ()) -> None:
        self.spec = spec
        self._read = {"robotNamespace", "alwaysOn", "rosDebugLevel"} | set(known)
        self.problems: List[str] = []
        self.defaults: List[Tuple[str, object]] = []

    def text(self, tag: str, default: Optional[str] = None) -> str:
        """Return the text of a tag.

        Parameters
        ----------
        tag : str
        default : str, optional
            Returned for a missing or empty tag.

        Raises
        ------
        PluginError
            If the tag is missing or empty and there is no default.
        """
        found = self._find(tag, default)
        return found if isinstance(found, str) else str(found)

    def _find(self, tag: str, default: Union[str, float, None]) -> Union[str, float]:
        self._read.add(tag)
        found = self.spec.find(tag)
        if found is not None and found != "":
            return found
        if default is None:
            raise PluginError("%s: needs a <%s> element" % (self.spec.where, tag))
        self.defaults.append((tag, default))
        return default

    def _float(self, text: Union[str, float]) -> float:
        try:
            return float(text)
        except (TypeError, ValueError):
            return math.nan

    def number(self, tag: str, default: Optional[float] = None, minimum: Optional[float] = None) -> float:
        """Return a finite number.

        Parameters
        ----------
        tag : str
        default : float, optional
            Returned for a missing or empty tag.
        minimum : float, optional
            Least valid value.

        Raises
        ------
        PluginError
            For any other value, and if the tag is missing and there is no default.
        """
        text = self._find(tag, default)
        value = self._float(text)
        if not abs(value) < math.inf or (minimum is not None and value < minimum):
            raise PluginError("%s: <%s> holds \"%s\"; expected a finite number%s"
                              % (self.spec.where, tag, text, "" if minimum is None else " of at least %g" % minimum))
        return value

    def length(self, tag: str, default: Optional[float] = None) -> float:
        """Return a length [m] between the smallest and the largest size of a shape.

        Parameters
        ----------
        tag : str
        default : float, optional
            Returned for a missing or empty tag [m].

        Raises
        ------
        PluginError
            For any other value, and if the tag is missing and there is no default.
        """
        text = self._find(tag, default)
        value = self._float(text)
        if not LEAST_SIZE <= value <= FARTHEST:
            raise PluginError("%s: <%s> holds \"%s\"; expected a length from %g to %g m"
                              % (self.spec.where, tag, text, LEAST_SIZE, FARTHEST))
        return value

    def ignore(self, *tags: str) -> None:
        """Mark tags as known that have no effect, as in Gazebo."""
        self._read.update(tags)

    def vector(self, tag: str) -> Vector:
        """Return three finite numbers; zeros if the tag is missing."""
        text = self.text(tag, "0 0 0")
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != 3 or not all(abs(value) < math.inf for value in values):
            raise PluginError("%s: <%s> holds \"%s\"; expected three finite numbers" % (self.spec.where, tag, text))
        return values[0], values[1], values[2]

    def flag(self, tag: str, default: bool) -> bool:
        """Return a boolean, written as true, false, 1 or 0 in upper or lower case.

        Parameters
        ----------
        tag : str
        default : bool
            Used for a missing tag and, as in Gazebo, for any other text.
        """
        text = self.text(tag, "true" if default else "false").strip()
        values = {"true": True, "1": True, "false": False, "0": False}
        if text.lower() not in values:
            self.problems.append("<%s> must be either true or false but is \"%s\"; using %s"
                                 % (tag, text, str(default).lower()))
        return values.get(text.lower(), default)

    def choice(self, tag: str, values: Sequence[str], default: str) -> str:
        """Return one of several texts.

        Parameters
        ----------
        tag : str
        values : sequence of str
            Valid texts.
        default : str
            Used for a missing tag and, as in Gazebo, for any other text.
        """
        text = self.text(tag, default)
        if text not in values:
            self.problems.append("<%s> must be one of %s but is \"%s\"; using %s"
                                 % (tag, ", ".join(values), text, default))
        return text if text in values else default

    def groups(self, tag: str) -> List[PluginReader]:
        """Return a reader for the content of each element of a name, in their order.

        Parameters
        ----------
        tag : str
            Of elements directly below the plugin.

        Returns
        -------
        list of PluginReader
            Their tags are those inside the element; ``@name`` is an attribute of it.
        """
        self._read.add(tag)
        found: List[List[Tuple[str, str]]] = []
        for name, text in self.spec.parameters:
            if name.startswith(tag + "/"):
                inner = name[len(tag) + 1:]
                if not found or "/" not in inner and any(inner == other for other, _ in found[-1]):
                    found.append([])        # an attribute or child that occurs again: the next element
                found[-1].append((inner, text))
        return [PluginReader(replace(self.spec, parameters=tuple(group)), self._read) for group in found]

    def known(self) -> FrozenSet[str]:
        """Return the tags that were read or ignored on purpose."""
        return frozenset(self._read)

    def unread(self) -> List[str]:
        """Return the unsupported tags, in document order, without repeats."""
        seen: List[str] = []
        for tag, _ in self.spec.parameters:
            if tag.split("/")[0] not in self._read and tag not in seen and "/@" not in tag:
                seen.append(tag)
        return seen
