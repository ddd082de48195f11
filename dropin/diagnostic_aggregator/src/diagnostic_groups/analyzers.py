# SPDX-License-Identifier: BSD-3-Clause
"""Groups of diagnostic items: which belong together, and the level that follows from them."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

OK, WARN, ERROR, STALE = range(4)
WORDS = ("OK", "Warning", "Error", "All Stale")
_GENERIC, _GROUP, _DISCARD = "GenericAnalyzer", "AnalyzerGroup", "DiscardAnalyzer"
_TIMEOUT = 5.0                  # s until an item counts as stale
_DEEPEST, _MOST = 10, 2000      # levels of groups; items that are kept


class ConfigurationError(ValueError):
    """A parameter cannot be used; the message says which, and what is expected."""


@dataclass
class Item:
    """The newest state of one item.

    Attributes
    ----------
    name, message, hardware : str
    level : int
        OK, WARN, ERROR, STALE.
    values : list of (str, str)
    time : float
        When it came [s].
    """

    name: str
    level: int
    message: str = ""
    hardware: str = ""
    values: List[Tuple[str, str]] = field(default_factory=list)
    time: float = 0.0


def _texts(given: Any, where: str) -> Tuple[str, ...]:
    """Return a text, or a list of texts, as a tuple."""
    listed = given if isinstance(given, list) else [given]
    if not all(isinstance(text, str) for text in listed):
        raise ConfigurationError("%s is %.60r; expected a text or a list of texts" % (where, given))
    return tuple(listed)


class Group:
    """Items under one path.

    Parameters
    ----------
    parameters : dict
        ``path``, and ``startswith``, ``contains``, ``name``, ``expected``, ``timeout``, ``num_items``,
        ``remove_prefix``, ``find_and_remove_prefix``, ``discard_stale``, or ``analyzers`` of a group of groups.
    where : str
        Name of the parameters, for messages.
    depth : int
        Number of groups around it.

    Raises
    ------
    ConfigurationError
        If a parameter cannot be used.
    """

    def __init__(self, parameters: Mapping[str, Any], where: str, depth: int = 0) -> None:
        if not isinstance(parameters, dict) or depth > _DEEPEST:
            raise ConfigurationError("%s is %.60r; expected a dictionary, in at most %d groups" % (
                where, parameters, _DEEPEST))
        self.kind = str(parameters.get("type", "")).rpartition("/")[2]
        if self.kind not in (_GENERIC, _GROUP, _DISCARD):
            raise ConfigurationError("%s/type is %.60r; expected diagnostic_aggregator/%s, /%s or /%s" % (
                where, parameters.get("type"), _GENERIC, _GROUP, _DISCARD))
        self.path = str(parameters.get("path", where.rpartition("/")[2])).strip("/")
        self._starts = _texts(parameters.get("startswith", []), where + "/startswith")
        prefixes = _texts(parameters.get("find_and_remove_prefix", []), where + "/find_and_remove_prefix")
        self._starts += prefixes
        self._removed = prefixes + _texts(parameters.get("remove_prefix", []), where + "/remove_prefix")
        self._contains = _texts(parameters.get("contains", []), where + "/contains")
        self._names = _texts(parameters.get("name", []), where + "/name")
        self._expected = _texts(parameters.get("expected", []), where + "/expected")
        self._timeout = parameters.get("timeout", _TIMEOUT)
        self._count = parameters.get("num_items", -1)
        for name, value in (("timeout", self._timeout), ("num_items", self._count)):
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise ConfigurationError("%s/%s is %.60r; expected a number" % (where, name, value))
        self._discards_stale = parameters.get("discard_stale") is True
        self.groups = [Group(entry, "%s/%s" % (where + "/analyzers", name), depth + 1)
                       for name, entry in sorted(dict(parameters.get("analyzers", {})).items())] \
            if self.kind == _GROUP else []
        self._items: Dict[str, Item] = {}

    def matches(self, name: str) -> bool:
        """Return whether an item belongs to the group."""
        if self.kind == _GROUP:
            return any(group.matches(name) for group in self.groups)
        return (name in self._names + self._expected or any(map(name.startswith, self._starts))
                or any(part in name for part in self._contains))

    def add(self, item: Item) -> None:
        """Take an item that :meth:`matches`."""
        if self.kind == _GROUP:
            for group in self.groups:
                if group.matches(item.name):
                    group.add(item)
        elif self.kind == _GENERIC and (item.name in self._items or len(self._items) < _MOST):
            self._items[item.name] = item

    def _short(self, name: str) -> str:
        for prefix in self._removed:
            if name.startswith(prefix):
                name = name[len(prefix):]
                break
        return name.lstrip(" :").replace("/", " ") or "item"

    def report(self, base: str, now: float) -> List[Item]:
        """Return the state of the group, and those of its members behind it.

        Parameters
        ----------
        base : str
            Path of the group around it.
        now : float
            [s].
        """
        if self.kind == _DISCARD:
            return []
        place = base.rstrip("/") + "/" + self.path
        if self.kind == _GROUP:
            parts = [group.report(place, now) for group in self.groups]
            heads = [part[0] for part in parts if part]
            return [summary(place, heads, None)] + [item for part in parts for item in part]
        members = []
        for name in sorted(set(self._items) | set(self._expected)):
            item = self._items.get(name) or Item(name, STALE, "Missing")
            stale = name not in self._items or self._timeout > 0 and now - item.time > self._timeout
            if stale and self._discards_stale:
                self._items.pop(name, None)
                continue
            members.append(Item(place + "/" + self._short(name), STALE if stale else item.level, item.message,
                                item.hardware, item.values))
        head = summary(place, members, None if self._count < 0 else int(self._count))
        return [head] + members


def summary(path: str, members: Sequence[Item], count: Optional[int]) -> Item:
    """Return the state of a group: that of its worst member; stale only if all are, otherwise stale ones are errors.

    Parameters
    ----------
    path : str
    members : list of Item
    count : int or None
        Number of members that there must be.
    """
    levels = [member.level for member in members]
    if levels and all(level == STALE for level in levels):
        level = STALE
    else:
        level = max((ERROR if one == STALE else one for one in levels), default=OK)
    item = Item(path, level, WORDS[level],
                values=[(member.name.rpartition("/")[2], member.message) for member in members])
    if count is not None and len(members) != count:
        item.level, item.message = ERROR, "%d items; expected %d" % (len(members), count)
    return item


class Aggregator:
    """All groups, and one for what belongs to none of them.

    Parameters
    ----------
    parameters : dict
        The private parameters of the node: ``analyzers``, ``base_path``, ``other_as_errors``.

    Raises
    ------
    ConfigurationError
        If a parameter cannot be used.
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        analyzers = parameters.get("analyzers", {})
        if not isinstance(analyzers, dict):
            raise ConfigurationError("~analyzers is %.60r; expected a dictionary" % (analyzers,))
        self._base = "/" + str(parameters.get("base_path", "")).strip("/")
        self._strict = parameters.get("other_as_errors") is True
        self._groups = [Group(entry, "~analyzers/" + name) for name, entry in sorted(analyzers.items())]
        self._other = Group({"type": _GENERIC, "path": "Other", "contains": ""}, "~other")

    def add(self, item: Item) -> None:
        """Take an item."""
        for group in [group for group in self._groups if group.matches(item.name)] or [self._other]:
            group.add(item)

    def report(self, now: float) -> List[Item]:
        """Return the states of all groups and items.

        Parameters
        ----------
        now : float
            [s].
        """
        parts = [group.report(self._base, now) for group in self._groups]
        other = self._other.report(self._base, now)
        if len(other) > 1:
            if self._strict:
                other[0].level, other[0].message = ERROR, "%d items belong to no group" % (len(other) - 1)
            parts.append(other)
        return [item for part in parts for item in part]

    @staticmethod
    def worst(report: Sequence[Item]) -> int:
        """Return the level of the whole robot."""
        return max((ERROR if item.level == STALE else item.level for item in report), default=OK)
