# SPDX-License-Identifier: BSD-3-Clause
"""Unusable input is refused with one line that names file, element and the expected value."""
import os

import pytest

import workspace_tree as tree
from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.urdf.loader import load_urdf

FOLDER = os.path.join(tree.ROOT, "test", "data", "bad")
REFUSED = [
    ("broken.urdf", "broken.urdf:5", "mismatch"),
    ("empty.urdf", "empty.urdf", "expected"),
    ("entities.urdf", "entities.urdf", "expected"),
    ("limit_without_effort.urdf", "shoulder", "expected effort and velocity"),
    ("negative_mass.urdf", "link[base]", "expected a positive mass"),
    ("no_links.urdf", "robot[no_links]", "expected at least one <link>"),
    ("unparsable.xacro", "unparsable.xacro", "expected"),
    ("malformed.world", "malformed.world:5", "mismatch"),
]
BAD_PARTS = ("model://ground_plane", "etc/passwd", 'unknown geometry "pyramid"', "<geometry> is missing", "gone.stl",
             "mass is -1", 'child "hand" is no link', "attribute filename is missing")


def refusal(name):
    """The message of the exception raised when a file of data/bad is read."""
    path = os.path.join(FOLDER, name)
    if name.endswith(".world"):
        with pytest.raises(WorldError) as caught:
            load_world(path)
    else:
        with pytest.raises(ModelError) as caught:
            load_urdf(tree.read(path), source=path)
    return str(caught.value)


@pytest.mark.parametrize("name, place, expectation", REFUSED, ids=[case[0] for case in REFUSED])
def test_bad_file_is_refused_with_place_and_expectation(name, place, expectation):
    message = refusal(name)
    assert name in message
    assert place in message
    assert expectation in message
    assert "\n" not in message


def test_a_bad_part_of_a_world_is_named_and_the_rest_loads():
    path = os.path.join(FOLDER, "bad_parts.world")
    world = load_world(path)
    assert [model.name for model in world.models] == ["tomb", "wall", "arm", "good"]
    for words in BAD_PARTS:
        note, = [note for note in world.notes if words in note]
        assert note.startswith(path + ":") and "left out" in note, note
    note, = [note for note in world.notes if not any(words in note for words in BAD_PARTS)]
    assert 'pose is "4 0 0.5"; expected six numbers' in note and world.models[1].pose[0] == (4.0, 0.0, 0.5)


def test_every_bad_file_is_used_by_a_test():
    sources = [path for path in tree.files_below(os.path.join(tree.ROOT, "test")) if path.endswith((".py", ".xml"))]
    texts = "".join(tree.read(path) for path in sources)
    assert [name for name in sorted(os.listdir(FOLDER)) if name not in texts] == []
