"""The rays of :mod:`m2wr_sim.sensors.ray_kernels` without numba: every shape against all beams, as array operations."""
import numpy as np

from m2wr_sim.sensors.ray_kernels import (BOX, COUNT, CYLINDER, HALF, IGNORED, KIND, ORIENTATION, OWNER, PLANE,
                                          RANGE_MAX, RANGE_MIN, TINY, rotation)


def _numpy_solid(kind, direction, origin, half, nearest):
    """Ranges to one shape along ``direction`` (B, 3) from ``origin`` (3,), both in the shape's axes."""
    direction = np.where(np.abs(direction) < TINY, TINY, direction)
    one, two = (-half - origin) / direction, (half - origin) / direction
    enter, leave = np.minimum(one, two), np.maximum(one, two)
    if kind == BOX:
        enter, leave = enter.max(axis=1), leave.min(axis=1)
    else:
        axes = 2 if kind == CYLINDER else 3
        flat, start = direction[:, :axes], origin[:axes]
        a, b = (flat * flat).sum(axis=1), flat @ start
        miss = start - flat * (b / a)[:, None]
        left = a * (half[0] * half[0] - (miss * miss).sum(axis=1))
        root = np.sqrt(np.maximum(left, 0.0))
        ends = (-b - root) / a, np.where(left >= 0.0, (root - b) / a, -np.inf)
        enter, leave = ends if axes == 3 else (np.maximum(ends[0], enter[:, 2]), np.minimum(ends[1], leave[:, 2]))
    t = np.where(enter > nearest, enter, leave)
    return np.where((leave >= enter) & (t > nearest), t, np.inf)


def cast_rays_numpy(ranges, hits, beams, rows, frame, spheres, shapes, order):
    """Do what ``ray_kernels.cast_rays`` does; same arguments, ``order`` is not used."""
    ranges[:] = frame[RANGE_MAX]
    hits[:] = -1
    flat = np.empty((rows.shape[0], beams.shape[1], 3))
    flat[:, :, 0], flat[:, :, 1] = rows[:, :1] * beams[0], rows[:, :1] * beams[1]
    flat[:, :, 2] = rows[:, 1:]
    with np.errstate(all='ignore'):
        sensor = np.array(rotation(*frame[ORIENTATION:ORIENTATION + 4])).reshape(3, 3)
        rays = flat.reshape(-1, 3) @ sensor.T
        centres = spheres[:3, :int(frame[COUNT])].T - frame[:3]
        reach = np.sqrt((centres * centres).sum(axis=1)) - spheres[3, :centres.shape[0]]
        for row in np.flatnonzero(reach <= frame[RANGE_MAX]):
            shape, centre = shapes[row], centres[row]
            if frame[IGNORED] >= 0.0 and shape[OWNER] == frame[IGNORED]:
                continue
            if shape[KIND] == PLANE:
                t = (shape[:3] @ centre) / (rays @ shape[:3])
                t = np.where(t > frame[RANGE_MIN], t, np.inf)
            else:
                turn = shape[:9].reshape(3, 3)
                t = _numpy_solid(shape[KIND], rays @ turn, -centre @ turn, shape[HALF:KIND], frame[RANGE_MIN])
            nearer = t < ranges
            ranges[nearer] = t[nearer]
            if hits.size:
                hits[nearer] = row
