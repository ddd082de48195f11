# SPDX-License-Identifier: BSD-3-Clause
"""Safe parsing of untrusted XML; errors name file, line and element.

No other module of this package parses XML text.  This module is independent of URDF and SDF.
"""
from __future__ import annotations

import logging
import math
import os
from contextlib import contextmanager
from typing import Any, Dict, Iterator, NoReturn, Optional, Tuple, Type, Union
from urllib.parse import unquote
from xml.parsers import expat

from lxml import etree

from m2wr_sim.errors import SimError
from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.xml.lenient import tidy

log = logging.getLogger(__name__)

MAX_BYTES = 256 * 1024 * 1024      # large enough for worlds saved with inline meshes, small enough for a laptop
_HUGE_BYTES = 8 * 1024 * 1024      # libxml2 needs its "huge" switch from 10 MB on; below it the depth limit stays
MAX_DEPTH = 256                    # libxml2's own limit without that switch
MAX_ATTRIBUTES = 1000              # of one element; libxml2 2.9 compares each with every other

_NO_MARKS = bytes(set(range(256)) - set(b"<="))

_TRUE, _FALSE = ("true", "1"), ("false", "0")


class XmlError(SimError):
    """A document, element or value that cannot be read; callers turn it into their own kind of error."""


class _Malformed(XmlError):
    """A document that breaks the rules of XML itself."""


@contextmanager
def errors_as(error_class: Type[SimError]) -> Iterator[None]:
    """Turn every :class:`XmlError` inside the block into ``error_class`` with the same message."""
    try:
        yield
    except XmlError as error:
        raise error_class(str(error)) from None


class _Prolog(Exception):
    """Raised by the prolog check to leave expat at the first element."""


def _refuse_entities(data: bytes, source: str, encoding: Optional[str]) -> None:
    """Raise XmlError if the document type declares entities; reads only up to the root element."""
    parser = expat.ParserCreate(encoding)

    def on_entity(name: str, *_: Any) -> None:
        raise XmlError('{}:{}: the document type declares the entity "{}"; entity declarations are rejected; expected '
                       'plain XML without them'.format(source, parser.CurrentLineNumber, name))

    def on_element(*_: Any) -> None:
        raise _Prolog

    parser.EntityDeclHandler = on_entity
    parser.StartElementHandler = on_element
    try:
        parser.Parse(data, True)
    except _Prolog:
        pass
    except expat.ExpatError as error:
        raise _Malformed("{}:{}: not well-formed XML: {}; expected an XML document with one root element".format(
            source, error.lineno, expat.ErrorString(error.code))) from None
    except (LookupError, ValueError) as error:      # expat's errors for an unknown encoding
        raise _Malformed("{}:1: not well-formed XML: {}; expected an encoding such as utf-8".format(
            source, error)) from None


def _refuse_many_attributes(data: bytes, source: str, encoding: Optional[str]) -> None:
    """Raise XmlError where an element has more than MAX_ATTRIBUTES; expat counts them, in linear time.

    Only done if there are so many "=" between two "<".
    """
    if max(map(len, data.translate(None, _NO_MARKS).split(b"<"))) <= MAX_ATTRIBUTES:
        return
    parser = expat.ParserCreate(encoding)

    def on_element(_: str, attributes: Dict[str, str]) -> None:
        if len(attributes) > MAX_ATTRIBUTES:
            raise XmlError("{}:{}: an element has {} attributes; expected at most {}".format(
                source, parser.CurrentLineNumber, len(attributes), MAX_ATTRIBUTES))

    parser.StartElementHandler = on_element
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise _Malformed("{}:{}: not well-formed XML: {}".format(
            source, error.lineno, expat.ErrorString(error.code))) from None


def parse_xml(text: Union[str, bytes], source: str, strict: bool = False) -> Any:
    """Parse XML without document types, entities or network access.

    Parameters
    ----------
    text : str or bytes
        The document.  For str the declared encoding is ignored, since the text is decoded already.
    source : str
        Name of the document for messages, usually a file path.
    strict : bool
        Reject XML errors that Gazebo's parser accepts; otherwise they are corrected with a warning, see
        :mod:`m2wr_sim.model.xml.lenient`.

    Returns
    -------
    lxml.etree._Element
        The root element; comments and processing instructions are left out.

    Raises
    ------
    XmlError
        If the text is empty, too long, too deep, malformed, declares entities, or gives an element too many attributes.
    """
    encoding = "utf-8" if isinstance(text, str) else None
    data = text.encode("utf-8", "replace") if isinstance(text, str) else bytes(text)
    if not data or data.isspace():
        raise XmlError("{}: the document is empty; expected XML".format(source))
    if len(data) > MAX_BYTES:
        raise XmlError("{}: the document has {} MB; expected at most {} MB".format(
            source, len(data) // 2 ** 20, MAX_BYTES // 2 ** 20))
    if isinstance(text, str):
        data = data.lstrip()     # indented string literals and parameter values often start with a line end
    try:
        return _parse(data, source, encoding)
    except _Malformed as error:
        tidied, slips = (data, []) if strict else tidy(data, encoding)
        if not slips:
            raise
        try:
            root = _parse(tidied, source, "utf-8")
        except XmlError:
            raise error from None
        log.warning("%s. It has %s, which Gazebo accepts; it was corrected.", error, " and ".join(slips))
        return root


def _parse(data: bytes, source: str, encoding: Optional[str]) -> Any:
    """Return the root element of a document that keeps the rules of XML."""
    _refuse_entities(data, source, encoding)
    _refuse_many_attributes(data, source, encoding)
    huge = len(data) > _HUGE_BYTES
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False,
                             huge_tree=huge, remove_comments=True, remove_pis=True, encoding=encoding)
    try:
        root = etree.fromstring(data, parser, base_url=source)
    except (etree.XMLSyntaxError, ValueError, LookupError) as error:
        line = getattr(error, "lineno", None) or 1
        message = getattr(error, "msg", None) or str(error)
        raise _Malformed("{}:{}: not well-formed XML: {}".format(source, line, shorten(message, 200))) from None
    if huge:
        _refuse_depth(root, source)
    if None in root.nsmap:     # some robots declare a default namespace; all readers of URDF and SDF ignore it
        for element in root.iter("{{{}}}*".format(root.nsmap[None])):
            element.tag = etree.QName(element).localname
    return root


def _refuse_depth(root: Any, source: str) -> None:
    """Raise XmlError where elements are nested deeper than MAX_DEPTH."""
    try:
        if not root.xpath("boolean({})".format("/*" * (MAX_DEPTH + 1))):
            return
    except etree.XPathError:        # more than ten million elements are equally deep
        log.debug("%s: its depth is found element by element", source)
    depth = 0
    for event, element in etree.iterwalk(root, events=("start", "end")):
        depth += 1 if event == "start" else -1
        if depth > MAX_DEPTH:
            raise XmlError("{}:{}: elements are nested deeper than {}".format(source, element.sourceline, MAX_DEPTH))


def read_file(path: str) -> bytes:
    """Return the bytes of a file; XmlError names a file that is missing, a folder, or not readable."""
    note_file(path)
    try:
        if not os.path.isfile(path) and os.path.exists(path) and not os.path.isdir(path):
            raise XmlError("{}: is no regular file; expected an XML file".format(shorten(path, 300)))
        with open(path, "rb") as stream:
            return stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:      # ValueError: a path that no file can have
        raise XmlError("{}: cannot be read: {}; expected an XML file".format(
            shorten(path, 300), getattr(error, "strerror", None) or error)) from None


def file_of(element: Any) -> str:
    """Return the name of the document of an element."""
    return unquote(element.getroottree().docinfo.URL or "XML")     # libxml2 keeps it as an escaped URL


def path_of(element: Any) -> str:
    """Return the tags from the root to an element, with names: ``sdf/world[default]/model[box]``."""
    steps = []
    for node in reversed([element] + list(element.iterancestors())):
        name = node.get("name")
        tag = etree.QName(node).localname
        steps.append(tag if name is None else "{}[{}]".format(tag, name))
    return "/".join(steps)


def line_of(element: Any) -> str:
    """Return ``file:line`` of an element."""
    return "{}:{}".format(file_of(element), element.sourceline)


def place(element: Any) -> str:
    """Return ``file:line: <path>`` of an element, the way every message of this package starts."""
    return "{}: <{}>".format(line_of(element), path_of(element))


def fail(element: Any, found: str, expected: str) -> NoReturn:
    """Raise an XmlError.

    Parameters
    ----------
    element : lxml element
        Its file, line and path are in the message.
    found, expected : str
        What was found there, and what is valid.

    Raises
    ------
    XmlError
        Always.
    """
    raise XmlError("{}: {}; expected {}".format(place(element), found, expected))


def shorten(text: Optional[str], limit: int = 60) -> str:
    """Return text on one line, for quoting it in a message.

    Parameters
    ----------
    text : str or None
    limit : int
        Greatest number of characters; a longer text is cut.
    """
    line = " ".join((text or "").split())
    return line if len(line) <= limit else line[:limit - 3] + "..."


def required_name(element: Any) -> str:
    """Return the ``name`` attribute; XmlError where it is missing or blank."""
    name = (element.get("name") or "").strip()
    if not name:
        fail(element, "attribute name is missing or empty", "a name")
    return name


# -- values from text ---------------------------------------------------------------------------------------------

def parse_float(element: Any, text: str, what: str = "value", allow_infinite: bool = False) -> float:
    """Return a finite float; XmlError if the text is not one.

    Parameters
    ----------
    element : lxml element
        The element with the text.
    text : str
    what : str
        Name of the value, for the message.
    allow_infinite : bool
        Whether ``inf`` is valid, as in joint limits; NaN never is.
    """
    try:
        value = float(text) if "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isinf(value) and not allow_infinite):
        fail(element, '{} is "{}"'.format(what, shorten(text)), "a finite number")
    return value


def parse_vector(element: Any, text: str, count: int, what: str = "value") -> Tuple[float, ...]:
    """Return finite floats from text separated by white space; XmlError if it does not hold them.

    Parameters
    ----------
    element : lxml element
        The element with the text.
    text : str
    count : int
        How many numbers are expected.
    what : str
        Name of the value, for the message.
    """
    words = text.split()
    if len(words) != count:
        fail(element, '{} is "{}"'.format(what, shorten(text)), "{} numbers".format(count))
    return tuple(parse_float(element, word, what) for word in words)


def parse_bool(element: Any, text: str, what: str = "value") -> bool:
    """Return a truth value: ``true``, ``false``, ``1`` or ``0`` in upper or lower case; XmlError for other text.

    Parameters
    ----------
    element : lxml element
        The element with the text.
    text : str
    what : str
        Name of the value, for the message.
    """
    word = text.strip().lower()
    if word in _TRUE:
        return True
    if word not in _FALSE:
        fail(element, '{} is "{}"'.format(what, shorten(text)), "true or false")
    return False


def parse_int(element: Any, text: str, what: str = "value", lowest: Optional[int] = None) -> int:
    """Return an integer, written ``50`` or ``50.0``; XmlError for other text.

    Parameters
    ----------
    element : lxml element
        The element with the text.
    text : str
    what : str
        Name of the value, for the message.
    lowest : int, optional
        Least valid value.
    """
    value = parse_float(element, text, what)
    if value != int(value) or (lowest is not None and value < lowest):
        fail(element, '{} is "{}"'.format(what, shorten(text)),
             "a whole number" + ("" if lowest is None else " of at least {}".format(lowest)))
    return int(value)
