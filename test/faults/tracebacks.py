# SPDX-License-Identifier: BSD-3-Clause
"""Finds unexpected tracebacks in the output of the programs of a run."""
import ast
import functools
import linecache
import os
import re
import sys
import sysconfig

import rosgraph

# a traceback: its frames and its last line
_TRACEBACK = re.compile(r"Traceback \(most recent call last\):\n((?:[ \t]+.*\n|\n)*)(.*)")
_CHAINED = re.compile(r"\n.*\n\n(?:During handling of the above exception, another exception occurred"
                      r"|The above exception was the direct cause of the following exception):\n\n"
                      r"Traceback \(most recent call last\):\n")
_FRAME = re.compile(r'^\s*File "(/[^"]*)", line (\d+)', re.MULTILINE)         # not of <frozen modules>, nor of Cython's
_STACK = re.compile(r"^Stack \(most recent call first\):\n((?:  File .*\n?)*)", re.MULTILINE)
_LOST = re.compile(r"^Exception ignored in: .*\n(?:.*\n)*?KeyboardInterrupt", re.MULTILINE)
_FIRST_IMPORT = "m2wr_node.interrupts"       # of every program; from then on it handles Ctrl-C
_HERE = os.path.dirname(os.path.realpath(__file__))
_ROOT = os.path.dirname(os.path.dirname(_HERE)) + os.sep


def _spaces():
    return tuple(os.path.realpath(path) + os.sep
                 for path in os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep) if path)


@functools.lru_cache(maxsize=None)
def _libraries():
    folders = [path for path in map(os.path.realpath, sys.path)
               if os.path.basename(path) in ("site-packages", "dist-packages") and not path.startswith(_spaces())]
    folders += [sysconfig.get_path("stdlib"), os.path.dirname(os.path.dirname(rosgraph.__file__)),
                os.path.join(_HERE, "site")]
    return tuple(os.path.realpath(path) + os.sep for path in folders)


def _is_ours(name):
    name = os.path.realpath(name)
    return name.startswith((_ROOT,) + _spaces()) and not name.startswith(_libraries())


def _places(frames):
    return [(name, int(line)) for name, line in _FRAME.findall(frames)]


def foreign_tracebacks(text, program=None):
    """Return the unexpected tracebacks in a text (list of str).

    Ctrl-C in Python raises KeyboardInterrupt at any place in a program.  Programs of this workspace handle it from
    their first import on; before that, Python prints a traceback.  So does roslaunch while it loads its files, and so
    do the programs outside this workspace that it runs for a parameter; their tracebacks contain no line of the
    workspace.

    Parameters
    ----------
    text : str
        The stderr of one program; or, without ``program``, the common stderr of programs before they had a file of
        their own (``site/sitecustomize.py``): there Python itself was starting, and no line may be ours.
    program : str, optional
        Path of the program.
    """
    if program is None:
        return [name for name, _ in _places(text) if _is_ours(name)]
    found = []
    for frames, last in _TRACEBACK.findall(_CHAINED.sub("\n", text)):
        ours = [place for place in _places(frames) if _is_ours(place[0])]
        if not _is_ours(program) and not ours:
            continue
        if _is_ours(program) and last == "KeyboardInterrupt" and all(
                _imports_first(place) or place[0].startswith(_spaces()) and _is_relay(place[0]) for place in ours):
            continue
        found.append(frames + last)
    return found


def _imports_first(place):
    """Whether a line of a file is a program's first import."""
    return _FIRST_IMPORT in linecache.getline(*place)


def _is_relay(name):
    """Whether a file was made by catkin, to run or import the one of this name in a package's sources."""
    with open(name, encoding="utf-8") as stream:
        return "generated from catkin/" in stream.read(2000)


def interrupts_lost(text):
    """Return how many interrupts roslaunch has lost, according to its stderr (with ``site/sitecustomize.py``).

    Until it starts its first node it has no handler, and KeyboardInterrupt is lost in a bare ``except`` or in a
    callback of the interpreter.  roslaunch 1.15 has such clauses round the import of rosmaster (``config.py``), the
    set-up of its log (``__init__.py``), the question for the run id and the check of the log folder (``rlutil.py``,
    which says "Press Ctrl-C to interrupt"); the libraries that it imports have others.
    """
    stacks = [any(not _is_ours(name) and _catches_all(name, line) for name, line in _places(frames))
              for frames in _STACK.findall(text)]
    return sum(stacks) + len(_LOST.findall(text))


@functools.lru_cache(maxsize=None)
def _catches_all(name, line):
    """Whether a line of a file is in a ``try`` that catches KeyboardInterrupt and does not raise it again."""
    try:
        with open(name, encoding="utf-8") as stream:
            tree = ast.parse(stream.read())
    except (OSError, SyntaxError, UnicodeDecodeError):
        return False
    return any(isinstance(node, ast.Try) and node.body[0].lineno <= line <= _last_line(node.body[-1])
               and any(map(_swallows, node.handlers)) for node in ast.walk(tree))


def _swallows(handler):
    caught = handler.type is None or getattr(handler.type, "id", "") in ("BaseException", "KeyboardInterrupt")
    return caught and not any(isinstance(node, ast.Raise) for node in ast.walk(handler))


def _last_line(node):
    return max(getattr(inner, "lineno", 0) for inner in ast.walk(node))
