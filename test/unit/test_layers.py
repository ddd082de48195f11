# SPDX-License-Identifier: BSD-3-Clause
"""Every module imports only what its layer may: kernels only arrays, ROS only at the edges, one importer of ODE.

A layer is the folder of a module below its package's Python root, or a name pattern. The table below is the rule;
a folder without a row fails too, so a new layer declares its imports.
"""
import ast
import fnmatch
import importlib.util
import os
import sys
import sysconfig
from collections import namedtuple

import pytest

import workspace_tree as tree

Rule = namedtuple("Rule", "pattern third_party messages deterministic not_ours")

NUMERIC = {"numpy", "numba", "scipy"}
XML = {"lxml", "urdf_parser_py", "xacro", "yaml"}
SHAPES = {"PIL", "collada", "trimesh"}      # mesh files and pictures with heights
ANYTHING = None

# First match wins. third_party: importable besides the standard library (ANYTHING: no limit). messages: *_msgs and
# genpy allowed. deterministic: no wall clock, no unseeded randomness. not_ours: our own forbidden modules.
EDGES = ("m2wr_sim.ros", "m2wr_sim.plugins")
ABOVE_LOCKSTEP = ("m2wr_[!ln]*", "motion_plan")
ABOVE_MAPS = ("m2wr_[!fmn]*", "m2wr_navigation", "motion_plan")
LOCKSTEP_EDGES = ("m2wr_lockstep.server.ros", "m2wr_lockstep.client.controller")
RULES = (
    Rule("*/*kernels.py", {"numpy", "numba"}, False, True, ("*",)),
    Rule("m2wr_sim/physics/*.py", NUMERIC | {"llvmlite", "ode"}, False, True, EDGES),
    Rule("m2wr_sim/model/*.py", NUMERIC | {"lxml"}, False, True, EDGES),
    Rule("m2wr_sim/model/urdf/*.py", NUMERIC | XML, False, True, EDGES),
    Rule("m2wr_sim/model/sdf/*.py", NUMERIC | XML, False, True, EDGES + ("m2wr_sim.model.urdf",)),
    Rule("m2wr_sim/model/mesh/*.py", NUMERIC | SHAPES | {"lxml"}, False, True,
         EDGES + ("m2wr_sim.model.urdf", "m2wr_sim.model.sdf")),
    Rule("m2wr_sim/model/xml/*.py", {"lxml"}, False, True,
         EDGES + ("m2wr_sim.model.urdf", "m2wr_sim.model.sdf", "m2wr_sim.model.mesh")),
    Rule("m2wr_sim/sensors/*.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_sim/rendering/*.py", NUMERIC, False, True, EDGES + ("m2wr_sim.runtime", "m2wr_sim.physics")),
    Rule("m2wr_sim/control/*.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_sim/ros_control/*.py", NUMERIC, False, True, ("m2wr_sim.ros",)),
    Rule("m2wr_sim/ros_control/controllers/*.py", NUMERIC, False, True, ("m2wr_sim.ros",)),
    Rule("m2wr_sim/runtime/*.py", NUMERIC, False, True, ("m2wr_sim.ros",)),
    Rule("m2wr_sim/plugins/*.py", NUMERIC, True, True, ("m2wr_sim.ros",)),
    Rule("m2wr_sim/api/*.py", NUMERIC | {"gymnasium", "rospkg"}, False, True,
         ("m2wr_sim.ros", "motion_plan")),
    Rule("m2wr_sim/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_sim/ros/gazebo_services/*.py", ANYTHING, True, False, ("m2wr_sim.ros.node",)),
    Rule("m2wr_sim/messages.py", set(), True, True, EDGES),
    Rule("m2wr_sim/control_messages.py", set(), True, True, EDGES),
    Rule("m2wr_sim/*.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_tools/map_figure/*.py", NUMERIC | {"matplotlib"}, False, True, ("m2wr_gmapping.ros",)),
    Rule("m2wr_tools/map_comparison/agreement.py", NUMERIC | {"PIL"}, False, True, EDGES),
    Rule("m2wr_tools/obstacles/obstacle.py", set(), False, True, EDGES),
    Rule("m2wr_tools/robots/free_places.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_tools/runs/summary.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_tools/runs/bag_report.py", NUMERIC, False, True, EDGES),
    Rule("m2wr_tools/bug2_runner.py", NUMERIC, False, True,
         ("m2wr_sim.ros", "motion_plan.ros*", "motion_plan.*_nodes")),
    Rule("m2wr_tools/best_path_runner.py", NUMERIC, False, True, ("m2wr_sim.ros", "m2wr_navigation.ros")),
    Rule("m2wr_tools/*/*.py", ANYTHING, True, False, ()),                 # commands, nodes, measurements of time
    Rule("m2wr_tools/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_node/ros/*.py", ANYTHING, True, False, ("m2wr_[!n]*", "motion_plan")),
    Rule("m2wr_node/kernel*.py", {"numba", "numpy"}, False, True, ("m2wr_node.ros", "m2wr_[!n]*", "motion_plan")),
    Rule("m2wr_node/array_types.py", {"numpy"}, False, True, ("m2wr_*", "motion_plan")),
    Rule("m2wr_node/*.py", set(), False, True, ("m2wr_node.ros", "m2wr_[!n]*", "motion_plan")),  # the foundation
    Rule("m2wr_node/internals/*.py", ANYTHING, True, False, ("m2wr_node.ros", "m2wr_[!n]*", "motion_plan")),
    Rule("m2wr_maps/ros/*.py", ANYTHING, True, False, ABOVE_MAPS),
    Rule("m2wr_maps/*.py", {"numpy", "PIL", "yaml"}, False, True, ABOVE_MAPS + ("m2wr_maps.ros",)),
    Rule("m2wr_files/*.py", {"numpy"}, False, True, ("m2wr_[!f]*", "motion_plan")),
    Rule("m2wr_nodelet/*.py", ANYTHING, True, False, ("m2wr_[!n]*", "motion_plan")),
    Rule("m2wr_lockstep/server/ros/*.py", ANYTHING, True, False, ABOVE_LOCKSTEP),
    Rule("m2wr_lockstep/client/controller.py", ANYTHING, True, False, ABOVE_LOCKSTEP),
    Rule("m2wr_lockstep/controller.py", set(), False, False, ABOVE_LOCKSTEP),             # its public name
    Rule("m2wr_lockstep/*/*.py", set(), False, False, ABOVE_LOCKSTEP + LOCKSTEP_EDGES),   # waits in wall time
    Rule("m2wr_lockstep/*.py", set(), False, False, ABOVE_LOCKSTEP + LOCKSTEP_EDGES),
    Rule("m2wr_course/*.py", NUMERIC | {"lxml", "PIL", "yaml"}, False, True, EDGES),
    Rule("m2wr_bridge/messages/*.py", {"cbor2"}, True, True,
         ("m2wr_bridge.ros", "m2wr_bridge.web", "m2wr_bridge.rosbridge", "m2wr_bridge.foxglove")),
    Rule("m2wr_bridge/web/*.py", {"websockets"}, False, False,                    # limits and pauses in wall time
         ("m2wr_bridge.ros", "m2wr_bridge.rosbridge", "m2wr_bridge.foxglove")),
    Rule("m2wr_bridge/rosbridge/*.py", {"cbor2", "msgspec", "PIL"}, False, True,
         ("m2wr_bridge.ros", "m2wr_bridge.foxglove")),
    Rule("m2wr_bridge/foxglove/*.py", {"msgspec"}, False, True, ("m2wr_bridge.ros",)),
    Rule("m2wr_bridge/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_bridge/*.py", set(), False, True, ("m2wr_bridge.*",)),
    Rule("m2wr_campaign/faults/*.py", {"numpy"}, False, True, tuple(
        "m2wr_campaign." + layer for layer in ("grading", "programs", "report", "runner", "store", "study", "worlds"))),
    Rule("m2wr_campaign/study/*.py", {"numpy", "yaml"}, False, True, ("m2wr_campaign.store", "m2wr_campaign.runner")),
    Rule("m2wr_campaign/terrain/*.py", {"numpy", "PIL"}, False, True, tuple(
        "m2wr_campaign." + layer for layer in ("grading", "programs", "report", "runner", "store", "study", "worlds"))),
    Rule("m2wr_campaign/rough/*.py", {"numpy", "matplotlib"}, False, True, tuple(
        "m2wr_campaign." + layer for layer in ("grading", "programs", "report", "runner", "store", "study", "worlds"))),
    Rule("m2wr_campaign/ros/*.py", {"numpy", "rospy"}, True, False, ()),
    Rule("m2wr_campaign/worlds/*.py", NUMERIC, False, True,
         ("m2wr_campaign.study", "m2wr_campaign.store", "m2wr_campaign.runner")),
    Rule("m2wr_campaign/store/*.py", {"numpy", "pyarrow"}, False, True, ("m2wr_campaign.runner",)),
    Rule("m2wr_campaign/report/*.py", {"numpy"}, False, True, ("m2wr_campaign.runner", "m2wr_campaign.study")),
    Rule("m2wr_campaign/programs/*.py", {"rospy", "rosmaster", "roslaunch"}, True, False, ("m2wr_campaign.grading",)),
    Rule("m2wr_campaign/grading/*.py", set(), False, True, ("m2wr_campaign.worlds",)),
    Rule("m2wr_campaign/runner/*.py", NUMERIC | {"distributed", "rosbags"}, False, False, ()),     # measures time
    Rule("m2wr_campaign/*.py", set(), False, True, ("m2wr_campaign.*",)),
    Rule("m2wr_live/scene/*.py", NUMERIC | {"trimesh"}, False, True, ("m2wr_live.web", "m2wr_live.ros") + EDGES),
    Rule("m2wr_live/web/*.py", NUMERIC | {"msgspec", "viser", "websockets", "zstandard"}, False, True,
         ("m2wr_live.ros",) + EDGES),
    Rule("m2wr_live/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_live/*.py", set(), False, True, ("m2wr_live.*",)),
    Rule("m2wr_view/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_view/*.py", NUMERIC | {"cairo", "matplotlib", "PIL", "rosbag", "roslib", "yaml"}, False, True,
         ("m2wr_view.ros",)),                                             # bags need the classes of their messages
    Rule("m2wr_tools/slam_benchmark/*.py", NUMERIC | {"rosbag", "rospy"}, True, False, ("m2wr_gmapping.ros",)),
    Rule("m2wr_gmapping/replay/*.py", ANYTHING, True, False, ()),         # reads bags and measures time
    Rule("m2wr_gmapping/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_gmapping/frontend/*.py", NUMERIC, False, True,
         ("m2wr_gmapping.ros", "m2wr_gmapping.replay", "m2wr_gmapping.io", "m2wr_gmapping.backend",
          "m2wr_gmapping.mapper", "m2wr_maps.ros")),
    Rule("m2wr_gmapping/filter/*.py", NUMERIC, False, True,
         ("m2wr_gmapping.ros", "m2wr_gmapping.replay", "m2wr_gmapping.io", "m2wr_gmapping.backend",
          "m2wr_gmapping.mapper", "m2wr_maps.ros")),
    Rule("m2wr_gmapping/backend/*.py", NUMERIC, False, True,
         ("m2wr_gmapping.ros", "m2wr_gmapping.replay", "m2wr_gmapping.io", "m2wr_gmapping.mapper", "m2wr_maps.ros")),
    Rule("m2wr_gmapping/io/*.py", NUMERIC, False, True, ("m2wr_gmapping.ros", "m2wr_gmapping.replay", "m2wr_maps.ros")),
    Rule("m2wr_gmapping/*.py", NUMERIC, False, True, ("m2wr_gmapping.ros", "m2wr_gmapping.replay", "m2wr_maps.ros")),
    Rule("m2wr_navigation/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_navigation/benchmark/*.py", NUMERIC, False, False, ("m2wr_navigation.ros",)),     # measures time
    Rule("m2wr_navigation/localization/*.py", NUMERIC, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_navigation/costmap/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.planners", "m2wr_navigation.controllers",
          "m2wr_navigation.recoveries")),
    Rule("m2wr_navigation/methods/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.compare", "m2wr_navigation.planners.[!w]*",       # wave_kernels
          "motion_plan.ros*")),
    Rule("m2wr_navigation/barn/*.py", NUMERIC | {"yaml"}, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_navigation/accuracy/*.py", NUMERIC | {"yaml"}, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_navigation/compare/*.py", NUMERIC, False, False, ("m2wr_navigation.ros",)),       # measures time
    Rule("m2wr_navigation/fusion/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.localization", "m2wr_navigation.planners",
          "m2wr_navigation.controllers")),
    Rule("m2wr_navigation/optimum/*.py", NUMERIC, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_navigation/planners/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.controllers", "m2wr_navigation.recoveries")),
    Rule("m2wr_navigation/controllers/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.planners", "m2wr_navigation.recoveries")),
    Rule("m2wr_navigation/recoveries/*.py", NUMERIC, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_navigation/criteria/*.py", NUMERIC, False, True,
         ("m2wr_navigation.ros", "m2wr_navigation.planners", "m2wr_navigation.controllers")),
    Rule("m2wr_navigation/best_path/*.py", NUMERIC, False, True, ("m2wr_navigation.ros", "m2wr_navigation.compare")),
    Rule("m2wr_navigation/*.py", NUMERIC, False, True, ("m2wr_navigation.ros",)),
    Rule("m2wr_exploration/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_exploration/study/command.py", NUMERIC, False, False, ("m2wr_exploration.ros",)),      # measures time
    Rule("m2wr_exploration/study/*.py", NUMERIC | {"matplotlib", "yaml"}, False, True, ("m2wr_exploration.ros",)),
    Rule("m2wr_exploration/strategies/*.py", NUMERIC, False, True,
         ("m2wr_exploration.ros", "m2wr_exploration.study", "m2wr_exploration.explorer")),
    Rule("m2wr_exploration/team/*.py", NUMERIC, False, True,
         ("m2wr_exploration.ros", "m2wr_exploration.study", "m2wr_exploration.explorer", "m2wr_navigation.ros")),
    Rule("m2wr_exploration/*.py", NUMERIC, False, True,
         ("m2wr_exploration.ros", "m2wr_exploration.study", "m2wr_navigation.ros")),
    Rule("m2wr_elevation/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_elevation/study/*.py", NUMERIC, False, True, ("m2wr_elevation.ros",)),
    Rule("m2wr_elevation/*.py", NUMERIC, False, True, ("m2wr_elevation.ros", "m2wr_elevation.study", "m2wr_sim.*")),
    Rule("m2wr_delivery/ros/*.py", ANYTHING, True, False, ()),
    Rule("m2wr_delivery/study/*.py", NUMERIC, False, True, ("m2wr_delivery.ros", "m2wr_elevation.ros")),
    Rule("m2wr_delivery/*.py", NUMERIC | {"matplotlib"}, False, True,
         ("m2wr_delivery.ros", "m2wr_delivery.study", "m2wr_elevation.ros", "m2wr_sim.*")),
    Rule("motion_plan/ros_*.py", ANYTHING, True, False, ()),
    Rule("motion_plan/*_nodes.py", ANYTHING, True, False, ()),
    Rule("motion_plan/ros/*.py", ANYTHING, True, False, ()),
    Rule("motion_plan/*.py", NUMERIC, False, True, ("motion_plan.ros*",)),
)
KERNEL_STANDARD = {"math", "typing", "__future__"}
KERNEL_NEIGHBOURS = ("kernel", "kernels", "_layout", "track", "tuning", "array_types")    # our own that kernels import
ODE_LAYER = "m2wr_sim/physics/"
SEEDED = {"default_rng", "Generator", "SeedSequence", "PCG64", "BitGenerator"}
#: The only folder that uses private parts of rospy, and modules with one of their own, with the reason.
ROSPY_INTERNALS = "m2wr_node/internals/"
ROSPY_ALLOWED = {"m2wr_sim/ros/ports.py": {"impl": "Channel.impl, read without a call with each step"}}
ROSPY_PRIVATE = {"impl", "get_topic_manager", "get_service_manager", "get_registration_listeners", "connection_poll"}
WALL_CLOCK = {"time.time", "time.time_ns", "time.monotonic", "time.monotonic_ns", "time.perf_counter",
              "time.perf_counter_ns", "time.sleep", "time.process_time", "datetime.datetime.now",
              "datetime.datetime.utcnow", "datetime.date.today"}


def is_standard(top):
    """Whether a top-level module belongs to Python itself; by a list since 3.10, before that by its location."""
    if top in sys.builtin_module_names:
        return True
    if hasattr(sys, "stdlib_module_names"):
        return top in getattr(sys, "stdlib_module_names")      # noqa: B009  (unknown to Python 3.8)
    spec = importlib.util.find_spec(top)
    origin = getattr(spec, "origin", None) or ""
    return spec is not None and (origin in ("built-in", "frozen") or (
        origin.startswith(sysconfig.get_paths()["stdlib"]) and "-packages" not in origin))


def modules():
    """(package folder name, path inside it) of every module below a src/<package>/src/<python package>."""
    found = []
    for package in tree.packages():
        top = os.path.join(package.folder, "src")
        if os.path.dirname(package.folder) != os.path.join(tree.ROOT, "src") or not os.path.isdir(top):
            continue
        for path in tree.files_below(top):
            if path.endswith(".py"):
                found.append((path, os.path.relpath(path, top).replace(os.sep, "/")))
    return found


def rule_of(inside):
    """The first rule whose pattern fits; the number of folders must be equal, except for a leading ``*/``."""
    for rule in RULES:
        same_depth = rule.pattern.startswith("*/") or rule.pattern.count("/") == inside.count("/")
        if same_depth and fnmatch.fnmatchcase(inside, rule.pattern):
            return rule
    return None


def imports_of(syntax, inside):
    """(line, absolute dotted name) of everything a module imports, also inside functions and by literal name."""
    found = []
    here = inside[:-len(".py")].split("/")
    for node in ast.walk(syntax):
        if isinstance(node, ast.Import):
            found.extend((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = here[:-node.level] if node.level else []
            base = base + ([node.module] if node.module else [])
            found.extend((node.lineno, ".".join(base + [alias.name])) for alias in node.names)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = dotted(node.func)
            if called in ("importlib.import_module", "import_module", "__import__"):
                found.append((node.lineno, str(node.args[0].value)))
    return found


def dotted(node):
    """``a.b.c`` of an attribute chain, or None."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name):
        return None
    return ".".join([node.id] + parts[::-1])


def is_message(name):
    top = name.split(".")[0]
    return top.endswith("_msgs") or top.endswith("_srvs") or top == "genpy"


def within(name, pattern):
    """Whether a dotted name is the module a pattern names, or below it."""
    return fnmatch.fnmatchcase(name, pattern) or fnmatch.fnmatchcase(name, pattern + ".*")


def import_breaches(rule, inside, syntax, own):
    """One sentence for each import that the module's layer may not have."""
    kernel = rule.pattern == "*/*kernels.py"
    for line, name in imports_of(syntax, inside):
        top = name.split(".")[0]
        if top in own:
            if kernel and any(part.endswith(KERNEL_NEIGHBOURS) for part in name.split(".")):
                continue
            if any(within(name, pattern) for pattern in rule.not_ours):
                yield "line {}: imports {}, which is above this layer".format(line, name)
        elif top == "ode" and not inside.startswith(ODE_LAYER):
            yield "line {}: imports ode, which only {} may".format(line, ODE_LAYER)
        elif rule.third_party is ANYTHING or top in rule.third_party or (rule.messages and is_message(name)):
            continue
        elif not is_standard(top) or (kernel and top not in KERNEL_STANDARD):
            yield "line {}: imports {}; this layer has the standard library{} and {}".format(
                line, name, " (only math, typing)" if kernel else "", ", ".join(sorted(rule.third_party)) or "no more")
        elif rule.deterministic and top in ("random", "secrets", "uuid"):
            yield "line {}: imports {}; randomness must be an argument".format(line, name)


def aliases_of(syntax):
    """Local name -> dotted name, from the import statements of a module."""
    names = {}
    for node in ast.walk(syntax):
        if isinstance(node, ast.Import):
            for alias in node.names:
                top = alias.name.split(".")[0]
                names[alias.asname or top] = alias.name if alias.asname else top
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                names[alias.asname or alias.name] = "{}.{}".format(node.module, alias.name)
    return names


def fetched_state(syntax):
    """One sentence for each use of the wall clock or of numpy's module-level random functions."""
    names = aliases_of(syntax)
    for node in ast.walk(syntax):
        if not isinstance(node, (ast.Attribute, ast.Name)):
            continue
        used = dotted(node)
        if used is None:
            continue
        first, _, rest = used.partition(".")
        full = names.get(first, first) + ("." + rest if rest else "")
        if full in WALL_CLOCK:
            yield "line {}: uses {}; time must be an argument".format(node.lineno, full)
        drawn = full.split(".")
        if drawn[:2] == ["numpy", "random"] and len(drawn) > 2 and drawn[2] not in SEEDED:
            yield "line {}: uses {}; use a Generator passed as an argument".format(node.lineno, full)


def is_private(part):
    """Whether a part of a dotted name of rospy is private: a leading underscore, or known to be internal."""
    return part in ROSPY_PRIVATE or (part.startswith("_") and not part.startswith("__"))


def rospy_internals(inside, syntax):
    """One sentence for each use of a private part of rospy; ``.impl`` counts on any object."""
    if inside.startswith(ROSPY_INTERNALS):
        return
    allowed = ROSPY_ALLOWED.get(inside, {})
    names = aliases_of(syntax)
    used = [(line, name) for line, name in imports_of(syntax, inside) if name.split(".")[0] == "rospy"]
    for node in ast.walk(syntax):
        if isinstance(node, ast.Attribute):
            first, _, rest = (dotted(node) or "").partition(".")
            if names.get(first, first).split(".")[0] == "rospy":
                used.append((node.lineno, names.get(first, first) + "." + rest))
            elif node.attr == "impl":
                used.append((node.lineno, "rospy.?.impl"))
    for line, name in used:
        private = [part for part in name.split(".")[1:] if is_private(part) and part not in allowed]
        if private:
            yield "line {}: uses {}, private to rospy; only {} may".format(line, name, ROSPY_INTERNALS)


def breaches(inside, text, own):
    """All breaches of one module, as sentences.

    Parameters
    ----------
    inside : str
        Path below the package's Python root, with slashes: ``m2wr_sim/sensors/laser.py``.
    text : str
        Its source.
    own : set of str
        Top-level Python packages of this workspace that are code, not messages.
    """
    rule = rule_of(inside)
    if rule is None:
        return ["is in no layer of the table in test_layers.py; add a row with its imports"]
    syntax = ast.parse(text)
    found = list(import_breaches(rule, inside, syntax, own)) + list(rospy_internals(inside, syntax))
    if rule.deterministic:
        found.extend(fetched_state(syntax))
    return found


MODULES = modules()
OWN = {inside.split("/")[0] for _, inside in MODULES}


def test_there_are_modules_to_check():
    assert {"m2wr_sim", "motion_plan"} <= OWN
    rooms = {inside.rsplit("/", 1)[0] for _, inside in MODULES}
    assert {"m2wr_sim/model", "m2wr_sim/physics", "m2wr_sim/plugins", "m2wr_sim/sensors", "m2wr_sim/ros"} <= rooms
    assert any(inside.endswith("kernels.py") for _, inside in MODULES)


@pytest.mark.parametrize("path, inside", MODULES, ids=[inside for _, inside in MODULES])
def test_module_keeps_to_its_layer(path, inside):
    found = breaches(inside, tree.read(path), OWN)
    assert not found, "\n".join("{}: {}".format(tree.relative(path), sentence) for sentence in found)


def test_executables_and_tools_use_no_private_part_of_rospy():
    """The modules are checked above; tests may build parts of rospy to test against."""
    inside = {path for path, _ in MODULES}
    paths = [path for top in ("src", "dropin", "tools") for path in tree.files_below(os.path.join(tree.ROOT, top))
             if tree.is_python(path) and path not in inside and "/test/" not in tree.relative(path)]
    assert len(paths) > 50
    found = ["%s: %s" % (tree.relative(path), sentence) for path in paths
             for sentence in rospy_internals(tree.relative(path), ast.parse(tree.read(path)))]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("inside, text", [
    ("m2wr_sim/sensors/ray_kernels.py", "import os"),
    ("m2wr_sim/sensors/ray_kernels.py", "from m2wr_sim.geometry import rotate"),
    ("m2wr_sim/sensors/laser.py", "import rospy"),
    ("m2wr_sim/sensors/laser.py", "from sensor_msgs.msg import LaserScan"),
    ("m2wr_sim/sensors/laser.py", "import ode"),
    ("m2wr_sim/sensors/laser.py", "def f():\n    import rospy"),
    ("m2wr_sim/sensors/laser.py", "import importlib\nimportlib.import_module('rospy')"),
    ("m2wr_sim/sensors/laser.py", "from ..ros import node"),
    ("m2wr_sim/physics/engine.py", "from m2wr_sim.plugins.base import Plugin"),
    ("m2wr_sim/plugins/laser.py", "import rospy"),
    ("m2wr_sim/plugins/laser.py", "import tf2_ros"),
    ("m2wr_sim/plugins/laser.py", "import ode"),
    ("m2wr_sim/ros/node.py", "import ode"),
    ("m2wr_sim/runtime/simulator.py", "import time\ntime.time()"),
    ("m2wr_sim/runtime/simulator.py", "from time import sleep as nap\nnap(1)"),
    ("m2wr_sim/runtime/simulator.py", "import random"),
    ("m2wr_sim/control/noise.py", "import numpy as np\nnp.random.normal()"),
    ("m2wr_sim/control/noise.py", "from numpy import random as r\nr.seed(1)"),
    ("m2wr_sim/ros/node.py", "from rospy.impl import tcpros_base"),
    ("m2wr_sim/ros/node.py", "import rospy\nrospy.impl.registration.is_shutdown = None"),
    ("m2wr_sim/ros/node.py", "import rospy\nrospy.rostime._rostime_current = None"),
    ("m2wr_sim/ros/node.py", "import rospy.core as core\ncore._shutdown_flag = True"),
    ("m2wr_sim/ros/node.py", "from rospy.topics import _PublisherImpl"),
    ("m2wr_sim/ros/node.py", "def f(publisher):\n    return publisher.impl.connections"),
    ("motion_plan/bug2.py", "import rospy"),
    ("motion_plan/bug2.py", "from motion_plan.ros_nodes import Bug2Node"),
    ("m2wr_sim/newlayer/thing.py", "import math"),
])
def test_a_breach_is_found(inside, text):
    assert breaches(inside, text, {"m2wr_sim", "motion_plan"})


@pytest.mark.parametrize("inside, text", [
    ("m2wr_sim/sensors/ray_kernels.py", "import math\nimport numpy as np\nfrom numba import njit"),
    ("m2wr_sim/physics/step_kernels.py", "from m2wr_sim.physics.step_layout import C_MU"),
    ("m2wr_sim/physics/pyode_engine.py", "import ode\nimport ctypes\nimport numpy as np"),
    ("m2wr_sim/plugins/laser.py", "from sensor_msgs.msg import LaserScan\nfrom m2wr_sim.sensors import laser"),
    ("m2wr_sim/runtime/simulator.py", "import numpy as np\nrng = np.random.default_rng([1, 2])\nrng.normal()"),
    ("m2wr_sim/ros/node.py", "import rospy, time\ntime.sleep(1)"),
    ("motion_plan/ros_nodes.py", "import rospy\nrospy.core.is_shutdown_requested()\nrospy.__file__"),
    ("motion_plan/bug2.py", "import math\nfrom motion_plan.angles import wrap_angle"),
])
def test_what_is_allowed_passes(inside, text):
    assert not breaches(inside, text, {"m2wr_sim", "motion_plan"})
