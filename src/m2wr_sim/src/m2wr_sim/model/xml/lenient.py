# SPDX-License-Identifier: BSD-3-Clause
"""Corrects errors in XML that Gazebo's parser accepts.

Gazebo's parser does not check encodings, namespaces and most rules of XML.  Files written for it can contain dashes
inside comments, single ampersands, undeclared prefixes, letters of Latin-1, or a blank line before the declaration.
"""
from __future__ import annotations

import re
from typing import Iterable, Iterator, List, Optional, Tuple

_MOST_BYTES = 32 * 1024 * 1024      # of a file to correct; such errors are in files written by hand
_MOST_AMPERSANDS = 100000           # in such a file

_ENCODING = re.compile(br"""<\?xml\b[^>]*\bencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_AMPERSAND = re.compile(r"&(?!(?:#\d+|#x[0-9A-Fa-f]+|[A-Za-z_][\w.-]*);)")
_PREFIX = re.compile(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s=/>])")
_FIRST_TAG = re.compile(r"<[A-Za-z_][^\s/>]*")
_DECLARED = re.compile(r"xmlns:([A-Za-z_][\w.-]*)")
_FILLED = re.compile(r"[\s\ufeff]*")      # always matches, without backtracking
_NAME = re.compile(r"<([A-Za-z_][\w.:-]{0,200})")
_MOST_PREFIXES = 50


def tidy(data: bytes, encoding: Optional[str] = None) -> Tuple[bytes, List[str]]:
    """Return a document without these errors, as UTF-8 bytes, and their descriptions.

    Line numbers do not change.

    Parameters
    ----------
    data : bytes
    encoding : str or None
        Encoding of the bytes, instead of the declared one.

    Returns
    -------
    tidied : bytes
    errors : list of str
        Empty if nothing was corrected.
    """
    errors: List[str] = []
    if len(data) > _MOST_BYTES or data.count(b"&") > _MOST_AMPERSANDS:
        return data, errors
    text = _decoded(data, encoding, errors)
    without = without_comments(text)
    if without != text and _has_odd_comment(text):
        errors.append('"--" inside a comment')
    text = without
    without = _without(text, _declarations(text))
    if without != text and not text.startswith("<?xml"):
        errors.append("something in front of the XML declaration")
    text = without
    if _AMPERSAND.search(text):
        errors.append('an "&" that is not written "&amp;"')
        text = _AMPERSAND.sub("&amp;", text)
    text = _declared(text, errors)
    return text.encode("utf-8"), errors


def _decoded(data: bytes, encoding: Optional[str], errors: List[str]) -> str:
    """Return the text of the bytes: in the encoding they declare, in UTF-8, or else in Latin-1, which always works."""
    declared = _ENCODING.search(data[:1000])
    for name in ([encoding] if encoding else [declared.group(1).decode()] if declared else []) + ["utf-8-sig"]:
        try:
            return data.decode(name)
        except (LookupError, ValueError):
            continue
    errors.append("letters that are not UTF-8, taken as Latin-1")
    return data.decode("latin-1")


def _spans(text: str, begin: str, end: str) -> Iterator[Tuple[int, int]]:
    """Yield where every ``begin`` that has an ``end`` starts and ends; in linear time."""
    at = text.find(begin)
    while at >= 0:
        close = text.find(end, at + len(begin))
        if close < 0:
            return
        yield at, close + len(end)
        at = text.find(begin, close + len(end))


def _comments(text: str) -> Iterator[Tuple[int, int]]:
    return _spans(text, "<!--", "-->")


def _declarations(text: str) -> Iterator[Tuple[int, int]]:
    return _spans(text, "<?xml", "?>")


def _has_odd_comment(text: str) -> bool:
    return any("--" in text[start + 4:end - 3] or text[end - 4] == "-" for start, end in _comments(text))


def without_comments(text: str) -> str:
    """Return the text without its comments, except their line ends."""
    return _without(text, _comments(text))


def _without(text: str, spans: Iterable[Tuple[int, int]]) -> str:
    kept, at = [], 0
    for start, end in spans:
        kept.append(text[at:start] + "\n" * text.count("\n", start, end))
        at = end
    return "".join(kept) + text[at:]


def _declared(text: str, errors: List[str]) -> str:
    """Return the text with a declaration of each undeclared prefix in the root element."""
    missing = sorted(set(_PREFIX.findall(text)).difference(_DECLARED.findall(text), ("xml", "xmlns")))[:_MOST_PREFIXES]
    first = _FIRST_TAG.search(text)
    if not missing or first is None:
        return text
    errors.append("the undeclared prefix " + ", ".join(missing))
    return text[:first.end()] + "".join(' xmlns:{0}="{0}"'.format(prefix) for prefix in missing) + text[first.end():]


def root_tag(text: str) -> Optional[str]:
    """Return the name of the first element of a text, or None; the text need not be XML.

    It skips spaces, declarations, comments and a document type, in linear time.
    """
    at = 0
    while True:
        blank = _FILLED.match(text, at)
        at = at if blank is None else blank.end()
        if text.startswith("<?", at):
            at = _behind(text, "?>", at)
        elif text.startswith("<!--", at):
            at = _behind(text, "-->", at + 4)
        elif text.startswith("<!DOCTYPE", at):
            close, inner = text.find(">", at), text.find("[", at)
            if 0 <= inner < close:
                close = text.find(">", _behind(text, "]", inner))
            at = close + 1 if close >= 0 else len(text)
        else:
            found = _NAME.match(text, at)
            return found.group(1) if found else None


def _behind(text: str, mark: str, at: int) -> int:
    found = text.find(mark, at)
    return len(text) if found < 0 else found + len(mark)
