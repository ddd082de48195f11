# SPDX-License-Identifier: BSD-3-Clause
"""Words that the glossary in CONTRIBUTING.md rules out are used nowhere."""
import os
import re

import pytest

import workspace_tree as tree

GLOSSARY = "CONTRIBUTING.md"
SUFFIXES = (".c", ".cfg", ".cmake", ".launch", ".md", ".msg", ".py", ".rst", ".rviz", ".sh", ".srv", ".test", ".txt",
            ".xacro", ".xml", ".yaml", ".yml", "Makefile", "")
TOPS = ("src", "dropin", "test", "tools", "docs", ".ci")
#: Not looked at: inputs as others have written them.
INPUTS = ("test/data", "test/fuzz/corpus")
#: Parts of interfaces, which stay: a key of /diagnostics, also in recorded bags, a value of ~lockstep_on_silence, and a
#: name in state files of the mapper.
INTERFACES = re.compile(r"touches of\b|\bgo_on\b|\"hindsight\"|_tracker[.]hindsight\b"
                        r"|``(?:RunLog[.])?(?:touches|Touch|touch_count|drain_touches)``")     # in changelogs
#: Characters of a test's name, at most.
LONGEST_NAME = 60


def glossary():
    """Return {word that is ruled out: what to write}."""
    text = tree.read(os.path.join(tree.ROOT, GLOSSARY)).split("## Glossary")[1].split("\n## ")[0]
    found = {}
    for row in re.findall(r"^\| (.+) \| .+ \| (.+) \|$", text, re.M)[1:]:
        for word in row[1].split(","):
            found[word.strip()] = row[0]
    return found


RULED_OUT = glossary()


def pattern(words):
    """Return a regular expression that finds words, in names such as ``crowd_size`` and ``CrowdSize`` too."""
    either = "|".join(r"[\s_]+".join(map(re.escape, word.split())) for word in sorted(words, key=len, reverse=True))
    camel = "|".join("".join(part.capitalize() for part in word.split()) for word in words)
    return re.compile(r"(?<![A-Za-z])(?i:%s)(?![a-z])|(?<=[a-z])(?:%s)(?![a-z])" % (either, camel))


PATTERN = pattern(RULED_OUT)


def texts():
    """Yield (path below the root) of every source and document of the project."""
    for top in TOPS:
        for path in tree.files_below(os.path.join(tree.ROOT, top)):
            if path.endswith(SUFFIXES[:-1]) or not os.path.splitext(path)[1]:
                yield tree.relative(path)
    for name in sorted(os.listdir(tree.ROOT)):
        if name.endswith((".md", "Makefile", ".txt", ".cfg")) and name != GLOSSARY:
            yield name


def is_below(path, folders):
    """Whether a path is one of these, or lies in one of these folders."""
    return any(path == folder or path.startswith(folder + "/") for folder in folders)


PATHS = [path for path in texts()
         if not is_below(path, INPUTS) and path != tree.relative(os.path.abspath(__file__))]


def uses(path, text):
    """Return "path:line: word; write ..." of each word in a text that is ruled out, its name included."""
    found = []
    for number, line in enumerate([os.path.basename(path)] + text.splitlines()):
        for match in PATTERN.finditer(INTERFACES.sub("", line)):
            word = re.sub(r"[\s_]+", " ", match.group(0)).lower()
            found.append("%s:%d: %r; write %r" % (path, number, match.group(0),
                                                  RULED_OUT.get(word, "see the glossary")))
    return found


def test_the_glossary_is_read():
    assert len(RULED_OUT) > 30 and RULED_OUT["crowd"].startswith("many robots")


@pytest.mark.parametrize("text", ["a crowd of robots", "CROWDED = 3", "def crowd_size():", "class CrowdSize:",
                                  "class ManyCrowds:", "time stands\tstill", "stands_still"])
def test_a_word_is_found(text):
    assert uses("file.py", text)


@pytest.mark.parametrize("text", ["a touchscreen", "fenced code", "rooms", "bystander"])
def test_another_word_is_not(text):
    assert not uses("file.py", text)


def test_files_are_found():
    assert len(PATHS) > 400 and any(path.startswith("src/m2wr_sim/nodes/") for path in PATHS)


@pytest.mark.parametrize("top", sorted({path.split("/")[0] for path in PATHS}))
def test_no_such_word_is_used(top):
    found = [use for path in PATHS if path.split("/")[0] == top
             for use in uses(path, tree.read(os.path.join(tree.ROOT, path)))]
    assert not found, "\n".join(found[:60])


def test_names_of_tests_are_short():
    long = ["%s: %s" % (path, name) for path in PATHS if path.endswith(".py")
            for name in re.findall(r"^ *def (test_\w+)", tree.read(os.path.join(tree.ROOT, path)), re.M)
            if len(name) > LONGEST_NAME]
    assert not long, "longer than %d characters: %s" % (LONGEST_NAME, "\n".join(long))
