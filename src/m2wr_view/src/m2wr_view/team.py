# SPDX-License-Identifier: BSD-3-Clause
"""Several robots of one simulation: where they are, and where they have been, by their true poses."""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Dict, List, Sequence, Tuple

if TYPE_CHECKING:
    Pose = Tuple[float, float, float]

PATH_STEP = 0.1         # m between two points of a path
JUMP = 0.5              # m between two poses; more means that the robot was placed there and did not drive


@dataclass
class Member:
    """A robot.

    Attributes
    ----------
    pose : (3,) float
        x, y [m] and yaw [rad] in the world.
    path : list of (float, float, bool)
        x, y [m], and whether the robot drove here from the point before.
    """

    pose: Pose
    path: List[Tuple[float, float, bool]] = field(default_factory=list)

    def move(self, pose: Pose) -> None:
        """Take the newest pose.

        Parameters
        ----------
        pose : (3,) float
        """
        jumped = math.dist(pose[:2], self.pose[:2]) > JUMP
        if not self.path or jumped or math.dist(pose[:2], self.path[-1][:2]) > PATH_STEP:
            self.path.append((pose[0], pose[1], bool(self.path) and not jumped))
        self.pose = pose


class Team:
    """The robots of a simulation with more than one.

    Attributes
    ----------
    members : dict of str to Member
        By name; empty for a single robot.
    """

    def __init__(self) -> None:
        self.members: Dict[str, Member] = {}

    def update(self, poses: Dict[str, Pose]) -> None:
        """Take the poses of all robots; one that is no longer among them is dropped.

        Parameters
        ----------
        poses : dict of str to (3,) float
            x, y [m] and yaw [rad] in the world, by name. What is not finite is left out.
        """
        finite = {name: pose for name, pose in poses.items() if all(map(math.isfinite, pose))}
        if len(finite) < 2:
            self.members = {}
            return
        self.members = {name: self.members.get(name) or Member(pose) for name, pose in finite.items()}
        for name, pose in finite.items():
            self.members[name].move(pose)

    def forget_paths(self) -> None:
        """Drop the paths, as after a reset."""
        for member in self.members.values():
            member.path = []

    def points(self) -> Sequence[Tuple[float, float]]:
        """Return where the robots are and have been [m]."""
        return [member.pose[:2] for member in self.members.values()] + [
            (x, y) for member in self.members.values() for x, y, _ in member.path]
