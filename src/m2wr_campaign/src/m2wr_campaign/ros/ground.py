# SPDX-License-Identifier: BSD-3-Clause
"""Puts ground into a simulation, and reads poses from its messages."""
from __future__ import annotations

import tempfile
from typing import TYPE_CHECKING, Any

import rospy
from geometry_msgs.msg import Pose as PoseMessage

from gazebo_msgs.srv import SpawnModel
from m2wr_campaign.terrain.files import write_heightmap

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from m2wr_campaign.terrain.relief import Grid
    from m2wr_sim.geometry import Pose


def spawn_ground(grid: Grid, heights: NDArray[np.float64], name: str) -> None:
    """Wait for the simulation and spawn a heightmap.

    Parameters
    ----------
    grid : Grid
    heights : (samples, samples) float64
        [m]
    name : str
        Of the model.

    Raises
    ------
    ValueError
        If it was not spawned.
    """
    rospy.wait_for_service("/gazebo/spawn_sdf_model")
    with tempfile.TemporaryDirectory(prefix="m2wr_ground_") as folder:
        path = write_heightmap(folder, grid, heights, 16)[0]
        with open(path, encoding="utf-8") as file:
            text = file.read()
        first, last = text.index("<model "), text.index("</model>") + len("</model>")
        done = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)(
            name, '<sdf version="1.6">' + text[first:last] + "</sdf>", "", PoseMessage(), "world")
    if not done.success:
        raise ValueError("the ground was not spawned: " + done.status_message)


def values_of(pose: Any) -> Pose:
    """Return position [m] and quaternion x, y, z, w of a message of a pose."""
    place, turn = pose.position, pose.orientation
    return (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
