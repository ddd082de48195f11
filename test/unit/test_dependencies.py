# SPDX-License-Identifier: BSD-3-Clause
"""Packages depend on each other in one direction only, and package.xml names what a package imports."""
import ast
import os
import xml.etree.ElementTree as ElementTree

import pytest

import workspace_tree as tree
from test_layers import imports_of, is_standard

# Python module -> its name in package.xml, where the two differ; None: installed by set-up for an optional feature.
PROVIDERS = {
    "PIL": "python3-pil", "cairo": "python3-cairo", "lxml": "python3-lxml", "matplotlib": "python3-matplotlib",
    "numba": "python3-numba", "llvmlite": "python3-numba", "numpy": "python3-numpy", "ode": "python3-pyode",
    "rospkg": "python3-rospkg", "scipy": "python3-scipy", "yaml": "python3-yaml", "urdf_parser_py": "urdfdom_py",
    "mpl_toolkits": "python3-matplotlib",
    "collada": None, "gymnasium": None, "trimesh": None, "viser": None, "websockets": None,
    "cbor2": None, "mcap": None, "msgspec": None, "rosbags": None,
    "lz4": None, "zstandard": None, "pyarrow": None, "distributed": None,
    "gym": None, "irsim": None, "mujoco": None,     # simulators that a benchmark measures if they are there
}
PACKAGES = [package for package in tree.packages() if package.name != "m2wr_test"]
NAMES = {package.name for package in PACKAGES}
DECLARED = ("depend", "exec_depend", "build_depend", "build_export_depend")


def declared(package):
    """Names in package.xml on which the package itself depends; without those of its tests only."""
    root = ElementTree.parse(os.path.join(package.folder, "package.xml")).getroot()
    return {element.text.strip() for tag in DECLARED for element in root.findall(tag)}


def python_files(package):
    """(absolute path, path below its Python root or file name) of the sources except tests and examples."""
    found = []
    for path in tree.files_below(package.folder):
        inside = os.path.relpath(path, package.folder).split(os.sep)
        if inside[0] in ("src", "nodes", "scripts") and tree.is_python(path):
            found.append((path, "/".join(inside[1:])))
    return found


def modules_of(package):
    """Top-level Python modules that a package provides."""
    top = os.path.join(package.folder, "src")
    return {name for name in (os.listdir(top) if os.path.isdir(top) else ())
            if os.path.isfile(os.path.join(top, name, "__init__.py"))}


PROVIDES = {module: package.name for package in PACKAGES for module in modules_of(package) | {package.name}}


def imported(package):
    """{top-level module: "file:line" of one import of it}, lazy imports included."""
    found = {}
    for path, inside in python_files(package):
        for line, name in imports_of(ast.parse(tree.read(path)), inside):
            found.setdefault(name.split(".")[0], "%s:%d" % (tree.relative(path), line))
    return found


def needed(package):
    """{name in package.xml: where it is imported} of all that a package imports and does not contain."""
    result = {}
    for module, where in imported(package).items():
        if module in PROVIDES:
            name = PROVIDES[module]
        elif is_standard(module) or module == "__future__":
            continue
        else:
            name = PROVIDERS.get(module, module)
        if name is not None and name != package.name:
            result[name] = where
    return result


def cycle(edges):
    """Return one cycle of a graph as a list of its nodes, or an empty list.

    Parameters
    ----------
    edges : dict of str to set of str
    """
    done, path = set(), []

    def visit(node):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return []
        path.append(node)
        for following in sorted(edges.get(node, ())):
            found = visit(following)
            if found:
                return found
        done.add(path.pop())
        return []

    for start in sorted(edges):
        found = visit(start)
        if found:
            return found
    return []


@pytest.mark.parametrize("package", PACKAGES, ids=[package.name for package in PACKAGES])
def test_package_xml_names_every_import(package):
    missing = {name: where for name, where in needed(package).items() if name not in declared(package)}
    assert not missing, "%s/package.xml lacks %s" % (tree.relative(package.folder), ", ".join(
        "%s (%s)" % item for item in sorted(missing.items())))


def test_no_cycle_of_packages():
    edges = {package.name: (declared(package) | set(needed(package))) & NAMES for package in PACKAGES}
    assert edges["m2wr_sim"], "no dependency was read"
    assert not cycle(edges), " -> ".join(cycle(edges))


@pytest.mark.parametrize("name", ["m2wr_files", "m2wr_node"])
def test_the_foundation_depends_on_no_other_package(name):
    package = next(package for package in PACKAGES if package.name == name)
    assert not (declared(package) | set(needed(package))) & NAMES


@pytest.mark.parametrize("name", ["m2wr_campaign", "m2wr_exploration", "m2wr_maps", "m2wr_navigation"])
def test_python_code_that_does_not_need_the_mapper(name):
    package = next(package for package in PACKAGES if package.name == name)
    assert "m2wr_gmapping" not in needed(package)


@pytest.mark.parametrize("edges, expected", [
    ({"a": {"b"}, "b": {"c"}}, []), ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, ["b", "c", "b"]),
    ({"a": {"a"}}, ["a", "a"])])
def test_a_cycle_is_found(edges, expected):
    assert cycle(edges) == expected
