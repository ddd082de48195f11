# SPDX-License-Identifier: BSD-3-Clause
"""XML with the slips that Gazebo's own parser never minded, put right for one that does.

Gazebo reads worlds and models with a parser that knows no encodings, no namespaces, and few of XML's rules.  Files that
have only ever met that parser hold dashes inside comments, single ampersands, prefixes that nobody declared, letters of
Latin-1, or a blank line in front of the declaration.
"""
import re

_MOST_BYTES = 32 * 1024 * 1024      # of a file to put right; such slips are made by hand, in files written by hand
_MOST_AMPERSANDS = 100000           # in such a file

_ENCODING = re.compile(br"""<\?xml\b[^>]*\bencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_AMPERSAND = re.compile(r"&(?!(?:#\d+|#x[0-9A-Fa-f]+|[A-Za-z_][\w.-]*);)")
_PREFIX = re.compile(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s=/>])")
_FIRST_TAG = re.compile(r"<[A-Za-z_][^\s/>]*")
_DECLARED = re.compile(r"xmlns:([A-Za-z_][\w.-]*)")
_FILLED = re.compile(r"[\s\ufeff]*")      # always matches, and never goes back
_NAME = re.compile(r"<([A-Za-z_][\w.:-]{0,200})")
_MOST_PREFIXES = 50


def tidy(data, encoding=None):
    """Return a document without those slips, as UTF-8 bytes, and what they were.

    Lines stay where they are.

    Parameters
    ----------
    data : bytes
    encoding : str or None
        What the bytes are encoded in, whatever they declare; None: as they declare.

    Returns
    -------
    tidied : bytes
    slips : list of str
        Empty where there is nothing that could be put right.
    """
    slips = []
    if len(data) > _MOST_BYTES or data.count(b"&") > _MOST_AMPERSANDS:
        return data, slips
    text = _decoded(data, encoding, slips)
    without = without_comments(text)
    if without != text and _has_odd_comment(text):
        slips.append('"--" inside a comment')
    text = without
    without = _without(text, _declarations(text))
    if without != text and not text.startswith("<?xml"):
        slips.append("something in front of the XML declaration")
    text = without
    if _AMPERSAND.search(text):
        slips.append('an "&" that is not written "&amp;"')
        text = _AMPERSAND.sub("&amp;", text)
    text = _declared(text, slips)
    return text.encode("utf-8"), slips


def _decoded(data, encoding, slips):
    """Return the text of the bytes: in the encoding they declare, in UTF-8, or else in Latin-1, which always works."""
    declared = _ENCODING.search(data[:1000])
    for name in ([encoding] if encoding else [declared.group(1).decode()] if declared else []) + ["utf-8-sig"]:
        try:
            return data.decode(name)
        except (LookupError, ValueError):
            continue
    slips.append("letters that are not UTF-8, taken as Latin-1")
    return data.decode("latin-1")


def _spans(text, begin, end):
    """Yield where every ``begin`` that has an ``end`` starts and ends; each character is looked at a few times."""
    at = text.find(begin)
    while at >= 0:
        close = text.find(end, at + len(begin))
        if close < 0:
            return
        yield at, close + len(end)
        at = text.find(begin, close + len(end))


def _comments(text):
    return _spans(text, "<!--", "-->")


def _declarations(text):
    return _spans(text, "<?xml", "?>")


def _has_odd_comment(text):
    return any("--" in text[start + 4:end - 3] or text[end - 4] == "-" for start, end in _comments(text))


def without_comments(text):
    """Return the text with nothing but the line ends of its comments."""
    return _without(text, _comments(text))


def _without(text, spans):
    kept, at = [], 0
    for start, end in spans:
        kept.append(text[at:start] + "\n" * text.count("\n", start, end))
        at = end
    return "".join(kept) + text[at:]


def _declared(text, slips):
    """Return the text with a declaration in the root element of each prefix that has none anywhere."""
    missing = sorted(set(_PREFIX.findall(text)).difference(_DECLARED.findall(text), ("xml", "xmlns")))[:_MOST_PREFIXES]
    first = _FIRST_TAG.search(text)
    if not missing or first is None:
        return text
    slips.append("the undeclared prefix " + ", ".join(missing))
    return text[:first.end()] + "".join(' xmlns:{0}="{0}"'.format(prefix) for prefix in missing) + text[first.end():]


def root_tag(text):
    """Return the name of the first element of a text that may be no XML at all; None if there is none.

    Goes through what may stand before it, blanks, declarations, comments and a document type, once.
    """
    at = 0
    while True:
        at = _FILLED.match(text, at).end()
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


def _behind(text, mark, at):
    found = text.find(mark, at)
    return len(text) if found < 0 else found + len(mark)
