# SPDX-License-Identifier: BSD-3-Clause
"""Code blocks of Markdown documents, and the comments before them that set how a test runs them.

A code block may have one line right before it::

    <!-- run: background until "/odom" -->

with one or more of these, separated by semicolons:

===========================  =========================================================================================
(no comment)                 ``bash``: run to the end, exit code 0; ``python``: must compile; others: no check
``to the end``               run to the end, exit code 0
``expect "TEXT"``            the output holds this text
``code N``                   the exit code is N
``until "TEXT"``             press Ctrl-C when the output holds the text; ``/name``: when that topic has a message;
                             ``service /name``: when there is that service; ``file GLOB``: when there is such a file
``background until "TEXT"``  start the next block when it does; the program is ended after the document
``alone``                    press Ctrl-C first in every terminal with a running program
``keys "TEXT"``              run in a terminal, and type this when ``until`` holds
``at most N s``              longer than the usual limit
``file NAME``                write the block into this file of the folder in which commands run
``picture GLOB as NAME``     the newest file of that name is what ``make gallery`` puts into docs/images as NAME
``only for the gallery``     only checked in tests, run by ``make gallery``
``only checked: WHY``        do not run; packages, programs, launch files and their arguments must exist
===========================  =========================================================================================
"""
import re
from dataclasses import dataclass, field
from typing import List, Optional, Tuple

OPENING = re.compile(r"^(```+)\s*([\w+-]*)\s*$")
COMMENT = re.compile(r"^<!-- run: (.*?) -->$")
WORD = re.compile(r"""
    (?P<to_the_end>to[ ]the[ ]end) |
    background[ ]until[ ]"(?P<background>[^"]+)" |
    until[ ]"(?P<until>[^"]+)" |
    expect[ ]"(?P<expect>[^"]+)" |
    keys[ ]"(?P<keys>[^"]+)" |
    code[ ](?P<code>\d+) |
    at[ ]most[ ](?P<limit>\d+)[ ]s |
    file[ ](?P<file>[\w.-]+) |
    picture[ ](?P<picture>[\w./*-]+[ ]as[ ][\w.-]+) |
    (?P<gallery>only[ ]for[ ]the[ ]gallery) |
    (?P<alone>alone)
    """, re.VERBOSE)
LIMIT = 300         # s of wall time a block may take; far above what is needed, because machines that test are slow


class DocumentError(ValueError):
    """A document that this module cannot interpret; names file and line."""


@dataclass
class How:
    """How a block is run; the fields have the names of the words in the comment."""

    checked: str = ""                   # why it is only checked
    until: Optional[str] = None
    background: bool = False
    expect: List[str] = field(default_factory=list)
    code: int = 0
    keys: str = ""
    limit: int = LIMIT
    file: str = ""
    alone: bool = False
    pictures: List[Tuple[str, str]] = field(default_factory=list)       # glob, name in docs/images
    gallery: bool = False


@dataclass
class Block:
    """One code block: where it begins, its language and text, and how it is run (None: no comment)."""

    path: str
    line: int
    language: str
    text: str
    how: Optional[How]

    @property
    def place(self):
        """File and line, for messages."""
        return "%s:%d" % (self.path, self.line)

    @property
    def runs(self):
        """Whether a test runs it."""
        if self.how is None:
            return self.language == "bash"
        return not self.how.checked and not self.how.file and not self.how.gallery


def read_comment(text, place):
    """Return the :class:`How` of the words of a comment; DocumentError for an unknown word."""
    how = How()
    if text.startswith("only checked: "):
        how.checked = text[len("only checked: "):].strip()
        return how
    for word in text.split(";"):
        match = WORD.fullmatch(word.strip())
        if match is None:
            raise DocumentError('%s: "%s" is no way to run a block; known are those in test/nodes/doc_blocks.py'
                                % (place, word.strip()))
        found = {name: value for name, value in match.groupdict().items() if value is not None}
        if "background" in found:
            how.background, how.until = True, found["background"]
        how.until = found.get("until", how.until)
        how.expect += [found["expect"]] if "expect" in found else []
        how.keys = found.get("keys", how.keys).replace("\\n", "\n").replace("\\x03", "\x03")
        how.code = int(found.get("code", how.code))
        how.limit = int(found.get("limit", how.limit))
        how.file = found.get("file", how.file)
        how.alone = how.alone or "alone" in found
        how.gallery = how.gallery or "gallery" in found
        how.pictures += [tuple(found["picture"].split(" as "))] if "picture" in found else []
    if how.keys and not how.until:
        raise DocumentError("%s: keys need a condition; add an until" % place)
    return how


def blocks_of(text, path):
    """Return the code blocks of a Markdown text, in order.

    Parameters
    ----------
    text : str
    path : str
        File of the text, for messages.

    Raises
    ------
    DocumentError
        If a block is not closed or names no language, or if a comment is not understood or not followed by a block.
    """
    blocks, lines, number = [], text.splitlines(), 0
    how, how_line = None, 0
    while number < len(lines):
        line, number = lines[number], number + 1
        comment, opening = COMMENT.match(line), OPENING.match(line)
        if how is not None and opening is None:
            raise DocumentError("%s:%d: a comment about running is not followed by a block" % (path, how_line))
        if comment:
            how, how_line = read_comment(comment.group(1), "%s:%d" % (path, number)), number
        elif line.startswith("<!-- run"):
            raise DocumentError("%s:%d: expected <!-- run: HOW -->, found %s" % (path, number, line))
        elif opening:
            if not opening.group(2):
                raise DocumentError("%s:%d: a block names no language; use text for plain text" % (path, number))
            start, body = number, []
            while number < len(lines) and lines[number].rstrip() != opening.group(1):
                body.append(lines[number])
                number += 1
            if number == len(lines):
                raise DocumentError("%s:%d: a block is not closed" % (path, start))
            number += 1
            blocks.append(Block(path, start, opening.group(2), "".join(part + "\n" for part in body), how))
            how = None
        elif line.startswith("```"):
            raise DocumentError("%s:%d: expected ``` and a language, found %s" % (path, number, line))
    if how is not None:
        raise DocumentError("%s:%d: a comment about running is not followed by a block" % (path, how_line))
    return blocks
