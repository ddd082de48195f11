# SPDX-License-Identifier: BSD-3-Clause
"""Many independent copies of a world, stepped together: arrays in, arrays out."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, List, Optional, Sequence, Union

import numpy as np

from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.api.sim import Sim
from m2wr_sim.runtime.once_logger import suppress_warnings

if TYPE_CHECKING:
    import os

    import numpy.typing as npt
    from numpy.typing import NDArray

    from m2wr_sim.api.records import StepResult
    from m2wr_sim.model.types import Model, World


@dataclass(frozen=True)
class VectorResult:
    """Result of a step or a reset of n worlds, one row per world; NaN where nothing has been measured yet.

    Attributes
    ----------
    time : (n,) float64
        Simulated time [s].
    pose : (n, 3) float64
        True x, y [m], yaw [rad] of the robot in its world.
    odometry : (n, 6) float64
        x, y [m], yaw [rad], linear x, linear y [m/s], angular z [rad/s].
    ranges : (n, beams) float32
        Of the robot's first laser [m], +inf for no hit.
    contacts : (n,) int64
        Number of contacts that began since the previous step, except with the ground.
    """

    time: NDArray[np.float64]
    pose: NDArray[np.float64]
    odometry: NDArray[np.float64]
    ranges: NDArray[np.float32]
    contacts: NDArray[np.int64]


class VectorSim:
    """n independent worlds with one robot each.

    World i has the seed ``seed + i`` and gives the same results, to the last bit, as a :class:`~m2wr_sim.api.sim.Sim`
    with that seed.  The worlds are stepped one after the other, because libode cannot step two worlds of a process at
    once.

    Parameters
    ----------
    count : int
        Number of worlds, n.
    world, robot
        As for :class:`~m2wr_sim.api.sim.Sim`; read once.
    pose : array_like
        (3,) for all or (n, 3): x, y [m], yaw [rad].
    seed : int
    sensing : str
        As for Sim; ``now`` by default, so that every row is measured at the end of the step.
    **options
        The other options of Sim.

    Attributes
    ----------
    sims : tuple of Sim
        The worlds, for everything that has no method here.

    Raises
    ------
    ValueError
        If there is no world, or ``pose`` does not match the number of worlds.
    """

    def __init__(self, count: int, world: Union[World, str, os.PathLike[str]] = "empty",
                 robot: Union[Model, str, os.PathLike[str]] = "m2wr", pose: npt.ArrayLike = (0.0, 0.0, 0.0),
                 seed: int = 0, sensing: str = "now", **options: Any) -> None:
        if count < 1:
            raise ValueError("%r worlds; expected at least one" % (count,))
        world, robot, poses = read_world(world), read_robot(robot), _rows("pose", pose, count, 3)
        sims: List[Sim] = []
        try:
            for index in range(count):
                with suppress_warnings(index > 0):
                    sims.append(Sim(world, robot, tuple(poses[index]), seed + index, sensing, **options))
        except Exception:
            for sim in sims:
                sim.close()
            raise
        self.sims = tuple(sims)
        lasers = sims[0].lasers()
        self._beams = lasers[0].count if lasers else 0

    def __len__(self) -> int:
        return len(self.sims)

    def step(self, commands: Optional[npt.ArrayLike] = None, duration: float = 0.05) -> VectorResult:
        """Drive all robots for some simulated time.

        Parameters
        ----------
        commands : (n, 2) or (2,) array_like, optional
            Linear [m/s] and angular [rad/s] velocity of each robot, or of all; None: the last commands stay active.
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

    def reset(self, seed: Optional[int] = None, poses: Optional[npt.ArrayLike] = None,
              where: Optional[npt.ArrayLike] = None) -> VectorResult:
        """Restart all worlds, or some of them.

        Parameters
        ----------
        seed : int, optional
            World i gets ``seed + i``; None: the old seeds.
        poses : (n, 3) or (3,) array_like, optional
            New initial poses: x, y [m], yaw [rad].
        where : (n,) bool array_like, optional
            Which worlds; None: all.  The others stay as they are.

        Returns
        -------
        VectorResult

        Raises
        ------
        ValueError
            If ``poses`` or ``where`` does not match the number of worlds.
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

    def _gather(self, results: Sequence[StepResult]) -> VectorResult:
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

    def close(self) -> None:
        """Free all worlds."""
        for sim in self.sims:
            sim.close()

    def __enter__(self) -> VectorSim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _rows(name: str, values: npt.ArrayLike, count: int, width: int) -> NDArray[np.float64]:
    """Return values as (count, width), from an array of this shape or one row for all."""
    rows = np.asarray(values, dtype=float)
    if rows.shape == (width,):
        rows = np.broadcast_to(rows, (count, width))
    if rows.shape != (count, width):
        raise ValueError("%s of shape %s for %d worlds; expected (%d,) or (%d, %d)"
                         % (name, rows.shape, count, width, count, width))
    return rows
