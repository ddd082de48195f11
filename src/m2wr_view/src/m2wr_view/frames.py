# SPDX-License-Identifier: BSD-3-Clause
"""Poses in the plane and in space, and a tree of the newest transforms between frames."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = Union[Sequence[float], NDArray[Any]]


def yaw_of(quaternion: Numbers) -> float:
    """Return the heading [rad] of a quaternion x y z w, counter-clockwise from x."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def rotation_of(quaternion: Numbers) -> NDArray[np.float64]:
    """Return the matrix (3, 3) of a quaternion x y z w of any length; one of length 0 counts as no rotation."""
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if not square > 0.0:
        return np.eye(3)
    s = 2.0 / square
    return np.array(((1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
                     (s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)),
                     (s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y))))


def matrix_of(position: Numbers, quaternion: Numbers) -> NDArray[np.float64]:
    """Return the transform of a position and a rotation.

    Parameters
    ----------
    position : (3,) floats
        [m].
    quaternion : (4,) floats
        x y z w, of any length.

    Returns
    -------
    (4, 4) float64
        Homogeneous.
    """
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_of(quaternion), position
    return matrix


def matrices_of(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the transforms (n, 4, 4) of many poses (n, 7): position [m] and quaternion x y z w, of any length."""
    x, y, z, w = poses[:, 3:].T
    square = x * x + y * y + z * z + w * w
    s = np.divide(2.0, square, out=np.zeros_like(square), where=square > 0.0)       # of length 0: no rotation
    matrices = np.zeros((len(poses), 4, 4))
    matrices[:, 0, 0], matrices[:, 1, 1], matrices[:, 2, 2] = (
        1.0 - s * (y * y + z * z), 1.0 - s * (x * x + z * z), 1.0 - s * (x * x + y * y))
    matrices[:, 0, 1], matrices[:, 1, 0] = s * (x * y - z * w), s * (x * y + z * w)
    matrices[:, 0, 2], matrices[:, 2, 0] = s * (x * z + y * w), s * (x * z - y * w)
    matrices[:, 1, 2], matrices[:, 2, 1] = s * (y * z - x * w), s * (y * z + x * w)
    matrices[:, :3, 3], matrices[:, 3, 3] = poses[:, :3], 1.0
    return matrices


def matrix_from_rpy(xyz: Numbers, rpy: Numbers) -> NDArray[np.float64]:
    """Return the transform of a URDF origin.

    Parameters
    ----------
    xyz : (3,) floats
        Position [m].
    rpy : (3,) floats
        Roll, pitch and yaw about fixed axes [rad].

    Returns
    -------
    (4, 4) float64
        Homogeneous.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    matrix = np.eye(4)
    matrix[:3, :3] = ((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                      (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr), (-sp, cp * sr, cp * cr))
    matrix[:3, 3] = xyz
    return matrix


def inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse (4, 4) of a transform, a rotation and a translation."""
    back = np.eye(4)
    back[:3, :3] = matrix[:3, :3].T
    back[:3, 3] = -back[:3, :3].dot(matrix[:3, 3])
    return back


def planar(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x, y [m] and yaw [rad] (3,) of a transform (4, 4)."""
    return np.array((matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])))


def compose(outer: Numbers, inner: Numbers) -> NDArray[np.float64]:
    """Return the composition of two planar poses.

    Parameters
    ----------
    outer : (3,) floats
        x, y [m] and yaw [rad] of a frame.
    inner : (3,) floats
        A pose in that frame.

    Returns
    -------
    (3,) float64
        The pose in the frame of ``outer``'s parent.
    """
    cosine, sine = math.cos(outer[2]), math.sin(outer[2])
    return np.array((outer[0] + cosine * inner[0] - sine * inner[1], outer[1] + sine * inner[0] + cosine * inner[1],
                     outer[2] + inner[2]))


_NOT_KNOWN = np.full((4, 4), math.nan)     # the matrix of a transform that is not computed yet


class Frames:
    """The newest transform of every frame to its parent."""

    def __init__(self) -> None:
        self._parents: Dict[str, Tuple[str, NDArray[np.float64]]] = {}
        self._poses: Dict[str, Tuple[Numbers, Numbers]] = {}    # of frames whose matrix was not asked for yet

    def set(self, parent: str, child: str, matrix: NDArray[np.float64]) -> None:
        """Store a transform.

        Parameters
        ----------
        parent, child : str
            Names of frames; leading slashes are dropped.
        matrix : (4, 4) float64
            ``parent_from_child``.
        """
        child = child.lstrip("/")
        self._poses.pop(child, None)
        self._parents[child] = (parent.lstrip("/"), matrix)

    def set_pose(self, parent: str, child: str, position: Numbers, quaternion: Numbers) -> None:
        """Store a transform; of many that follow each other, only the last is computed.

        Parameters
        ----------
        parent, child : str
            Names of frames; leading slashes are dropped.
        position : (3,) floats
            [m].
        quaternion : (4,) floats
            x y z w, of any length.
        """
        child = child.lstrip("/")
        self._poses[child] = position, quaternion
        self._parents[child] = (parent.lstrip("/"), _NOT_KNOWN)

    def names(self) -> List[str]:
        """Return the names of all frames that have a parent."""
        return list(self._parents)

    def parents(self) -> Dict[str, str]:
        """Return the parent of each frame that has one."""
        return {child: parent for child, (parent, _) in list(self._parents.items())}

    def root_chain(self, frame: str) -> List[Tuple[str, NDArray[np.float64]]]:
        """Return [(frame, root_from_frame seen from it)] from a frame up to its root, itself first."""
        frame, matrix = frame.lstrip("/"), np.eye(4)
        chain: List[Tuple[str, NDArray[np.float64]]] = []
        while len(chain) <= len(self._parents):         # ends also if parents form a loop
            chain.append((frame, matrix))
            if frame not in self._parents:
                break
            parent, step = self._parents[frame]
            if step is _NOT_KNOWN:
                step = matrix_of(*self._poses.pop(frame))
                self._parents[frame] = (parent, step)
            frame, matrix = parent, step.dot(matrix)
        return chain

    def between(self, target: str, source: str) -> Optional[NDArray[np.float64]]:
        """Return the transform between two frames.

        Parameters
        ----------
        target, source : str
            Names of frames.

        Returns
        -------
        (4, 4) float64 or None
            ``target_from_source``; None if the frames are not connected.
        """
        above = dict(self.root_chain(target))
        for frame, matrix in self.root_chain(source):
            if frame in above:
                return inverse(above[frame]).dot(matrix)
        return None
