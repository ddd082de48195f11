# SPDX-License-Identifier: BSD-3-Clause
"""The worlds with Gazebo's names load, have no unsupported elements and leave the origin free."""
import logging
import os

import pytest
import rospkg

from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_world

PACKS = rospkg.RosPack()
WORLDS = [os.path.join(PACKS.get_path('gazebo_ros'), 'worlds', name + '.world')
          for name in ('elevator_ros', 'mud', 'rubble', 'willowgarage')]
WORLDS.append(os.path.join(PACKS.get_path('gazebo_plugins'), 'test', 'test_worlds', 'gazebo_ros_range.world'))


@pytest.mark.parametrize('path', WORLDS, ids=[os.path.basename(path) for path in WORLDS])
def test_world_loads_without_a_warning(path, caplog):
    caplog.set_level(logging.WARNING)
    world = load_world(path, resolve_model=ModelFolders([os.path.join(PACKS.get_path('m2wr_sim'), 'models')]))
    assert world.models[0].name == 'ground_plane' and len(world.models) > 1
    assert not caplog.records


def test_the_rubble_is_loose_and_lies_apart():
    world = load_world(WORLDS[2], resolve_model=ModelFolders([os.path.join(PACKS.get_path('m2wr_sim'), 'models')]))
    blocks = world.models[1:]
    assert len(blocks) == 24 and not any(block.static for block in blocks)
