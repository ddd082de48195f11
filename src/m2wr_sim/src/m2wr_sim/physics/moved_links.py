# SPDX-License-Identifier: BSD-3-Clause
"""Links that are moved from outside, as rigid parts of their models."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Sequence

from m2wr_sim.geometry import compose, cross, normalise_quaternion, rotate

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.physics.engine import Engine


class MovedLink(NamedTuple):
    """A link that :meth:`m2wr_sim.physics.engine.Engine.link_mover` moves with its model."""

    row: int            # of the model in the arrays
    link: int
    pose: Pose          # in the model frame
    centre: Vector      # centre of mass in the link frame [m]


def move_links(engine: Engine, parts: Sequence[MovedLink], motions: NDArray[np.float64],
               chosen: NDArray[np.int64]) -> None:
    """Place links one by one and set their velocities.

    Parameters
    ----------
    engine : Engine
    parts, motions, chosen
        As of :meth:`m2wr_sim.physics.engine.Engine.link_mover`.
    """
    for row, link, offset, centre in parts:
        if chosen[row] != 1:
            continue
        motion = motions[row].tolist()
        origin, linear, angular = motion[:3], motion[7:10], motion[10:]
        position, orientation = compose((origin, motion[3:7]), offset)
        engine.set_link_pose(link, (position, normalise_quaternion(orientation)))
        arm = rotate(orientation, centre)
        carried = cross(angular, [position[k] + arm[k] - origin[k] for k in range(3)])
        engine.set_link_velocity(link, [linear[k] + carried[k] for k in range(3)], angular)
