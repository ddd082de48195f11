# SPDX-License-Identifier: BSD-3-Clause
"""The documents: every block is understood, all that it names exists, links and pictures have a target."""
import os
import re
import sys

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "nodes"))
import doc_commands  # noqa: E402
from documents import COURSE, GUIDES, ROOT, blocks, documents  # noqa: E402

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
README_WORDS = 900              # of a package: what it is, how to start, where to read on
SENTENCE, MEAN_SENTENCE = 40, 20        # words, in the pages of docs/


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


def sentences(text):
    """Return the sentences of a Markdown text, without code, tables and headings; inline code counts as one word."""
    text = re.sub(r"^(```+).*?^\1$|<!--.*?-->|^(?:#|\||!\[).*?$", "\n", text, flags=re.M | re.S)
    text = re.sub(r"^\s*(?:[*-]|\d+\.) ", "\n\n", text, flags=re.M)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "code", text))
    return [sentence for paragraph in re.split(r"\n\s*\n", text)
            for sentence in re.split(r"(?<=[.!?])[\"*)]*\s+(?=\S)", " ".join(paragraph.split())) if sentence]


def test_sentences_are_found():
    text = ("# Title\n\nOne `x = 1. Y` two. [Three](a.md)\nfour: five.\n\n"
            "```bash\nls. b\n```\n| a. b |\n* Six\n* seven\n")
    assert sentences(text) == ["One code two.", "Three four: five.", "Six", "seven"]


@pytest.mark.parametrize("path", documents(COURSE + GUIDES))
def test_sentences_of_a_page_are_short(path):
    lengths = {sentence: len(sentence.split()) for sentence in sentences(text_of(path))}
    long = ["%d words: %s" % (count, sentence) for sentence, count in lengths.items() if count > SENTENCE]
    assert not long, "%s: %s" % (path, "\n".join(long))
    assert sum(lengths.values()) <= MEAN_SENTENCE * len(lengths), path


@pytest.mark.parametrize("path", documents(("src/*/README.md", "dropin/*/README.md")))
def test_the_readme_of_a_package_is_short(path):
    words = len(text_of(path).split())
    assert words <= README_WORDS, "%s has %d words; details go to docs/" % (path, words)


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


def test_modules_named_in_the_architecture_exist():
    """A name without a folder is that of a file beside the one named before it; without a package, in m2wr_sim."""
    text = text_of("docs/explanation/architecture.md")
    rows, missing, count = re.findall(r"^\| (.+) \| (.+) \|$", text, re.M), [], 0
    for row in rows:
        folder = ""
        for name in re.findall(r"`([\w/]+(?:\.py|/))`", " ".join(row)):
            if name.startswith("test/"):
                continue
            package = name.split("/")[0]
            if os.path.isdir(os.path.join(ROOT, "src", package)):
                path = os.path.join("src", package, "src", name)
            else:
                beside = os.path.join(folder, name)
                path = beside if folder and os.path.exists(os.path.join(ROOT, beside)) else os.path.join(
                    "src/m2wr_sim/src/m2wr_sim", name)
            folder, count = os.path.dirname(path.rstrip("/")), count + 1
            if not os.path.exists(os.path.join(ROOT, path)):
                missing.append("%s: %s" % (name, path))
    assert count > 30 and not missing, missing
