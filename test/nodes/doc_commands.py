# SPDX-License-Identifier: BSD-3-Clause
"""Checks that everything a documented command names exists: packages, programs, launch files, arguments, targets.

Nothing is run.  Words that only a run could check (topics, files that an earlier command makes) are ignored.
"""
import functools
import os
import re
import shlex
import shutil
import xml.etree.ElementTree as ElementTree

import roslaunch.config
import roslaunch.loader
import roslaunch.xmlloader
import roslib.packages
import rospkg

SHELL = {"cd", "export", "source", "echo", "test", "set", "true", "wait", "exit"}
#: Programs that the documents may name although a test machine need not have them.
ELSEWHERE = {"sudo", "apt", "catkin_make", "docker", "ffmpeg", "kubectl", "ssh"}
_SEPARATORS = {"|", "||", "&&", ";", "&"}


def commands_of(text):
    """Return the commands of a shell text, each a list of words; no comments, redirections and assignments."""
    found = []
    for line in re.sub(r"\\\n", " ", text).splitlines():
        reader = shlex.shlex(line, posix=True, punctuation_chars="|&;<>")
        reader.whitespace_split, reader.commenters = True, "#"
        words, skip = [], False
        for word in reader:
            if word in _SEPARATORS:
                found.append(words)
                words = []
            elif set(word) <= set("<>&"):
                skip = True
            elif skip:
                skip = False
            elif words or not re.match(r"^\w+=", word):
                words.append(word)
        found.append(words)
    return [words for words in found if words]


_rospack = functools.lru_cache(maxsize=None)(rospkg.RosPack)        # it reads all packages when first asked


@functools.lru_cache(maxsize=None)
def is_there(package, program):
    """Whether a package has a program; rospkg.ResourceNotFound if there is no such package."""
    return bool(roslib.packages.find_node(package, program, rospack=_rospack()))


@functools.lru_cache(maxsize=None)
def launch_file(package, name):
    """Return the path of a launch file of a package, or None."""
    try:
        top = _rospack().get_path(package)
    except rospkg.ResourceNotFound:
        return None
    for folder, _, files in os.walk(top):
        if name in files:
            return os.path.join(folder, name)
    return None


def arguments_of(path):
    """Return the arguments of a launch file that can be set: ``{argument: has a default}``."""
    return {tag.get("name"): tag.get("default") is not None for tag in ElementTree.parse(path).getroot().findall("arg")
            if tag.get("value") is None}


def _launch_problem(words, node_names):
    words = [word for word in words if not word.startswith("--")]
    if words and words[0].endswith((".launch", ".test")):
        return None                     # a file of the reader's own
    if len(words) < 2:
        return "expected a package and a launch file"
    path = launch_file(*words[:2])
    if path is None:
        return "package %s has no launch file %s" % tuple(words[:2])
    given = dict(word.split(":=", 1) for word in words[2:] if ":=" in word)
    declared = arguments_of(path)
    for name in given:
        if name not in declared:
            return "%s has no argument %s; it has %s" % (words[1], name, ", ".join(sorted(declared)))
    for name, optional in sorted(declared.items()):
        if not optional and name not in given and not node_names:
            return "%s needs the argument %s" % (words[1], name)
    return None


@functools.lru_cache(maxsize=None)
def _sources(root):
    """Text of all Python sources of the workspace's packages, one string."""
    paths = [os.path.join(folder, name) for top in ("src", "dropin") for folder, _, files in os.walk(
        os.path.join(root, top)) for name in files if name.endswith(".py")]
    texts = []
    for path in paths:
        with open(path, encoding="utf-8") as stream:
            texts.append(stream.read())
    return "\n".join(texts)


class Loader(roslaunch.xmlloader.XmlLoader):
    """Runs each command that gives a parameter, mostly xacro, once for all launch files."""

    _values = {}

    def param_value(self, verbose, name, ptype, value, textfile, binfile, command):
        """Return the value of a parameter."""
        known = (ptype, command)
        if command is None or known not in self._values:
            found = super().param_value(verbose, name, ptype, value, textfile, binfile, command)
            if command is None:
                return found
            self._values[known] = found
        return self._values[known]


@functools.lru_cache(maxsize=None)
def loading_problem(path, arguments):
    """Load a launch file with its arguments as roslaunch does, without starting anything.

    Parameters
    ----------
    path : str
    arguments : tuple of str
        As ``name:=value``.

    Returns
    -------
    str or None
        The error of roslaunch, or the node whose program does not exist.
    """
    config = roslaunch.config.ROSLaunchConfig()
    try:
        Loader().load(path, config, argv=list(arguments), verbose=False)
    except (roslaunch.xmlloader.XmlParseException, roslaunch.loader.LoadException, rospkg.ResourceNotFound) as error:
        return "%s: %s" % (os.path.basename(path), error)
    for node in config.nodes:
        try:
            found = is_there(node.package, node.type)
        except rospkg.ResourceNotFound:
            found = False
        if not found:
            return "%s starts %s of %s, which does not exist" % (os.path.basename(path), node.type, node.package)
    return None


def launches_of(text):
    """Return (path, arguments) of each launch line of a shell text that names a launch file of a package."""
    found = []
    for words in commands_of(text):
        if words[:3] == ["rosrun", "m2wr_sim", "experiment"]:
            words = words[2:]
            while len(words) > 1 and words[1].startswith("--"):
                del words[1:3]
        elif words[0] != "roslaunch":
            continue
        words = [word for word in words[1:] if not word.startswith("--")]
        path = launch_file(*words[:2]) if len(words) > 1 else None
        if path is not None:
            found.append((path, tuple(word for word in words[2:] if ":=" in word)))
    return found


def _options_problem(package, words, root):
    """Options that no source of this workspace mentions, of programs of this workspace."""
    top = os.path.realpath(_rospack().get_path(package))
    if not any(top.startswith(os.path.join(os.path.realpath(root), folder) + os.sep) for folder in ("src", "dropin")):
        return None
    for option in (word.split("=")[0] for word in words if re.match(r"--[a-z]", word)):
        if not re.search(r"[\"']%s[\"']" % option, _sources(root)):
            return "%s: no program has the option %s" % (package, option)
    return None


def _run_problem(words, root):
    words = words[1:] if words and words[0].startswith("--") else words
    if len(words) < 2:
        return "expected a package and a program"
    try:
        if not is_there(words[0], words[1]):
            return "package %s has no program %s" % tuple(words[:2])
    except (rospkg.ResourceNotFound, roslib.packages.ROSPkgException):
        return "there is no package %s" % words[0]
    if words[:2] == ["m2wr_sim", "experiment"]:
        rest = words[2:]
        while rest and rest[0].startswith("--"):
            rest = rest[2:]
        return _launch_problem(rest, False)
    return _options_problem(words[0], words[2:], root)


def _make_problem(words, root):
    with open(os.path.join(root, "Makefile"), encoding="utf-8") as stream:
        targets = set(re.findall(r"^([a-z-]+):", stream.read(), re.M))
    unknown = [word for word in words if "=" not in word and word not in targets]
    return "Makefile has no target %s" % unknown[0] if unknown else None


def problem_of(words, root):
    """Return what is wrong with one command, or None.

    Parameters
    ----------
    words : list of str
    root : str
        The workspace: relative names of programs and scripts start here.
    """
    name, rest = words[0], words[1:]
    if name in ("sudo", "time"):
        return problem_of(rest, root) if rest else "expected a command after %s" % name
    if name == "roslaunch":
        return _launch_problem(rest, "--ros-args" in rest or "--nodes" in rest)
    if name == "rosrun":
        return _run_problem(rest, root)
    if name == "make":
        return _make_problem(rest, root)
    if name == "source":
        return None if os.path.isfile(os.path.join(root, rest[0])) else "there is no file %s" % rest[0]
    if name in ("python3", "/usr/bin/python3") and rest[:1] == ["-m"]:
        return _module_problem(rest[1])
    if name in SHELL or name in ELSEWHERE or shutil.which(name) or os.access(os.path.join(root, name), os.X_OK):
        return None
    return "there is no program %s" % name


def _module_problem(name):
    from importlib.util import find_spec
    try:
        return None if find_spec(name) else "there is no Python module %s" % name
    except ImportError as error:
        return str(error)


def problems_of(text, root):
    """Return a list of the faults of a shell text, each with its command."""
    found = [(words, problem_of(words, root)) for words in commands_of(text)]
    return ["%s: %s" % (" ".join(words), problem) for words, problem in found if problem]
