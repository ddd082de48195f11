# SPDX-License-Identifier: BSD-3-Clause
"""Reads a launch file and all that it includes, and collects what it needs; starts and executes nothing."""
from __future__ import annotations

import os
import shlex
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

import yaml

from m2wr_sim.model.xml.safe import XmlError, parse_xml, read_file
from m2wr_tools.doctor.launch_words import NOT_KNOWN, Doubtful, Unknown, Words, not_found

MOST_FILES = 300            # launch files in one tree
DEEPEST = 30                # includes within includes
MOST_ELEMENTS = 20000       # in all files
LARGEST_YAML = 1 << 20      # bytes of a parameter file that is looked into
_MODEL_FILES = (".xacro", ".urdf", ".sdf")


@dataclass
class NodeEntry:
    """A ``<node>``: package, executable, name, words of ``args``, whether roslaunch ends with it, and where it is."""

    package: str
    kind: str
    name: str
    words: List[str]
    required: bool
    place: str


@dataclass
class RobotFile:
    """A description that a command of a ``<param>`` makes, or that ``spawn_model`` reads."""

    path: str
    arguments: Dict[str, str]
    place: str


@dataclass
class LaunchContents:
    """What a launch file and its includes hold; ``place`` texts are FILE:LINE."""

    files: List[str] = field(default_factory=list)
    nodes: List[NodeEntry] = field(default_factory=list)
    robots: List[RobotFile] = field(default_factory=list)
    missing: Dict[str, str] = field(default_factory=dict)       # package of a $(find) that does not exist -> place
    absent: List[Tuple[str, str]] = field(default_factory=list)     # file that does not exist, place
    unset: Dict[str, str] = field(default_factory=dict)         # argument or variable without a value -> place
    unknown: List[Tuple[str, str]] = field(default_factory=list)    # why a text is not known, place
    faults: List[Tuple[str, str]] = field(default_factory=list)     # sentence, place
    commands: List[Tuple[str, str]] = field(default_factory=list)   # a command that is no xacro, place
    types: Dict[str, str] = field(default_factory=dict)         # key with a ``type`` in a parameter file -> the type


class _TooMuch(Exception):
    """The tree of files exceeds a limit."""


class LaunchReader:
    """Walks launch files as roslaunch does, but past what is missing.

    Parameters
    ----------
    find : callable
        Package name -> its folder, or None.
    environ : mapping of str to str
        Environment variables.
    """

    def __init__(self, find: Callable[[str], Optional[str]], environ: Mapping[str, str]) -> None:
        self._find, self._environ = find, environ
        self._elements = 0
        self._out = LaunchContents()

    def read(self, path: str, arguments: Mapping[str, str]) -> LaunchContents:
        """Return the contents of a launch file.

        Parameters
        ----------
        path : str
            Of the file.
        arguments : mapping of str to str
            As ``name:=value`` on the command line of roslaunch.
        """
        self._out, self._elements = LaunchContents(), 0
        try:
            self._file(path, dict(arguments), 0)
        except _TooMuch as limit:
            self._out.faults.append((str(limit), path))
        return self._out

    def _file(self, path: str, passed: Dict[str, Optional[str]], depth: int) -> None:
        out = self._out
        if len(out.files) >= MOST_FILES or depth > DEEPEST:
            raise _TooMuch("the includes are more than %d files, or %d deep: reading ends here" % (
                MOST_FILES, DEEPEST))
        try:
            root = parse_xml(read_file(path), path)
        except (XmlError, OSError) as error:
            out.faults.append((str(error), path))
            return
        out.files.append(path)
        if root.tag != "launch":
            out.faults.append(("the root element is <%s>; expected <launch>" % root.tag, path))
            return
        words = Words(self._find, self._environ, path)
        self._children(root, words, passed, depth)

    def _children(self, parent: Any, words: Words, passed: Dict[str, Optional[str]], depth: int) -> None:
        for element in parent.iterchildren("*"):
            self._elements += 1
            if self._elements > MOST_ELEMENTS:
                raise _TooMuch("more than %d elements: reading ends here" % MOST_ELEMENTS)
            if not self._applies(element, words):
                continue
            if element.tag == "arg":
                self._argument(element, words, passed)
            elif element.tag == "group":
                inner = dict(words.arguments)
                self._children(element, words, passed, depth)
                words.arguments = inner
            elif element.tag == "include":
                self._include(element, words, depth)
            elif element.tag in ("node", "test"):
                self._node(element, words)
            elif element.tag == "param":
                self._param(element, words)
            elif element.tag == "rosparam":
                self._rosparam(element, words)

    def _place(self, element: Any, words: Words) -> str:
        return "%s:%d" % (words.path, element.sourceline or 0)

    def _text(self, element: Any, name: str, words: Words) -> Optional[str]:
        """Return an attribute with its substitutions, None if it is missing or not known."""
        value = element.get(name)
        if value is None:
            return None
        place = self._place(element, words)
        words.missing.clear()
        words.unset.clear()
        try:
            return words.resolve(value)
        except Unknown as reason:
            if not words.unset and not isinstance(reason, Doubtful):
                self._out.unknown.append((str(reason), place))
            return None
        finally:
            self._note(words, place)

    def _note(self, words: Words, place: str) -> None:
        for name in words.missing:
            self._out.missing.setdefault(name, place)
        for name in words.unset:
            self._out.unset.setdefault(name, place)

    def _applies(self, element: Any, words: Words) -> bool:
        """Return whether an element is used; True if the condition is not known."""
        for name, wanted in (("if", True), ("unless", False)):
            if element.get(name) is not None:
                self._text(element, name, words)
                value = words.condition(element.get(name))
                if value is not None and value is not wanted:
                    return False
        return True

    def _argument(self, element: Any, words: Words, passed: Dict[str, Optional[str]]) -> None:
        name = element.get("name", "")
        if element.get("value") is not None:
            words.arguments[name] = self._known(element, "value", words)
        elif name in passed:
            words.arguments[name] = passed[name]
        elif element.get("default") is not None:
            words.arguments[name] = self._known(element, "default", words)
        else:
            words.arguments[name] = None
            self._out.unset.setdefault("argument %s" % name, self._place(element, words))

    def _known(self, element: Any, name: str, words: Words) -> str:
        value = self._text(element, name, words)
        return NOT_KNOWN if value is None else value

    def _include(self, element: Any, words: Words, depth: int) -> None:
        path = self._text(element, "file", words)
        passed: Dict[str, Optional[str]] = {}
        if element.get("pass_all_args") in ("true", "1"):
            passed.update(words.arguments)
        for child in element.iterchildren("arg"):
            if self._applies(child, words):
                name = "value" if child.get("value") is not None else "default"
                passed[child.get("name", "")] = self._known(child, name, words)
        if path is None or not self._is_there(path, self._place(element, words)):
            return
        if path in self._out.files and any(words.condition(element.get(name)) is None for name in ("if", "unless")
                                           if element.get(name) is not None):
            return                      # a file that includes itself ends by a condition
        self._file(path, passed, depth + 1)

    def _is_there(self, path: str, place: str) -> bool:
        if not_found(path):
            return False
        if not os.path.isfile(path):
            self._out.absent.append((path, place))
            return False
        return True

    def _node(self, element: Any, words: Words) -> None:
        place = self._place(element, words)
        texts = {name: self._text(element, name, words) or "" for name in ("pkg", "type", "name", "args")}
        entry = NodeEntry(texts["pkg"], texts["type"], texts["name"], _split(texts["args"]),
                          (element.get("required") or "").lower() in ("true", "1"), place)
        if entry.package and entry.kind:
            self._out.nodes.append(entry)
        if entry.kind == "spawn_model" and "-file" in entry.words[:-1]:
            self._model_file(entry.words[entry.words.index("-file") + 1], {}, place)
        self._children(element, words, {}, 0)

    def _param(self, element: Any, words: Words) -> None:
        place = self._place(element, words)
        for name in ("textfile", "binfile"):
            path = self._text(element, name, words)
            if path is not None and self._is_there(path, place) and path.endswith(_MODEL_FILES):
                self._model_file(path, {}, place)
        command = self._text(element, "command", words)
        self._text(element, "value", words)
        if command is None:
            return
        parts = _split(command)
        model = next((part for part in parts[1:] if part.endswith(_MODEL_FILES)), None)
        if model is None:
            if parts and not not_found(command):
                self._out.commands.append((parts[0], place))
            return
        arguments = dict(part.split(":=", 1) for part in parts if ":=" in part)
        self._model_file(model, arguments, place)

    def _model_file(self, path: str, arguments: Dict[str, str], place: str) -> None:
        if self._is_there(path, place):
            self._out.robots.append(RobotFile(path, arguments, place))

    def _rosparam(self, element: Any, words: Words) -> None:
        path = self._text(element, "file", words)
        if path is None or element.get("command", "load") != "load" or not self._is_there(
                path, self._place(element, words)):
            return
        try:
            if os.path.getsize(path) <= LARGEST_YAML:
                with open(path, encoding="utf-8", errors="replace") as stream:
                    _collect_types(yaml.safe_load(stream), self._out.types)
        except (OSError, yaml.YAMLError, RecursionError, ValueError) as error:
            self._out.faults.append(("%s cannot be read as YAML: %s" % (path, str(error).splitlines()[0]),
                                     self._place(element, words)))


def _collect_types(value: Any, types: Dict[str, str], deep: int = 0) -> None:
    """Collect the keys of a parameter file that hold a ``type``: the controllers of ros_control."""
    if isinstance(value, dict) and deep < DEEPEST:
        for key, inner in value.items():
            if isinstance(inner, dict):
                if isinstance(inner.get("type"), str):
                    types[str(key)] = inner["type"]
                _collect_types(inner, types, deep + 1)


def _split(text: str) -> List[str]:
    try:
        return shlex.split(text)
    except ValueError:              # an unpaired quote
        return text.split()
