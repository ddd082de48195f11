# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions of launch files: ``$(find X)``, ``$(arg X)``, ``$(eval ...)`` and the others, without executing code.

roslaunch hands ``$(eval ...)`` to Python.  Here only constants, names, comparisons, ``and``/``or``/``not``, ``+ - * /
%``, indices, ``... if ... else ...``, and calls of the substitutions themselves and of a few conversions are
evaluated, and short loops over lists; anything else is not known.
"""
from __future__ import annotations

import ast
import operator
import os
import re
from typing import Any, Callable, Dict, Mapping, Optional, Set

LONGEST = 20000             # characters of a value
MOST_TURNS = 100            # of a loop in an expression
_WORDS = re.compile(r"\$\(([^()]*)\)")
_EVAL = re.compile(r"\$\(eval\s+(.*)\)\Z", re.DOTALL)
_TRUE, _FALSE = ("true", "1"), ("false", "0")
_MISSING = "/package not found/"        # the folder of a package that is not found
NOT_KNOWN = "\0"                        # value of an argument that could not be evaluated; reported there
_ANY: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Mod: operator.mod, ast.FloorDiv: operator.floordiv, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.In: lambda left, right: left in right, ast.NotIn: lambda left, right: left not in right,
    ast.Is: operator.is_, ast.IsNot: operator.is_not}
_METHODS = ("startswith", "endswith", "replace", "split", "strip", "lstrip", "rstrip", "lower", "upper", "find",
            "rpartition", "partition", "rsplit")       # of texts; none makes one much longer, see _short
_CONVERSIONS: Dict[str, Callable[..., Any]] = {"float": float, "int": int, "str": str, "bool": bool, "abs": abs,
                                               "round": round, "min": min, "max": max, "len": len,
                                               "any": any, "all": all, "sum": sum, "sorted": sorted}
_NAMES = {"true": True, "false": False, "True": True, "False": False, "None": None}


class Unknown(Exception):
    """A text whose value is not known before the start; the message says why."""


class Doubtful(Unknown):
    """It depends on an argument that was reported before."""


class Words:
    """Resolves the substitutions of one launch file.

    Parameters
    ----------
    find : callable
        Package name -> its folder, or None.
    environ : mapping of str to str
        Environment variables.
    path : str
        Of the launch file, for ``$(dirname)``.

    Attributes
    ----------
    arguments : dict of str to (str or None)
        Values of ``$(arg X)``; None: not known.
    missing : set of str
        Packages of ``$(find X)`` that were not found.
    unset : set of str
        Arguments and environment variables that were used but have no value.
    path : str
        The launch file.
    """

    def __init__(self, find: Callable[[str], Optional[str]], environ: Mapping[str, str], path: str) -> None:
        self._find, self._environ, self.path = find, environ, path
        self._local: Dict[str, Any] = {}            # variables of the comprehensions around an expression
        self.arguments: Dict[str, Optional[str]] = {}
        self.missing: Set[str] = set()
        self.unset: Set[str] = set()

    def resolve(self, text: str) -> str:
        """Return a text with its substitutions replaced; Unknown if one has no value."""
        evaluated = _EVAL.match(text.strip())
        if evaluated:
            return str(self._evaluate(evaluated.group(1)))
        result = _WORDS.sub(lambda match: self._word(match.group(1)), text)
        if len(result) > LONGEST:
            raise Unknown("longer than %d characters" % LONGEST)
        return result

    def condition(self, text: str) -> Optional[bool]:
        """Return the value of ``if`` or ``unless``; None if it is not known."""
        try:
            value = self.resolve(text).strip().lower()
        except Unknown:
            return None
        return True if value in _TRUE else False if value in _FALSE else None

    def _word(self, words: str) -> str:
        command, _, rest = words.strip().partition(" ")
        names = rest.split()
        if command == "find" and len(names) == 1:
            return self._folder(names[0])
        if command == "arg" and len(names) == 1:
            return self._argument(names[0])
        if command == "env" and len(names) == 1:
            return self._variable(names[0], None)
        if command == "optenv" and names:
            return self._variable(names[0], " ".join(names[1:]))
        if command == "dirname":
            return self._dirname()
        if command == "anon" and names:
            return "%s_anonymous" % names[0]
        raise Unknown("$(%s) is no substitution of roslaunch" % words[:60])

    def _folder(self, package: str) -> str:
        folder = self._find(package)
        if folder is None:
            self.missing.add(package)
            return _MISSING + package
        return folder

    def _argument(self, name: str) -> str:
        value = self.arguments.get(name)
        if value == NOT_KNOWN:
            raise Doubtful("the argument %s is not known" % name)
        if value is None:
            self.unset.add("argument %s" % name)
            raise Unknown("the argument %s has no value" % name)
        return value

    def _variable(self, name: str, default: Optional[str]) -> str:
        value = self._environ.get(name, default)
        if value is None:
            self.unset.add("environment variable %s" % name)
            raise Unknown("the environment variable %s is not set" % name)
        return value

    def _dirname(self) -> str:
        return os.path.dirname(os.path.abspath(self.path))

    def _evaluate(self, expression: str) -> Any:
        try:
            tree = ast.parse(expression.strip(), mode="eval")
            return self._value(tree.body)
        except Unknown:
            raise
        except (SyntaxError, ValueError, TypeError, AttributeError, ArithmeticError, LookupError, RecursionError,
                MemoryError) as error:
            raise Unknown("$(eval %s): %s" % (expression[:60], error)) from None

    def _value(self, node: Any) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name):
            if node.id in self._local:
                return self._local[node.id]
            return _NAMES[node.id] if node.id in _NAMES else _guess(self._argument(node.id))
        if isinstance(node, ast.BoolOp):
            stop = isinstance(node.op, ast.Or)
            result: Any = not stop
            for part in node.values:
                result = self._value(part)
                if bool(result) == stop:
                    break
            return result
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
            inner = self._value(node.operand)
            return not inner if isinstance(node.op, ast.Not) else -inner
        if isinstance(node, ast.BinOp) and type(node.op) in _ANY:
            return _short(_ANY[type(node.op)](*_factors(node.op, self._value(node.left), self._value(node.right))))
        if isinstance(node, ast.Compare) and all(type(op) in _ANY for op in node.ops):
            left = self._value(node.left)
            for op, other in zip(node.ops, node.comparators):
                right = self._value(other)
                if not _ANY[type(op)](left, right):
                    return False
                left = right
            return True
        if isinstance(node, ast.IfExp):
            return self._value(node.body if self._value(node.test) else node.orelse)
        if isinstance(node, (ast.List, ast.Tuple)):
            return [self._value(part) for part in node.elts]
        if isinstance(node, ast.Dict) and None not in node.keys:
            return {self._value(key): self._value(value) for key, value in zip(node.keys, node.values)}
        if isinstance(node, (ast.GeneratorExp, ast.ListComp)) and len(node.generators) == 1:
            return self._each(node)
        if isinstance(node, ast.Call) and not node.keywords:
            values = [self._value(part) for part in node.args]
            if isinstance(node.func, ast.Name):
                return self._call(node.func.id, values)
            if isinstance(node.func, ast.Attribute):
                return _method(self._value(node.func.value), node.func.attr, values)
        if isinstance(node, ast.Subscript):
            return self._part(self._value(node.value), node.slice)
        raise Unknown("$(eval ...) holds what the doctor does not evaluate: %s" % type(node).__name__)

    def _each(self, node: Any) -> Any:
        loop, outer = node.generators[0], dict(self._local)
        if not isinstance(loop.target, ast.Name):
            raise Unknown("$(eval ...) unpacks in a loop, which the doctor does not evaluate")
        found = []
        for value in list(_short(self._value(loop.iter)))[:MOST_TURNS]:
            self._local[loop.target.id] = value
            if all(self._value(test) for test in loop.ifs):
                found.append(self._value(node.elt))
        self._local = outer
        return found

    def _part(self, whole: Any, place: Any) -> Any:
        if type(place).__name__ == "Index":         # until Python 3.8
            place = place.value
        if isinstance(place, ast.Slice):
            return whole[slice(*(None if part is None else self._value(part)
                                 for part in (place.lower, place.upper, place.step)))]
        return whole[self._value(place)]

    def _call(self, name: str, values: Any) -> Any:
        if name == "arg" and len(values) == 1:
            return _guess(self._argument(str(values[0])))
        if name == "find" and len(values) == 1:
            return self._folder(str(values[0]))
        if name == "env" and len(values) == 1:
            return self._variable(str(values[0]), None)
        if name == "optenv" and len(values) in (1, 2):
            return self._variable(str(values[0]), str(values[1]) if len(values) == 2 else "")
        if name == "dirname":
            return self._dirname()
        if name == "anon" and len(values) == 1:
            return "%s_anonymous" % values[0]
        if name in _CONVERSIONS:
            return _short(_CONVERSIONS[name](*values))
        raise Unknown("$(eval ...) calls %s, which the doctor does not evaluate" % name)


def not_found(path: str) -> bool:
    """Return whether a path lies in a package that was not found, which is reported by itself."""
    return _MISSING in path


def _guess(text: str) -> Any:
    """Return the value that roslaunch gives an argument in an expression: a number or truth value if it looks so."""
    lower = text.strip().lower()
    if lower in ("true", "false"):
        return lower == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _method(text: Any, name: str, values: Any) -> Any:
    if name == "join" and isinstance(text, str):
        return _short(text.join(values[0]))
    if name == "get" and isinstance(text, dict):
        return text.get(*values)
    if not isinstance(text, str) or name not in _METHODS:
        raise Unknown("$(eval ...) calls .%s, which the doctor does not evaluate" % name)
    if name == "replace" and len(text) * len(values[1]) > LONGEST:
        raise Unknown("$(eval ...): a value is too large")
    return _short(getattr(text, name)(*values))


def _factors(op: Any, left: Any, right: Any) -> Any:
    """Return both operands; refuse a product or a format that could become large."""
    if isinstance(op, (ast.Mult, ast.Mod)) and not all(isinstance(value, (int, float)) for value in (left, right)):
        raise Unknown("$(eval ...): * and % only between numbers")
    return left, right


def _short(value: Any) -> Any:
    if isinstance(value, (str, list)) and len(value) > LONGEST or isinstance(value, int) and abs(value) > 1 << 64:
        raise Unknown("$(eval ...): a value is too large")
    return value
