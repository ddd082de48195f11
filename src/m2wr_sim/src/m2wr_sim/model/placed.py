# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a world's collisions after loading, without a simulation."""
from __future__ import annotations

from typing import Iterator, Tuple

from m2wr_sim.geometry import Pose, compose
from m2wr_sim.model.types import Collision, Model, World


def placed_collisions(world: World) -> Iterator[Tuple[Model, Collision, Pose]]:
    """Yield every collision of a world with its pose after the world's ``<state>`` has been applied.

    The rule is that of ``Simulator.apply_state``: the stored pose of a model moves its links too, the stored pose of a
    link moves only that link. All others keep the pose of ``<model>``.

    Parameters
    ----------
    world : m2wr_sim.model.types.World

    Yields
    ------
    (Model, Collision, pose)
        The pose ``((x, y, z), (x, y, z, w))`` of the collision in the world [m].
    """
    stored = {} if world.state is None else {entry.name: entry for entry in world.state.models}
    for model in world.models:
        entry = stored.get(model.name)
        model_pose = entry.pose if entry is not None and entry.pose is not None else model.pose
        links = {} if entry is None else {name: pose for name, pose, _ in entry.links if pose is not None}
        for link in model.links:
            link_pose = links.get(link.name) or compose(model_pose, link.pose)
            for collision in link.collisions:
                yield model, collision, compose(link_pose, collision.pose)
