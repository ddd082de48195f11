# SPDX-License-Identifier: BSD-3-Clause
"""The documents: every block is understood, all that it names exists, links and pictures have a target."""
import os
import re
import sys

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "nodes"))
import doc_commands  # noqa: E402
from documents import ROOT, blocks, documents  # noqa: E402

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def text_of(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as stream:
        return stream.read()


def of_the_reader(arguments):
    """Whether an argument names a robot of the reader, which loading would expand."""
    return any(word.startswith("model:=") for word in arguments)


def anchors(text):
    """Return the anchors that the headings of a Markdown text make."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_page_below_docs_is_a_document():
    pages = {os.path.relpath(os.path.join(folder, name), ROOT)
             for folder, _, names in os.walk(os.path.join(ROOT, "docs")) for name in names if name.endswith(".md")}
    assert pages <= set(documents())


@pytest.mark.parametrize("path", documents())
def test_every_block_is_run_or_names_only_what_exists(path):
    problems = []
    for block in blocks(path):
        if block.language == "bash":
            problems += ["%s: %s" % (block.place, problem) for problem in doc_commands.problems_of(block.text, ROOT)]
            if not block.runs:      # then it is loaded at least
                problems += ["%s: %s" % (block.place, problem) for problem in (
                    doc_commands.loading_problem(path, arguments)
                    for path, arguments in doc_commands.launches_of(block.text) if not of_the_reader(arguments)
                ) if problem]
        elif block.language == "python":
            compile(block.text, block.place, "exec")
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("path", documents())
def test_commands_in_the_text_name_only_what_exists(path):
    text = re.sub(r"^```.*?^```", "", text_of(path), flags=re.M | re.S)
    commands = [command for command in re.findall(r"`((?:roslaunch|rosrun|make) [^`]+)`", text)
                if not command.split()[1].isupper()]
    problems = [problem for command in commands for problem in doc_commands.problems_of(command, ROOT)]
    assert not problems, "%s: %s" % (path, "\n".join(problems))


@pytest.mark.parametrize("path", documents())
def test_links_and_pictures_have_a_target(path):
    for target in LINK.findall(re.sub(r"^```.*?^```", "", text_of(path), flags=re.M | re.S)):
        if re.match(r"\w+:", target):
            continue
        name, _, anchor = target.partition("#")
        where = os.path.normpath(os.path.join(os.path.dirname(path), name)) if name else path
        assert os.path.exists(os.path.join(ROOT, where)), "%s: there is no %s" % (path, target)
        if anchor:
            assert anchor in anchors(text_of(where)), "%s: %s has no heading for #%s" % (path, where, anchor)


def test_every_picture_is_shown_and_small():
    shown = {os.path.normpath(os.path.join(os.path.dirname(path), target))
             for path in documents() for target in LINK.findall(text_of(path))}
    folder, total = os.path.join("docs", "images"), 0
    for name in sorted(os.listdir(os.path.join(ROOT, folder))):
        size = os.path.getsize(os.path.join(ROOT, folder, name))
        assert os.path.join(folder, name) in shown, "no document shows %s" % name
        assert size < (1500000 if name.endswith(".gif") else 200000), "%s has %d bytes" % (name, size)
        total += size
    assert total < 3000000
