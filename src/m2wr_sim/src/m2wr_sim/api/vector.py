# SPDX-License-Identifier: BSD-3-Clause
"""Many independent worlds of one make, stepped together: arrays in, arrays out."""
from dataclasses import dataclass

import numpy as np

from m2wr_sim.api.devices import said_once
from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.api.sim import Sim


@dataclass(frozen=True)
class VectorResult:
    """What a step or a reset of n worlds ends with; one row a world, NaN for what has not been measured yet.

    Attributes
    ----------
    time : (n,) float64
        Simulated time [s].
    pose : (n, 3) float64
        True x, y [m], yaw [rad] of the robot in its world.
    odometry : (n, 6) float64
        x, y [m], yaw [rad], linear x, linear y [m/s], angular z [rad/s].
    ranges : (n, beams) float32
        Of the robot's first laser [m], +inf where nothing was hit.
    contacts : (n,) int64
        Contacts begun since the step before, other than standing on the ground.
    """

    time: np.ndarray
    pose: np.ndarray
    odometry: np.ndarray
    ranges: np.ndarray
    contacts: np.ndarray


class VectorSim:
    """n worlds with a robot each, which know nothing of one another.

    World i is seeded with ``seed + i`` and gives, bit for bit, what a :class:`~m2wr_sim.api.sim.Sim` of it gives.
    The worlds are stepped one after the other: libode cannot step two worlds of a process at once.

    Parameters
    ----------
    count : int
        n.
    world, robot
        As for :class:`~m2wr_sim.api.sim.Sim`; read once.
    pose : array_like
        (3,) for all or (n, 3): x, y [m], yaw [rad].
    seed : int
    sensing : str
        As for Sim; ``now`` by default, so that every row is as new as the step.
    **options
        The other options of Sim.

    Attributes
    ----------
    sims : tuple of Sim
        The worlds, for whatever has no method here.
    """

    def __init__(self, count, world="empty", robot="m2wr", pose=(0.0, 0.0, 0.0), seed=0, sensing="now", **options):
        if count < 1:
            raise ValueError("%r worlds; expected at least one" % (count,))
        world, robot, poses = read_world(world), read_robot(robot), _rows("pose", pose, count, 3)
        sims = []
        try:
            for index in range(count):
                with said_once(index > 0):
                    sims.append(Sim(world, robot, tuple(poses[index]), seed + index, sensing, **options))
        except Exception:
            for sim in sims:
                sim.close()
            raise
        self.sims = tuple(sims)
        lasers = sims[0].lasers()
        self._beams = lasers[0].count if lasers else 0

    def __len__(self):
        return len(self.sims)

    def step(self, commands=None, duration=0.05):
        """Drive all robots on for a while.

        Parameters
        ----------
        commands : (n, 2) or (2,) array_like, optional
            Linear [m/s] and angular [rad/s] velocity of each robot, or of all; None: the last ones hold.
        duration : float
            Simulated time [s].

        Returns
        -------
        VectorResult
            Its arrays are new with every call.

        Raises
        ------
        ValueError
            If there are not as many commands as worlds.
        """
        if commands is None:
            return self._gather([sim.step(None, duration) for sim in self.sims])
        rows = _rows("commands", commands, len(self.sims), 2)
        return self._gather([sim.step(row, duration) for sim, row in zip(self.sims, rows)])

    def reset(self, seed=None, poses=None, where=None):
        """Start over.

        Parameters
        ----------
        seed : int, optional
            World i gets ``seed + i``; the old seeds where None.
        poses : (n, 3) or (3,) array_like, optional
            New places to start from.
        where : (n,) bool array_like, optional
            Which worlds; all where None.  The others stay as they are.

        Returns
        -------
        VectorResult
        """
        rows = None if poses is None else _rows("poses", poses, len(self.sims), 3)
        chosen = np.ones(len(self.sims), bool) if where is None else np.asarray(where, dtype=bool)
        if chosen.shape != (len(self.sims),):
            raise ValueError("where of shape %s for %d worlds; expected one truth value for each"
                             % (chosen.shape, len(self.sims)))
        results = []
        for index, sim in enumerate(self.sims):
            if chosen[index]:
                results.append(sim.reset(None if seed is None else seed + index,
                                         None if rows is None else tuple(rows[index])))
            else:
                results.append(sim.observe())
        return self._gather(results)

    def _gather(self, results):
        count = len(results)
        odometry = np.full((count, 6), np.nan)
        ranges = np.full((count, self._beams), np.nan, np.float32)
        time, pose, contacts = np.empty(count), np.empty((count, 3)), np.zeros(count, np.int64)
        for index, result in enumerate(results):
            (robot,) = result.robots.values()
            time[index], pose[index], contacts[index] = result.time, robot.pose, len(robot.contacts)
            measured = robot.odometry
            if measured is not None:
                odometry[index] = measured.pose + (measured.linear_x, measured.linear_y, measured.angular_z)
            if robot.scan is not None:
                ranges[index] = robot.scan.ranges
        return VectorResult(time, pose, odometry, ranges, contacts)

    def close(self):
        """Free all worlds."""
        for sim in self.sims:
            sim.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def _rows(name, values, count, width):
    values = np.asarray(values, dtype=float)
    if values.shape == (width,):
        values = np.broadcast_to(values, (count, width))
    if values.shape != (count, width):
        raise ValueError("%s of shape %s for %d worlds; expected (%d,) or (%d, %d)"
                         % (name, values.shape, count, width, count, width))
    return values
