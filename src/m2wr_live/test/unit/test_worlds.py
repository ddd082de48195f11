# SPDX-License-Identifier: BSD-3-Clause
"""The worlds that pages load."""
import os

import pytest

from m2wr_live.ros import worlds
from m2wr_sim.model.sdf.loader import load_sdf, load_world
from m2wr_sim.ros.shared_files import model_folders, package_folder
from m2wr_view.errors import ViewError


@pytest.mark.parametrize("name", worlds.names())
def test_each_world_gives_the_models_of_its_file(name):
    share = package_folder()
    expected = {model.name: model for model in load_world(os.path.join(share, "worlds", name + ".world"),
                                                          resolve_model=model_folders(share)).models}
    expected.pop(worlds.GROUND, None)
    found = {model.name: model for model in worlds.models_of(name)}
    assert set(found) == set(expected)
    for own, model in found.items():
        record, = load_sdf(model.sdf, resolve_model=model_folders(share))[0]
        position, _ = expected[own].pose
        place = model.pose.position
        assert [place.x + record.pose[0][0], place.y + record.pose[0][1]] == pytest.approx(list(position[:2]), abs=1e-9)
        assert len(record.links) == len(expected[own].links)


@pytest.mark.parametrize("name", ["", "../worlds/world02", "world02.world", "/etc/passwd", "no_such_world"])
def test_only_worlds_of_the_package_are_loaded(name):
    with pytest.raises(ViewError, match="expected one of"):
        worlds.models_of(name)
