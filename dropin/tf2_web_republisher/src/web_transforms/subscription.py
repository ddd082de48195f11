# SPDX-License-Identifier: BSD-3-Clause
"""What one page asked for: frames, thresholds and a rate, and which transforms it has to be sent."""
from __future__ import annotations

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

MOST_FRAMES = 1000          # of a subscription
LONGEST = 1000              # characters of a frame's name
FASTEST = 100.0             # Hz; more is not sent


class Pose(NamedTuple):
    """A transform: ``position`` x y z [m] and ``quaternion`` x y z w, of length 1."""

    position: Tuple[float, float, float]
    quaternion: Tuple[float, float, float, float]


#: Returns the newest transform between two frames, target and source, or None if it is not known.
Find = Callable[[str, str], Optional[Pose]]


def frame(name: str) -> str:
    """Return the name of a frame without the slash that tf 1 allowed at its begin."""
    return name[1:] if name.startswith("/") else name


def distance(one: Pose, other: Pose) -> float:
    """Return how far two positions are from each other [m].

    Parameters
    ----------
    one, other : Pose
    """
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(one.position, other.position)))


def angle(one: Pose, other: Pose) -> float:
    """Return the angle of the rotation between two poses [rad], 0 to pi.

    Parameters
    ----------
    one, other : Pose
    """
    cosine = abs(sum(a * b for a, b in zip(one.quaternion, other.quaternion)))     # of half the angle
    return 2.0 * math.acos(min(1.0, cosine))


class Subscription:
    """The transforms that a page asked for.

    Parameters
    ----------
    sources : sequence of str
        Frames whose transforms to ``target`` are sent.
    target : str
    angle_threshold : float
        Change that is sent [rad].
    distance_threshold : float
        Change that is sent [m]; if one of both is 0, all is sent each time.
    rate : float
        How often changes are looked for [Hz].

    Attributes
    ----------
    period : float
        Between two looks [s].

    Raises
    ------
    ValueError
        If a frame or a number is not possible; the text says which.
    """

    def __init__(self, sources: Sequence[str], target: str, angle_threshold: float, distance_threshold: float,
                 rate: float) -> None:
        if len(sources) > MOST_FRAMES:
            raise ValueError("%d source_frames; expected at most %d" % (len(sources), MOST_FRAMES))
        self.sources, self.target = list(dict.fromkeys(map(frame, sources))), frame(target)
        for name in self.sources + [self.target]:
            if not name or len(name) > LONGEST or "\0" in name:
                raise ValueError("frame %r; expected a name of 1 to %d characters" % (name[:60], LONGEST))
        for what, value in (("angular_thres", angle_threshold), ("trans_thres", distance_threshold)):
            if not 0.0 <= value < math.inf:
                raise ValueError("%s is %g; expected a number from 0 on" % (what, value))
        if not 0.0 < rate < math.inf:
            raise ValueError("rate is %g Hz; expected a number above 0" % rate)
        self._angle, self._distance = angle_threshold, distance_threshold
        self.period = 1.0 / min(rate, FASTEST)
        self._sent: Dict[str, Pose] = {}

    def changed(self, find: Find) -> List[Tuple[str, Pose]]:
        """Return the transforms to send now, source frame and pose; they count as sent.

        Parameters
        ----------
        find : callable
            Returns the newest transform from a frame, its second argument, to another one, or None.
        """
        found = []
        for source in self.sources:
            pose = find(self.target, source)
            if pose is not None and self._matters(pose, self._sent.get(source)):
                self._sent[source] = pose
                found.append((source, pose))
        return found

    def _matters(self, pose: Pose, sent: Optional[Pose]) -> bool:
        if sent is None or self._angle == 0.0 or self._distance == 0.0:
            return True
        return distance(pose, sent) > self._distance or angle(pose, sent) > self._angle
