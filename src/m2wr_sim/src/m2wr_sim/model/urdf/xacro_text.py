# SPDX-License-Identifier: BSD-3-Clause
"""Raw xacro text -> plain URDF text, through the xacro module of ROS.

A xacro document is a program: its expressions are Python, and it can read any file. So only documents that the user
named on a command line or in a call are expanded, never those from a topic, service or parameter.
"""
from __future__ import annotations

import io
import os
import re
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Optional
from xml.parsers.expat import ExpatError

from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.xml.safe import XmlError, line_of, parse_xml, read_file, shorten

if TYPE_CHECKING:
    from m2wr_sim.model.model_folders import ResolvePackage

_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")
_EXPRESSION = re.compile(r"\$[{(]")
_LOCK = threading.Lock()     # the xacro module keeps its state in globals


def xacro_in(root: Any) -> Optional[str]:
    """Return where a parsed document holds a xacro element, or ``${...}`` or ``$(...)`` in an attribute; else None."""
    for element in root.iter("*"):
        if element.prefix == "xacro" or element.tag.rstrip("}").startswith("{http://www.ros.org/wiki/xacro"):
            return "{}: <xacro:{}>".format(line_of(element), element.tag.rpartition("}")[2])
        for name, value in element.attrib.items():
            if _EXPRESSION.search(value):
                return '{}: {}="{}"'.format(line_of(element), name, shorten(value))
    return None


def expanded(text: str, source: str, resolve_package: Optional[ResolvePackage] = None) -> str:
    """Return a description from a file the user named, expanded if it is xacro; other text is returned unchanged.

    Must not be used for text from a topic, service or parameter, because xacro evaluates Python expressions.

    Parameters
    ----------
    text : str
    source : str
    resolve_package : callable or None
        As for :func:`expand_xacro`.

    Returns
    -------
    str
    """
    root = parse_xml(text, source)
    return expand_xacro(text, source, resolve_package) if root.tag == "robot" and xacro_in(root) else text


@contextmanager
def _prepared(xacro: Any, resolve_package: Optional[ResolvePackage]) -> Iterator[None]:
    """Let xacro find packages through the caller and read its includes through the safe parser's checks."""
    eval_extension, parse, find = xacro.eval_extension, xacro.parse, resolve_package
    absolute = xacro.abs_filename_spec

    def find_first(text: str) -> str:
        if find is not None:
            text = _FIND.sub(lambda match: _folder(match.group(1), find), text)
        return eval_extension(text) if _EXPRESSION.search(text) else text

    def noted_absolute(name: str) -> Any:       # load_yaml opens files itself
        path = absolute(name)
        note_file(str(path))
        return path

    def checked_parse(inp: Any, filename: Optional[str] = None) -> Any:
        if inp is None and filename is not None and os.path.isfile(filename):
            data = read_file(filename)
            parse_xml(data, filename, strict=True)
            inp = io.BytesIO(data)
        return parse(inp, filename)

    xacro.eval_extension, xacro.parse, xacro.abs_filename_spec = find_first, checked_parse, noted_absolute
    try:
        yield
    finally:
        xacro.eval_extension, xacro.parse, xacro.abs_filename_spec = eval_extension, parse, absolute


def _folder(package: str, resolve_package: ResolvePackage) -> str:
    try:
        folder = resolve_package(package)
    except Exception as error:     # rospkg and others raise their own kinds
        raise XmlError("$(find {}): {}; expected an installed package".format(
            package, shorten(str(error), 200))) from None
    if not folder:
        raise XmlError("$(find {}): there is no such package; expected an installed package".format(package))
    return str(folder)


def _location(xacro: Any, source: str) -> str:
    """Return the file and macro that xacro was working on, for messages."""
    files = [name for name in (getattr(xacro, "filestack", None) or []) if name]
    text = str(files[-1]) if files else source
    for macro in reversed(getattr(xacro, "macrostack", None) or []):
        body = getattr(macro, "body", None)
        if body is not None:
            return '{}: macro "{}"'.format(text, body.getAttribute("name"))
    return text


def expand_xacro(text: str, source: str, resolve_package: Optional[ResolvePackage] = None,
                 arguments: Optional[Mapping[str, str]] = None) -> str:
    """Run xacro over a document.

    Parameters
    ----------
    text : str
        The xacro document.
    source : str
        Its name for messages; if it is the path of a file, relative includes start from there.
    resolve_package : callable or None
        ``resolve_package(name) -> folder`` for ``$(find name)``; None: xacro finds packages itself.
    arguments : dict or None
        Values for ``xacro:arg``.

    Returns
    -------
    str

    Raises
    ------
    XmlError
        If xacro is not installed, or the document does not expand; with file, line or macro, as far as known.
    """
    try:
        import xacro
    except ImportError:
        raise XmlError("{}: the text is xacro, but the Python module xacro is not installed; expected URDF, or the "
                       "module".format(source)) from None
    with _LOCK, _prepared(xacro, resolve_package):
        xacro.init_stacks(source if os.path.isfile(source) else None)
        try:
            document = xacro.parse(text)
            xacro.process_doc(document, mappings=dict(arguments or {}))
            return document.toprettyxml(indent="  ")
        except XmlError as error:
            raise XmlError("{}: xacro: {}".format(_location(xacro, source), error)) from None
        except ExpatError as error:
            raise XmlError("{}:{}: xacro: not well-formed XML: {}".format(
                _location(xacro, source), error.lineno, error)) from None
        except Exception as error:     # xacro evaluates Python expressions: anything may come out
            raise XmlError("{}: xacro: {}; expected a document that xacro expands".format(
                _location(xacro, source), shorten(str(error) or repr(error), 300))) from None
