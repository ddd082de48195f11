# SPDX-License-Identifier: BSD-3-Clause
"""Where a world's models stand when it has been loaded, for those who look at a world without running it."""
from m2wr_sim.geometry import compose


def placed_collisions(world):
    """Yield every collision of a world with the pose it has once the world's ``<state>`` has been applied.

    The same rule as that of ``Simulator.apply_state``: a stored pose of a model takes its links
    along, a stored pose of a link counts alone, and what the state does not mention stays where ``<model>`` puts it.

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
