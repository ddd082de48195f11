"""Steps of the path, kept so that they can be told where the centre of turning is once that is known.

A robot that turns before a long wall does not see how far along it odometry leads it, if that tells of a point beside
the axle. Where the centre is found out later, the beginning of the path is known better than when it was driven. What
else odometry lacks changes with the ground, and is not told here.
"""
import numpy as np

from m2wr_gmapping import hindsight_kernels as kernels

FIRST_STEPS = 256
LOOK_EVERY, LOOK_SHARE = 8, 8       # steps between two looks: that many, and one of that many steps of the path
WORTH = 0.01                        # nodes that move by more are worth a new map [m]


class Hindsight:
    """Keeps what is known of each step to a processed scan.

    Parameters
    ----------
    ahead : (2,) float
        Forward direction of the base in the laser's frame.
    """

    def __init__(self, ahead):
        self._ahead = np.array(ahead, float)
        self._steps, self._count, self._looked_at = np.zeros((FIRST_STEPS, kernels.STEP_SIZE)), 0, 0

    def room(self):
        """Return the row (STEP_SIZE,) of the next step; to be written."""
        if self._count == len(self._steps):
            self._steps = np.concatenate([self._steps, np.zeros_like(self._steps)])
        self._count += 1
        return self._steps[self._count - 1]

    @property
    def due(self):
        """Whether to look back: seldom enough that it costs next to nothing."""
        return self._count - self._looked_at >= LOOK_EVERY + self._count // LOOK_SHARE

    def look(self, path, centre):
        """Return what the steps of a path lack by what is known now, and the path with that.

        Parameters
        ----------
        path : (K, 3) float64
            Poses at all processed scans; the first is where it began.
        centre : float
            How far odometry's centre lies ahead of that of turning [m].

        Returns
        -------
        changes : (K, 3) float64, or None where it is not worth while
            To be appended to each step, in the axes of the pose it leads to.
        path : (K, 3) float64
        """
        self._looked_at = self._count
        changes, found = np.zeros_like(path), np.empty_like(path)
        if self._count:
            kernels.look_back(self._steps, self._count, centre, self._ahead, changes[1:])
        kernels.changed(path, changes, found)
        if not (np.abs(found - path)[:, :2] > WORTH).any():
            return None, path
        self._steps[:self._count, kernels.APPLIED:] += changes[1:, :2]
        return changes, found

    # ---- saving

    def compact(self):
        """Return what is stored: the steps so far."""
        return dict(steps=self._steps[:self._count], _looked_at=self._looked_at)

    def restore(self, stored):
        """Take over what ``compact`` returned."""
        steps, self._looked_at = stored["steps"], stored["_looked_at"]
        self._count = len(steps)
        self._steps = np.zeros((max(FIRST_STEPS, self._count), kernels.STEP_SIZE))
        self._steps[:self._count] = steps
