# SPDX-License-Identifier: BSD-3-Clause
"""Every Python file runs on Python 3.8 (Noetic on Ubuntu 20.04) and uses nothing removed in 3.11 or numpy 1.24.

The parser checks the syntax; a list of names covers library calls and run-time annotations, which the parser cannot
check. The list is not complete: it contains frequent cases.
"""
import ast
import os

import pytest

import workspace_tree as tree

FLOOR = (3, 8)

# dotted name -> why it must not be used
FORBIDDEN = {
    "functools.cache": "new in 3.9; functools.lru_cache(maxsize=None)",
    "math.lcm": "new in 3.9", "math.nextafter": "new in 3.9", "math.ulp": "new in 3.9", "math.cbrt": "new in 3.11",
    "math.exp2": "new in 3.11",
    "itertools.pairwise": "new in 3.10", "itertools.batched": "new in 3.12",
    "ast.unparse": "new in 3.9", "random.randbytes": "new in 3.9", "asyncio.to_thread": "new in 3.9",
    "importlib.resources.files": "new in 3.9", "sys.stdlib_module_names": "new in 3.10; use getattr",
    "sys.orig_argv": "new in 3.10", "enum.StrEnum": "new in 3.11", "inspect.get_annotations": "new in 3.10",
    "typing.Annotated": "new in 3.9", "typing.TypeAlias": "new in 3.10", "typing.ParamSpec": "new in 3.10",
    "typing.Self": "new in 3.11", "typing.TypeGuard": "new in 3.10", "typing.override": "new in 3.12",
    "contextlib.chdir": "new in 3.11", "contextlib.aclosing": "new in 3.10",
    "datetime.UTC": "new in 3.11", "time.clock": "removed in 3.8",
    "inspect.getargspec": "gone by 3.11", "collections.Sequence": "gone by 3.10; collections.abc",
    "collections.Mapping": "gone by 3.10; collections.abc", "collections.Iterable": "gone by 3.10; collections.abc",
    "collections.Callable": "gone by 3.10; collections.abc",
    "numpy.float": "gone in numpy 1.24", "numpy.int": "gone in numpy 1.24", "numpy.bool": "gone in numpy 1.24",
    "numpy.object": "gone in numpy 1.24", "numpy.str": "gone in numpy 1.24", "numpy.complex": "gone in numpy 1.24",
}
FORBIDDEN_MODULES = {"tomllib": "new in 3.11", "zoneinfo": "new in 3.9", "graphlib": "new in 3.9",
                     "distutils": "deprecated; setuptools", "imp": "deprecated; importlib", "nose": "gone on Debian 12"}
# method or function name -> keyword argument that is newer than Python 3.8
NEW_KEYWORDS = {"zip": {"strict"}, "dataclass": {"slots", "kw_only", "match_args"}, "field": {"kw_only"}}
NEW_METHODS = {"removeprefix": "str, new in 3.9", "removesuffix": "str, new in 3.9", "bit_count": "int, new in 3.10",
               "is_relative_to": "pathlib, new in 3.9", "with_stem": "pathlib, new in 3.9",
               "hardlink_to": "pathlib, new in 3.10", "iteritems": "dict, gone in 3", "has_key": "dict, gone in 3"}
GENERIC_SINCE_3_9 = {"list", "dict", "tuple", "set", "frozenset", "type"}


def python_files():
    """Python sources of the workspace: modules, scripts without extension, tools."""
    paths = [path for top in tree.PACKAGE_TOPS + ("tools",)
             for path in tree.files_below(os.path.join(tree.ROOT, top))]
    return [path for path in paths if tree.is_python(path)]


class _Newer(ast.NodeVisitor):
    """Collects (line, sentence) for each use of something outside 3.8 to 3.11."""

    def __init__(self, syntax):
        self.found = []
        self._names = {}
        self._lazy = any(isinstance(node, ast.ImportFrom) and node.module == "__future__"
                         and any(alias.name == "annotations" for alias in node.names) for node in ast.walk(syntax))
        self.visit(syntax)

    def _say(self, node, text):
        self.found.append((node.lineno, text))

    def visit_Import(self, node):
        for alias in node.names:
            self._names[alias.asname or alias.name.split(".")[0]] = alias.name if alias.asname else \
                alias.name.split(".")[0]
            self._check_module(node, alias.name)

    def visit_ImportFrom(self, node):
        module = node.module or ""
        if not node.level:
            self._check_module(node, module)
            for alias in node.names:
                full = "{}.{}".format(module, alias.name)
                self._names[alias.asname or alias.name] = full
                self._check_name(node, full)

    def _check_module(self, node, name):
        reason = FORBIDDEN_MODULES.get(name.split(".")[0])
        if reason:
            self._say(node, "module {}: {}".format(name, reason))

    def _check_name(self, node, full):
        if full in FORBIDDEN:
            self._say(node, "{}: {}".format(full, FORBIDDEN[full]))

    def visit_Attribute(self, node):
        if isinstance(node.value, ast.Name) and node.value.id in self._names:
            self._check_name(node, "{}.{}".format(self._names[node.value.id], node.attr))
        self.generic_visit(node)

    def visit_Call(self, node):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", None)
        if isinstance(node.func, ast.Attribute) and name in NEW_METHODS:
            self._say(node, ".{}(): {}".format(name, NEW_METHODS[name]))
        for keyword in node.keywords:
            if keyword.arg in NEW_KEYWORDS.get(name, ()):
                self._say(node, "{}({}=): newer than Python 3.8".format(name, keyword.arg))
        self.generic_visit(node)

    def visit_BinOp(self, node):
        if isinstance(node.op, ast.BitOr) and (isinstance(node.left, ast.Dict) or isinstance(node.right, ast.Dict)):
            self._say(node, "dict |: new in 3.9")
        self.generic_visit(node)

    def visit_Subscript(self, node):
        if isinstance(node.value, ast.Name) and node.value.id in GENERIC_SINCE_3_9:
            self._say(node, "{}[...]: new in 3.9 at run time; typing, or from __future__ import annotations".format(
                node.value.id))
        self.generic_visit(node)

    def _annotation(self, node):
        if node is None or self._lazy:
            return
        for part in ast.walk(node):
            if isinstance(part, ast.BinOp) and isinstance(part.op, ast.BitOr):
                self._say(part, "X | Y in an annotation: new in 3.10; typing, or from __future__ import annotations")
        self.visit(node)

    def visit_arg(self, node):
        self._annotation(node.annotation)

    def visit_AnnAssign(self, node):
        self._annotation(node.annotation)
        for part in (node.target, node.value):
            if part is not None:
                self.visit(part)

    def _function(self, node):
        self._annotation(node.returns)
        for part in node.decorator_list + [node.args] + node.body:
            self.visit(part)

    visit_FunctionDef = _function
    visit_AsyncFunctionDef = _function


def faults(text, name="<text>"):
    """(line, sentence) of everything in a source text that is outside the range 3.8 to 3.11; line-ordered."""
    try:
        syntax = ast.parse(text, filename=name, feature_version=FLOOR)
    except SyntaxError as error:
        return [(error.lineno, "not Python 3.8: {}".format(error.msg))]
    return sorted(set(_Newer(syntax).found))


FILES = python_files()


def test_there_are_files_to_check():
    names = {tree.relative(path) for path in FILES}
    assert {os.path.join("test", "unit", "test_python_floor.py"), os.path.join("tools", "test_summary.py")} <= names
    assert any(name.startswith("src" + os.sep) for name in names)
    assert any(not name.endswith(".py") for name in names), "no executable without extension was found"


@pytest.mark.parametrize("path", FILES, ids=[tree.relative(path) for path in FILES])
def test_file_runs_on_python_38(path):
    found = faults(tree.read(path), path)
    assert not found, "\n".join("{}:{}: {}".format(tree.relative(path), line, text) for line, text in found)


@pytest.mark.parametrize("text", [
    "match x:\n    case 1:\n        pass",
    "with (open('a') as a, open('b') as b):\n    pass",
    "def f(x: int | None):\n    pass",
    "def f() -> list[int]:\n    pass",
    "x: dict[str, int] = {}",
    "Row = tuple[int, int]",
    "from __future__ import annotations\nRow = list[int]",
    "'abc'.removeprefix('a')",
    "from functools import cache",
    "import functools\n@functools.cache\ndef f():\n    pass",
    "zip(a, b, strict=True)",
    "@dataclass(frozen=True, slots=True)\nclass A:\n    pass",
    "x = {'a': 1} | other",
    "import numpy as np\nx = np.float",
    "from collections import Sequence",
    "import tomllib",
    "from distutils.core import setup",
    "import math\nmath.nextafter(0, 1)",
])
def test_too_new_or_removed_names_are_found(text):
    assert faults(text)


@pytest.mark.parametrize("text", [
    "from __future__ import annotations\ndef f(x: int | None) -> list[int]:\n    pass",
    "from typing import List, Optional\ndef f(x: Optional[int]) -> List[int]:\n    pass",
    "import numpy as np\nx = np.float64(1) | 2",
    "if (n := 3) > 2:\n    print(f'{n=}')",
    "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass A:\n    x: int",
])
def test_features_of_38_pass(text):
    assert not faults(text)
