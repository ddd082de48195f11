#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks that the files named on the command line state their licence, in line 1 or, after a ``#!`` line, in line 2.

tools/check_spdx.py FILE ...            print the files without the line; exit code 1 if there are any
tools/check_spdx.py --add FILE ...      add the line to them
"""
import argparse
import sys
from typing import List, Optional

LINE = "# SPDX-License-Identifier: BSD-3-Clause"


def place_of(lines: List[str]) -> int:
    """Return the index of the line that must state the licence."""
    return 1 if lines and lines[0].startswith("#!") else 0


def states_licence(text: str) -> bool:
    """Return whether a source text states the licence in the right line."""
    lines = text.split("\n")
    return lines[place_of(lines):][:1] == [LINE]


def with_licence(text: str) -> str:
    """Return a source text with the line added; the text itself where it is there."""
    if states_licence(text):
        return text
    lines = text.split("\n")
    lines.insert(place_of(lines), LINE)
    return "\n".join(lines)


def main(words: Optional[List[str]] = None) -> int:
    """Check or change the files; return the exit code."""
    parser = argparse.ArgumentParser(description="Check or add the licence line of source files.")
    parser.add_argument("--add", action="store_true", help="add the line where it is missing")
    parser.add_argument("files", nargs="+")
    options = parser.parse_args(words)
    missing = 0
    for path in options.files:
        with open(path, encoding="utf-8", newline="") as stream:
            text = stream.read()
        if not text or states_licence(text):
            continue
        if options.add:
            with open(path, "w", encoding="utf-8", newline="") as stream:
                stream.write(with_licence(text))
        else:
            print("%s: expected \"%s\" in line %d" % (path, LINE, place_of(text.split("\n")) + 1), file=sys.stderr)
            missing += 1
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
