# SPDX-License-Identifier: BSD-3-Clause
"""tools/check_docstrings.py: which docstrings it reports."""
import importlib.util
import os

import pytest

import workspace_tree as tree

_SPEC = importlib.util.spec_from_file_location(
    "check_docstrings", os.path.join(tree.ROOT, "tools", "check_docstrings.py"))
check_docstrings = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(check_docstrings)

PARAMETERS = "\n\n    Parameters\n    ----------\n    a, b : int\n    "
RAISES = PARAMETERS + "\n    Raises\n    ------\n    ValueError\n    "


def sentences(head, docstring, body="pass"):
    """Return what is reported of one function."""
    text = "%s:\n    \"\"\"%s\"\"\"\n    %s\n" % (head, docstring, body)
    return [sentence for _, sentence in check_docstrings.faults(text)]


@pytest.mark.parametrize("head, docstring, body", [
    ("def one(a)", "Do.", "return a"),
    ("def _private(a, b)", "Do.", "return a"),
    ("def f(a, b)", "Return a." + PARAMETERS, "return a"),
    ("def f(a, b) -> None", "Do." + PARAMETERS, "pass"),
    ("def f(a, b) -> None", "Do." + RAISES, "raise ValueError('a')")])
def test_complete_docstring_passes(head, docstring, body):
    assert sentences(head, docstring, body) == []


def test_overload_needs_no_docstring():
    assert not list(check_docstrings.faults("@overload\ndef f(a: int, b: int) -> int: ...\n"))


def test_override_without_docstring_inherits_it():
    text = "class C%s:\n    def f(self, a, b):%s\n        pass\n"
    assert not list(check_docstrings.faults(text % ("(Base)", "")))
    assert list(check_docstrings.faults(text % ("", "")))
    assert list(check_docstrings.faults(text % ("(Base)", "\n        \"\"\"Do.\"\"\"")))


@pytest.mark.parametrize("head, docstring, body, words", [
    ("def f(a, b) -> None", "Do.", "pass", "Parameters does not name a"),
    ("def f(a, b, c) -> None", "Do." + PARAMETERS, "pass", "Parameters does not name c"),
    ("def f(a, b)", "Do." + PARAMETERS, "return a", "neither Returns nor Yields"),
    ("def f(a, b) -> None", "Do." + PARAMETERS, "raise ValueError('a')", "Raises does not name ValueError")])
def test_missing_section_is_reported(head, docstring, body, words):
    assert any(words in sentence for sentence in sentences(head, docstring, body))
