# SPDX-License-Identifier: BSD-3-Clause
"""Settings of Sphinx for the API reference that tools/docs.sh writes from the docstrings."""
import ast
import functools
import inspect
import sys

from sphinx import addnodes

project = "m2wr"
author = "m2wr maintainers"
copyright = "2026, m2wr maintainers"
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "alabaster"
html_theme_options = {"page_width": "1100px"}
html_copy_source = False

napoleon_google_docstring = False
# types in docstrings say shapes and units, so they are text and no names of classes to link to
napoleon_preprocess_types = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
# what a machine that only writes the reference need not have
autodoc_mock_imports = [
    "actionlib_msgs", "control_msgs", "controller_manager_msgs", "diagnostic_msgs", "four_wheel_steering_msgs",
    "kobuki_msgs",
    "gazebo_msgs", "genpy", "geometry_msgs", "grid_map_msgs", "m2wr_gmapping.srv", "m2wr_lockstep.srv",
    "message_filters", "nav_msgs", "rosbag", "rosgraph", "rosgraph_msgs", "roslaunch", "roslib", "rosnode", "rosparam",
    "rospkg", "rospy", "rosservice", "rostopic", "sensor_msgs", "std_msgs", "std_srvs", "tf", "tf2_msgs", "tf2_ros",
    "trajectory_msgs", "visualization_msgs",
]


@functools.lru_cache(maxsize=None)
def full_names(module):
    """Return {name: full name} of what a module imports and defines, for type checkers too."""
    found = {}
    try:
        nodes = list(ast.parse(inspect.getsource(sys.modules[module])).body)
    except (KeyError, OSError, TypeError):
        return found
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.If):            # if TYPE_CHECKING
            nodes += node.body
        elif isinstance(node, ast.ImportFrom):
            found.update((entry.asname or entry.name, "%s.%s" % (node.module, entry.name)) for entry in node.names)
        elif isinstance(node, ast.ClassDef):
            found[node.name] = "%s.%s" % (module, node.name)
        elif isinstance(node, ast.Assign):
            found.update((target.id, "%s.%s" % (module, target.id)) for target in node.targets
                         if isinstance(target, ast.Name))
    return found


def full_name(module, name):
    """Return the full name of a name in a module, or in a module from which it exports something; None if unknown."""
    known = full_names(module)
    exported = [known[one] for one in getattr(sys.modules.get(module), "__all__", ()) if one in known]
    for source in [module] + [full.rpartition(".")[0] for full in exported]:
        if name in full_names(source):
            return full_names(source)[name]
    return None


def qualify_references(_, document):
    """Let references in signatures mean what their module means; Sphinx searches all packages for the last part."""
    for node in document.findall(addnodes.pending_xref):
        first, dot, rest = node.get("reftarget", "").partition(".")
        full = full_name(node.get("py:module"), first) if node.get("refdomain") == "py" else None
        if full:
            node["reftarget"] = full + dot + rest


def setup(app):
    """Register the above."""
    app.connect("doctree-read", qualify_references)
