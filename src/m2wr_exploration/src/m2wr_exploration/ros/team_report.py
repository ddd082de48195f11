# SPDX-License-Identifier: BSD-3-Clause
"""The end of an exploration by a team: time, paths, the share that was seen, the saved map."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import rospy

from m2wr_exploration.study.scenes import place, whole_map
from m2wr_exploration.study.truth import explored_share
from m2wr_exploration.team.map_match import match
from m2wr_exploration.team.merging import merge
from m2wr_maps import map_file
from m2wr_navigation.costmap.footprint import placed
from m2wr_navigation.ros.grid_messages import OCCUPANCY
from m2wr_node.user_folder import from_user
from m2wr_sim.api import read_world
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_exploration.crew import Crew
    from m2wr_navigation.costmap.costmap import Costmap


class TeamReport:
    """Takes times, and tells at the end.

    Parameters
    ----------
    name : str
        Of the map to write, without extension; empty: none.
    world : str
        World file; empty: the share that was seen is not told.
    in_world : bool, optional
        Whether the merged map is in the frame of the world; else it is placed there by the walls of both.
    """

    def __init__(self, name: str, world: str, in_world: bool = True) -> None:
        self._name, self._world, self._in_world = from_user(name), world, in_world
        self.begun: Optional[float] = None
        self.told = False
        self._start: Any = None
        self._explored: Optional[float] = None

    def begin(self, now: float, start: Any) -> None:
        """Take the time at which the first robot takes part, and its place.

        Parameters
        ----------
        now : float
            [s]
        start : (2,) float64
            [m]
        """
        if self.begun is None:
            self.begun, self._start = now, start

    def explored(self, now: float) -> None:
        """Take the time at which nothing is left to explore.

        Parameters
        ----------
        now : float
            [s]
        """
        self._explored = now if self._explored is None else self._explored

    def tell(self, now: float, crew: Crew, known: Costmap) -> None:
        """Tell what came of it, and write the map.

        Parameters
        ----------
        now : float
            [s]
        crew : Crew
        known : Costmap
            The merged map.
        """
        self.told = True
        begun = self.begun or 0.0
        rospy.loginfo("exploration ended after %.0f s, the drive back after %.0f s: %s",
                      (self._explored or now) - begun, now - begun, crew.summary())
        rospy.loginfo("paths: %s; %.1f m together", ", ".join(
            "{} {:.1f} m".format(member.name, member.length) for member in crew.members),
            sum(member.length for member in crew.members))
        if self._world:
            self._tell_share(known)
        if self._name:
            try:
                for path in map_file.save(self._name, OCCUPANCY[known.costs], known.resolution,
                                          (known.origin[0], known.origin[1], 0.0)):
                    rospy.loginfo("wrote %s", path)
            except (OSError, ValueError) as error:
                rospy.logerr("%s", error)

    def _tell_share(self, known: Costmap) -> None:
        try:
            world, pose = read_world(self._world), np.zeros(3)
            if not self._in_world:
                found = match(whole_map(world), known)
                if found.confidence < 1.0:
                    raise ValueError("where the map lies in the world is not certain: " + found.reason)
                pose = found.pose
            start = placed(np.array(self._start[:2], float), pose)
            scene = place(self._world, world, (float(start[0]), float(start[1]), 0.0))
        except (SimError, ValueError) as error:
            rospy.logwarn("the share that was seen is not known: %s", error)
            return
        share, area = explored_share(scene.truth, scene.wanted, merge([known], [pose]) if pose.any() else known)
        rospy.loginfo("%.1f %% of the %.0f m^2 that the robots can reach were seen", 100.0 * share, area)
