#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks the sections of docstrings: a public function with two or more arguments has those of numpydoc that it needs.

tools/check_docstrings.py FOLDER ...     check all Python files below these folders

``Parameters`` names each argument. ``Returns`` or ``Yields`` is there unless the first line begins with "Return" or
"Yield" or the return type is None. ``Raises`` names each exception that the function itself raises by name. The form of
the sections is checked by ruff (rules D4xx). A method of a derived class may inherit the docstring of the base.
"""
import ast
import os
import re
import sys
from typing import Dict, Iterator, List, Set, Tuple

FEWEST = 2          # arguments, besides self and cls, from which on sections are needed


def sections(text: str) -> Dict[str, str]:
    """Return {title: text} of the numpydoc sections of a docstring."""
    parts = re.split(r"^([A-Z][\w ]+)\n-{3,}\n", text, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2]))


def arguments_of(function: ast.FunctionDef) -> List[str]:
    """Return the names of a function's arguments, without self and cls."""
    names = [one.arg for one in function.args.posonlyargs + function.args.args + function.args.kwonlyargs]
    return [name for name in names if name not in ("self", "cls")]


def raised_by(function: ast.FunctionDef) -> Set[str]:
    """Return the names of the exceptions that a function raises by name, without those of functions inside it."""
    found: Set[str] = set()
    todo: List[ast.AST] = list(function.body)
    while todo:
        node = todo.pop()
        if isinstance(node, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            continue
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            found.add(getattr(node.exc.func, "id", getattr(node.exc.func, "attr", "")))
        todo.extend(ast.iter_child_nodes(node))
    return found - {""}


def is_overload(function: ast.FunctionDef) -> bool:
    """Return whether a function is a signature of ``typing.overload``, which has no docstring."""
    return any(isinstance(one, ast.Name) and one.id == "overload" for one in function.decorator_list)


def public_functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    """Yield the functions and methods of a module that a user may call and that do not inherit their docstring."""
    derived = isinstance(tree, ast.ClassDef) and bool(tree.bases)
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not is_overload(node):
            if not derived or ast.get_docstring(node):
                yield node


def faults(text: str) -> Iterator[Tuple[int, str]]:
    """Yield (line, sentence) of each section that is missing or incomplete in a source text."""
    for function in public_functions(ast.parse(text)):
        names = arguments_of(function)
        if len(names) < FEWEST:
            continue
        text = ast.get_docstring(function) or ""
        found = sections(text)
        for name in names:
            if not re.search(r"^(?:\w+, )*%s\b" % re.escape(name), found.get("Parameters", ""), re.M):
                yield function.lineno, "%s: Parameters does not name %s" % (function.name, name)
        returned = function.returns
        nothing = (isinstance(returned, ast.Constant) and returned.value is None
                   or isinstance(returned, ast.Name) and returned.id == "NoReturn")
        if not nothing and not text.startswith(("Return", "Yield")) and not {"Returns", "Yields"} & set(found):
            yield function.lineno, "%s: neither Returns nor Yields" % function.name
        for name in sorted(raised_by(function)):
            if name not in found.get("Raises", ""):
                yield function.lineno, "%s: Raises does not name %s" % (function.name, name)


def main(folders: List[str]) -> int:
    """Check all Python files below some folders; return the exit code."""
    wrong = 0
    for top in folders:
        for where, _, names in os.walk(top):
            for path in sorted(os.path.join(where, name) for name in names if name.endswith(".py")):
                with open(path, encoding="utf-8") as stream:
                    for line, sentence in faults(stream.read()):
                        print("%s:%d: %s" % (path, line, sentence), file=sys.stderr)
                        wrong += 1
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
