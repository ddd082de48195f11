# SPDX-License-Identifier: BSD-3-Clause
"""Reads values of a YAML file strictly: an error names file, key, what was read and what was expected."""
from __future__ import annotations

import difflib
import math
import os
from typing import Any, Dict, Hashable, List, Optional, Sequence, Set, Tuple

import yaml

LARGEST_FILE = 1_000_000        # bytes
MOST_ENTRIES = 1000             # of a list
LONGEST_TEXT = 1000             # characters
DEEPEST = 20                    # lists and mappings in one another
SHOWN = 60                      # characters of a value in a message


class StudyError(ValueError):
    """A study that cannot be used."""


class _StrictLoader(yaml.SafeLoader):
    """Refuses keys that occur twice, aliases, which can make a small file endless, and deep nesting."""

    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("line {}: an alias; expected values without aliases".format(
                self.peek_event().start_mark.line + 1))
        self._depth += 1
        if self._depth > DEEPEST:
            raise yaml.YAMLError("line {}: more than {} lists and mappings in one another".format(
                self.peek_event().start_mark.line + 1, DEEPEST))
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> Dict[Hashable, Any]:
        known: Set[object] = set()
        for key, _ in node.value:
            if key.value in known:
                raise yaml.YAMLError("line {}: the key {} occurs twice".format(
                    key.start_mark.line + 1, shown(key.value)))
            known.add(key.value if isinstance(key.value, str) else id(key))
        return super().construct_mapping(node, deep)


def shown(value: object) -> str:
    """Return a value for a message, shortened."""
    text = repr(value)
    return text if len(text) <= SHOWN else text[:SHOWN] + "..."


def load(path: str) -> Fields:
    """Return the fields of a YAML file.

    Raises
    ------
    StudyError
        If the file cannot be read, is too large, or is no mapping in YAML.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise StudyError("{}: {}; expected a readable file".format(path, error.strerror or error)) from None
    if len(data) > LARGEST_FILE:
        raise StudyError("{}: more than {} bytes; expected a study".format(path, LARGEST_FILE))
    try:
        value = yaml.load(data.decode("utf-8"), Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError) as error:
        raise StudyError("{}: {}; expected YAML".format(path, " ".join(str(error).split()))) from None
    return Fields(value, os.path.basename(path), "")


class Fields:
    """A mapping of the file. Each reader takes one of its keys; :meth:`end` refuses the others.

    Parameters
    ----------
    value : object
        As it was read.
    file : str
        For messages.
    place : str
        Of the mapping in the file, such as ``worlds[2]``; empty: the whole file.

    Raises
    ------
    StudyError
        If it is no mapping with texts as keys.
    """

    def __init__(self, value: object, file: str, place: str) -> None:
        self.file, self.place = file, place
        if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
            raise StudyError(self.problem("", value, "a mapping with names as keys"))
        self._values: Dict[str, Any] = value
        self._read: Set[str] = set()

    def problem(self, key: str, value: object, expected: str) -> str:
        """Return the sentence about a value that cannot be used.

        Parameters
        ----------
        key : str
            Empty: the mapping itself.
        value : object
            What was read.
        expected : str
        """
        place = ".".join(part for part in (self.place, key) if part)
        return "{}: {}read {}; expected {}".format(self.file, place + ": " if place else "", shown(value), expected)

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def keys(self) -> List[str]:
        """Return the keys in their order."""
        return list(self._values)

    def _take(self, key: str, default: Any, expected: str) -> Any:
        self._read.add(key)
        if key in self._values:
            return self._values[key]
        if default is None:
            place = ".".join(part for part in (self.place, key) if part)
            raise StudyError("{}: {} is missing; expected {}".format(self.file, place, expected))
        return default

    def text(self, key: str, default: Optional[str] = None, choices: Sequence[str] = ()) -> str:
        """Return a text.

        Parameters
        ----------
        key : str
        default : str, optional
            None: the key must be there.
        choices : sequence of str, optional
            What is accepted; empty: every text.

        Raises
        ------
        StudyError
            If it is missing or something else.
        """
        expected = "one of " + ", ".join(choices) if choices else "a text"
        value = self._take(key, default, expected)
        if not isinstance(value, str) or not 0 < len(value) <= LONGEST_TEXT or (choices and value not in choices):
            near = difflib.get_close_matches(str(value)[:LONGEST_TEXT], choices, 1)
            expected += "; did you mean {}?".format(near[0]) if near else ""
            raise StudyError(self.problem(key, value, expected))
        return value

    def number(self, key: str, low: float, high: float, default: Optional[float] = None, unit: str = "") -> float:
        """Return a finite number.

        Parameters
        ----------
        key : str
        low, high : float
            Range, both ends included.
        default : float, optional
            None: the key must be there.
        unit : str, optional

        Raises
        ------
        StudyError
            If it is missing or something else.
        """
        expected = "a number from {:g} to {:g}{}".format(low, high, " " + unit if unit else "")
        value = self._take(key, default, expected)
        if not _is_number(value) or not low <= value <= high:
            raise StudyError(self.problem(key, value, expected))
        return float(value)

    def whole(self, key: str, low: int, high: int, default: Optional[int] = None) -> int:
        """Return a whole number.

        Parameters
        ----------
        key : str
        low, high : int
            Range, both ends included.
        default : int, optional
            None: the key must be there.

        Raises
        ------
        StudyError
            If it is missing or something else.
        """
        expected = "a whole number from {} to {}".format(low, high)
        value = self._take(key, default, expected)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise StudyError(self.problem(key, value, expected))
        return value

    def numbers(self, key: str, counts: Sequence[int], most: float) -> Tuple[float, ...]:
        """Return finite numbers.

        Parameters
        ----------
        key : str
        counts : sequence of int
            How many are accepted.
        most : float
            Greatest absolute value.

        Raises
        ------
        StudyError
            If it is missing or something else.
        """
        expected = "{} numbers up to {:g}".format(" or ".join(map(str, counts)), most)
        value = self._take(key, None, expected)
        if not isinstance(value, list) or len(value) not in counts \
                or not all(_is_number(item) and abs(item) <= most for item in value):
            raise StudyError(self.problem(key, value, expected))
        return tuple(map(float, value))

    def entries(self, key: str, default: Optional[List[Any]] = None, expected: str = "a list") -> List[Any]:
        """Return a list that is not empty; one value alone is a list of one.

        Parameters
        ----------
        key : str
        default : list, optional
            None: the key must be there.
        expected : str, optional

        Raises
        ------
        StudyError
            If it is missing or something else.
        """
        value = self._take(key, default, expected)
        value = value if isinstance(value, list) else [value]
        if not 0 < len(value) <= MOST_ENTRIES:
            raise StudyError(self.problem(key, value, "{} of 1 to {} entries".format(expected, MOST_ENTRIES)))
        return value

    def below(self, key: str) -> Fields:
        """Return a mapping below a key; empty if the key is not there."""
        return Fields(self._take(key, {}, "a mapping"), self.file, ".".join(p for p in (self.place, key) if p))

    def entry(self, key: str, index: int, value: object) -> Fields:
        """Return an entry of a list, which is a mapping.

        Parameters
        ----------
        key : str
        index : int
        value : object
            The entry.
        """
        return Fields(value, self.file, "{}[{}]".format(".".join(p for p in (self.place, key) if p), index))

    def end(self) -> None:
        """Refuse keys that were not read."""
        for key in self._values:
            if key not in self._read:
                near = difflib.get_close_matches(key, sorted(self._read), 1)
                raise StudyError("{}: {} is not known{}; known are {}".format(
                    self.file, ".".join(part for part in (self.place, key) if part),
                    ", did you mean {}?".format(near[0]) if near else "", ", ".join(sorted(self._read))))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
