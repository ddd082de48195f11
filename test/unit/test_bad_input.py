"""Input that cannot be used is refused with one line that names file, element and what was expected."""
import os

import pytest
import workspace_tree as tree

from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.sdf import load_world
from m2wr_sim.model.urdf import load_urdf

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
    ("unknown_geometry.world", "collision[stone]", "expected"),
]


def refusal(name):
    """The message of what reading a file of data/bad raises."""
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


def test_every_bad_file_is_used_by_a_test():
    sources = [path for path in tree.files_below(os.path.join(tree.ROOT, "test")) if path.endswith((".py", ".xml"))]
    texts = "".join(tree.read(path) for path in sources)
    assert [name for name in sorted(os.listdir(FOLDER)) if name not in texts] == []
