# SPDX-License-Identifier: BSD-3-Clause
"""Poses in the plane and in space, and a tree of the newest transforms between frames."""
import math

import numpy as np


def yaw_of(quaternion):
    """Return the heading [rad] of a quaternion x y z w, counter-clockwise from x."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def rotation_of(quaternion):
    """Return the matrix (3, 3) of a quaternion x y z w of any length; one of length 0 counts as no rotation."""
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if not square > 0.0:
        return np.eye(3)
    s = 2.0 / square
    return np.array(((1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
                     (s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)),
                     (s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y))))


def matrix_of(position, quaternion):
    """Return the transform (4, 4) of a position [m] and a quaternion x y z w."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_of(quaternion), position
    return matrix


def matrix_from_rpy(xyz, rpy):
    """Return the transform (4, 4) of a URDF origin: position [m], roll, pitch and yaw [rad] about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    matrix = np.eye(4)
    matrix[:3, :3] = ((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                      (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr), (-sp, cp * sr, cp * cr))
    matrix[:3, 3] = xyz
    return matrix


def inverse(matrix):
    """Return the inverse (4, 4) of a transform, a rotation and a translation."""
    back = np.eye(4)
    back[:3, :3] = matrix[:3, :3].T
    back[:3, 3] = -back[:3, :3].dot(matrix[:3, 3])
    return back


def planar(matrix):
    """Return x, y [m] and yaw [rad] (3,) of a transform (4, 4)."""
    return np.array((matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])))


def compose(outer, inner):
    """Return the planar pose (3,) of ``inner``, given in the frame whose planar pose is ``outer``."""
    cosine, sine = math.cos(outer[2]), math.sin(outer[2])
    return np.array((outer[0] + cosine * inner[0] - sine * inner[1], outer[1] + sine * inner[0] + cosine * inner[1],
                     outer[2] + inner[2]))


class Frames:
    """The newest transform of every frame to its parent."""

    def __init__(self):
        self._parents = {}

    def set(self, parent, child, matrix):
        """Store ``parent_from_child`` (4, 4); leading slashes of names are dropped."""
        self._parents[child.lstrip("/")] = (parent.lstrip("/"), matrix)

    def root_chain(self, frame):
        """Return [(frame, root_from_frame seen from it)] from a frame up to its root, itself first."""
        frame, matrix, chain = frame.lstrip("/"), np.eye(4), []
        while len(chain) <= len(self._parents):         # ends also if parents form a loop
            chain.append((frame, matrix))
            if frame not in self._parents:
                break
            frame, step = self._parents[frame]
            matrix = step.dot(matrix)
        return chain

    def between(self, target, source):
        """Return ``target_from_source`` (4, 4), or None if the frames are not connected."""
        above = dict(self.root_chain(target))
        for frame, matrix in self.root_chain(source):
            if frame in above:
                return inverse(above[frame]).dot(matrix)
        return None
