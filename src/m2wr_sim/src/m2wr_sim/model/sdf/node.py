# SPDX-License-Identifier: BSD-3-Clause
"""Access to values and children of one SDF element, with warnings about unsupported elements.

Every element that a reader does not use is reported by the rules of :mod:`m2wr_sim.model.sdf.elements`.  For an invalid
value there is a warning and the default is used, as in Gazebo.  Without a default it raises an XmlError, and the part
that contains it is left out.
"""
from __future__ import annotations

from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    List,
    Literal,
    NoReturn,
    Optional,
    Set,
    Tuple,
    TypeVar,
    overload,
)

from lxml import etree

from m2wr_sim.model.sdf.elements import IDLE, QUIET, REASONS, ROWS, SILENT_ATTRIBUTES
from m2wr_sim.model.xml.safe import (
    XmlError,
    fail,
    file_of,
    line_of,
    parse_bool,
    parse_float,
    parse_int,
    parse_vector,
    place,
    required_name,
)

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.notes import Notes

_Value = TypeVar("_Value")
_Number = TypeVar("_Number", float, Optional[float])
_Flag = TypeVar("_Flag", bool, Optional[bool])
_FIRST, _ALL = 1, 2
# of a missing element: nothing is ever stored in them
_NO_CHILDREN: Dict[str, List[Any]] = {}
_NOT_ASKED: Dict[str, int] = {}
_NO_ATTRIBUTES: Set[str] = set()
_NONE_KEPT: Dict[str, Any] = {}
_NO_LISTS: Dict[str, List[Any]] = {}


def shown(value: object) -> str:
    """Return a default as it is written in a file."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (tuple, list)):
        return " ".join(shown(part) for part in value)
    return "{:g}".format(value) if isinstance(value, (int, float)) else str(value)


class Node:
    """One element, or a missing one, whose values are all defaults.

    Parameters
    ----------
    element : lxml element or None
    notes : Notes
        Gets the warnings.
    row : str, optional
        Its row in the tables of :mod:`m2wr_sim.model.sdf.elements`; by default its tag.

    Attributes
    ----------
    element, notes, row
        As given.
    raw_pose : tuple or None
        Kept by :func:`~m2wr_sim.model.sdf.frames.raw_pose`, which is asked for the same pose several times.
    """

    __slots__ = ("element", "notes", "row", "_children", "_asked", "_attributes", "_kept", "_lists", "raw_pose")

    def __init__(self, element: Any, notes: Notes, row: Optional[str] = None) -> None:
        self.element, self.notes = element, notes
        self.raw_pose: Optional[Tuple[Pose, Optional[str]]] = None
        if element is None:         # half of all that readers ask for; nothing is stored in these
            self.row = row or ""
            self._children, self._asked, self._attributes = _NO_CHILDREN, _NOT_ASKED, _NO_ATTRIBUTES
            self._kept, self._lists = _NONE_KEPT, _NO_LISTS
            return
        self.row = row or etree.QName(element).localname
        self._children, self._asked, self._attributes, self._kept, self._lists = {}, {}, set(), {}, {}
        for child in element:
            self._children.setdefault(child.tag, []).append(child)

    def __bool__(self) -> bool:
        return self.element is not None

    @property
    def tag(self) -> str:
        """The element's own tag."""
        return self.element.tag

    @property
    def file(self) -> str:
        """Name of the document."""
        return file_of(self.element)

    @property
    def line(self) -> str:
        """``file:line`` of it."""
        return line_of(self.element)

    @property
    def place(self) -> str:
        """``file:line: <path>`` of it."""
        return place(self.element)

    def fail(self, found: str, expected: str) -> NoReturn:
        """Raise XmlError: what was found here and what was expected.

        Parameters
        ----------
        found : str
            What was found here.
        expected : str
            What is valid.

        Raises
        ------
        XmlError
            Always.
        """
        fail(self.element, found, expected)

    # ---- content --------------------------------------------------------------------------------------------

    def name(self) -> str:
        """Return the attribute ``name``; XmlError where it is missing or blank."""
        self._attributes.add("name")
        return required_name(self.element)

    def attribute(self, name: str) -> str:
        """Return an attribute without spaces around it; empty where it is missing."""
        if self.element is None:
            return ""
        self._attributes.add(name)
        return (self.element.get(name) or "").strip()

    def own_text(self) -> str:
        """Return the text of the element itself, without spaces around it."""
        return "" if self.element is None else (self.element.text or "").strip()

    def tags(self) -> List[str]:
        """Return the tags of all children, in the order of the document."""
        return [] if self.element is None else [child.tag for child in self.element]

    def has(self, tag: str) -> bool:
        """Return whether there is a child ``tag``, without marking it as read."""
        return tag in self._children

    def child(self, tag: str) -> Node:
        """Return the first child ``tag`` as a Node, which is false if there is none."""
        if self.element is None:
            return Node(None, self.notes, ROWS.get((self.row, tag), tag))
        node = self._kept.get(tag)
        if node is None:
            node = self._kept[tag] = Node(self._ask(tag), self.notes, ROWS.get((self.row, tag), tag))
        return node

    def children(self, tag: str) -> List[Node]:
        """Return all children ``tag`` as Nodes."""
        if self.element is None:
            return []
        self._asked[tag] = _ALL
        row = ROWS.get((self.row, tag), tag)
        nodes = self._lists.get(tag)
        if nodes is None:
            nodes = self._lists[tag] = [Node(found, self.notes, row) for found in self._children.get(tag, ())]
        return nodes

    def _ask(self, tag: str) -> Any:
        if self.element is None:
            return None
        self._asked.setdefault(tag, _FIRST)
        found = self._children.get(tag)
        return None if found is None else found[0]

    def text(self, tag: str) -> Optional[str]:
        """Return the text of the first child ``tag``, or None where it is missing."""
        found = self._ask(tag)
        return None if found is None else (found.text or "").strip()

    def value(self, tag: str, default: _Value, parse: Callable[[Any, str, str], _Value]) -> _Value:
        """Return ``parse(element, text, tag)`` of child ``tag``, or the default as :meth:`number` does.

        Parameters
        ----------
        tag : str
            Name of the child.
        default : object
            Default if the child is missing or invalid.
        parse : callable
            Returns the value, or raises XmlError.

        Returns
        -------
        object
        """
        found = self._ask(tag)
        text = "" if found is None else (found.text or "").strip()
        if found is not None and (len(found) or found.keys()):
            self._report_extras(found)
        if not text:
            return default
        try:
            return parse(found, text, tag)
        except XmlError as error:
            self.notes.add("{}; using {}.".format(error, shown(default)))
            return default

    def number(self, tag: str, default: _Number, least: Optional[float] = None,
               allow_infinite: bool = False) -> _Number:
        """Return the number in child ``tag``, or the default if it is missing, invalid or below ``least``.

        Parameters
        ----------
        tag : str
            Name of the child.
        default : float or None
            Default if the child is missing or invalid.
        least : float, optional
            Least valid value.
        allow_infinite : bool
            Whether infinity is valid.

        Returns
        -------
        float or None
        """
        def parse(element: Any, text: str, what: str) -> _Number:
            value = parse_float(element, text, what, allow_infinite)
            if least is not None and value < least:
                fail(element, "{} is {}".format(what, text),
                     "zero or a positive number" if least == 0.0 else "a number of at least {:g}".format(least))
            return value
        return self.value(tag, default, parse)

    def whole(self, tag: str, default: int, least: Optional[int] = None) -> int:
        """Return the whole number in child ``tag``, or the default as :meth:`number` does.

        Parameters
        ----------
        tag : str
            Name of the child.
        default : int
            Default if the child is missing or invalid.
        least : int, optional
            Least valid value.

        Returns
        -------
        int
        """
        return self.value(tag, default, lambda element, text, what: parse_int(element, text, what, least))

    def flag(self, tag: str, default: _Flag) -> _Flag:
        """Return the truth value in child ``tag``, or the default as :meth:`number` does.

        Parameters
        ----------
        tag : str
            Name of the child.
        default : bool or None
            Default if the child is missing or invalid.

        Returns
        -------
        bool or None
        """
        return self.value(tag, default, parse_bool)

    @overload
    def vector(self, tag: str, count: Literal[2], default: Tuple[float, float]) -> Tuple[float, float]: ...

    @overload
    def vector(self, tag: str, count: Literal[3], default: Vector) -> Vector: ...

    @overload
    def vector(self, tag: str, count: int, default: Optional[Tuple[float, ...]]) -> Optional[Tuple[float, ...]]: ...

    def vector(self, tag: str, count: int, default: Any) -> Any:
        """Return the ``count`` numbers in child ``tag`` as a tuple, or the default as :meth:`number` does.

        Parameters
        ----------
        tag : str
            Name of the child.
        count : int
            How many numbers.
        default : tuple of float or None
            Default if the child is missing or invalid.

        Returns
        -------
        tuple of float or None
        """
        return self.value(tag, default, lambda element, text, what: parse_vector(element, text, count, what))

    def strict_vector(self, tag: str, count: int, default: Tuple[float, ...]) -> Tuple[float, ...]:
        """Return as :meth:`vector`, but raise XmlError where the child is there and does not hold the numbers.

        Parameters
        ----------
        tag : str
            Name of the child.
        count : int
            How many numbers.
        default : tuple of float
            Default if the child is missing or empty.

        Returns
        -------
        tuple of float

        Raises
        ------
        XmlError
            If the child holds no such numbers.
        """
        found = self._ask(tag)
        text = "" if found is None else (found.text or "").strip()
        return parse_vector(found, text, count, tag) if text else default

    def positive(self, tag: str, default: Optional[float] = None) -> float:
        """Return the positive number in child ``tag``; XmlError if it is missing and there is no default.

        Parameters
        ----------
        tag : str
            Name of the child.
        default : float, optional
            Default if the child is missing or invalid.

        Returns
        -------
        float

        Raises
        ------
        XmlError
            Without a default, if the child is missing or invalid.
        """
        found = self._ask(tag)

        def parse(element: Any, text: str, what: str) -> float:
            value = parse_float(element, text, what)
            if value <= 0.0:
                fail(element, "{} is {}".format(what, text), "a positive number")
            return value

        if default is not None:
            return self.value(tag, default, parse)
        if found is None:
            self.fail("<{}> is missing".format(tag), "a positive number there")
        return parse(found, (found.text or "").strip(), tag)

    def extent(self, tag: str, count: int) -> Tuple[float, ...]:
        """Return ``count`` positive numbers in child ``tag``, which must be there.

        Parameters
        ----------
        tag : str
            Name of the child.
        count : int
            How many numbers: 2 or 3.

        Returns
        -------
        tuple of float

        Raises
        ------
        XmlError
            If the child is missing or a number is not positive.
        """
        found = self._ask(tag)
        expected = "{} positive numbers".format({2: "two", 3: "three"}[count])
        if found is None:
            self.fail("<{}> is missing".format(tag), expected + " there")
        values = parse_vector(found, found.text or "", count, tag)
        if min(values) <= 0.0:
            fail(found, '{} is "{}"'.format(tag, (found.text or "").strip()), expected)
        return values

    def _report_extras(self, leaf: Any) -> None:
        """Report attributes and children of an element that should hold only a value."""
        for name in leaf.keys():
            if "}" not in name and name not in SILENT_ATTRIBUTES.get(leaf.tag, ()):
                self.notes.add("{}: unsupported attribute {} of <{}> ignored.".format(
                    line_of(leaf), name, _local(leaf.tag)), ("attribute", leaf.tag, name))
        for child in leaf:
            self.notes.add("{}: unsupported element <{}> in <{}> ignored.".format(
                line_of(child), _local(child.tag), _local(leaf.tag)), ("unread", leaf.tag, child.tag))

    # ---- reports ---------------------------------------------------------------------------------------------

    def ignore(self) -> None:
        """Mark all its content as read: it belongs to a part that is left out, or to a plugin."""
        if self.element is not None:
            self._children, self._kept, self._lists = {}, {}, {}
            self._attributes.update(self.element.keys())

    def done(self) -> None:
        """Report the elements and attributes that were not read, here and in the children that were."""
        if self.element is None:
            return
        for tag, elements in self._children.items():
            asked = self._asked.get(tag, 0)
            if not asked:
                self._report(tag, elements[0])
            elif asked == _FIRST and len(elements) > 1:
                self.notes.add("{}: there is another <{}> in <{}>; the first is read.".format(
                    line_of(elements[1]), _local(tag), self._local_tag()), ("again", self.row, tag))
        for name in self.element.keys():
            if name not in self._attributes and "}" not in name and name not in SILENT_ATTRIBUTES.get(self.row, ()):
                self.notes.add("{}: unsupported attribute {} of <{}> ignored.".format(
                    self.line, name, self._local_tag()), ("attribute", self.row, name))
        for node in self._kept.values():
            node.done()
        for nodes in self._lists.values():
            for node in nodes:
                node.done()
        self.ignore()

    def _local_tag(self) -> str:
        return etree.QName(self.element).localname

    def _report(self, tag: str, element: Any) -> None:
        idle = IDLE.get((self.row, tag))
        if idle is not None and _is_idle(element.text, idle):
            return
        if tag in QUIET.get(self.row, ()):
            self.notes.remark(element, "<{}>".format(self._local_tag()))
            return
        reason = REASONS.get((self.row, tag))
        self.notes.add("{}: unsupported element <{}> in <{}> ignored{}.".format(
            line_of(element), _local(tag), self._local_tag(), "; " + reason if reason else ""),
            ("unread", self.row, tag))


def _local(tag: str) -> str:
    return tag.rpartition("}")[2]


def _is_idle(text: Optional[str], value: float) -> bool:
    text = (text or "").strip()
    try:
        return float(text) == value
    except ValueError:
        return value == 0.0 and text.lower() == "false"
