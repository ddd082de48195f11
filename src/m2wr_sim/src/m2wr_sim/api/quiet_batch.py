# SPDX-License-Identifier: BSD-3-Clause
"""Steps many worlds together in which no plugin but the drive acts; the numbers are those of Simulator.advance."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, List, Sequence, Tuple

import numpy as np

from m2wr_sim.plugins.base import LazySensor, Plugin

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.api.devices import DirectDrive, DirectLaser, DirectSimulator

    Indices = NDArray[np.int64]


def is_quiet(simulator: DirectSimulator, drive: DirectDrive) -> bool:
    """Return whether all other plugins sleep, and the drive only sets its motors; to be asked after each reset.

    Parameters
    ----------
    simulator : DirectSimulator
    drive : DirectDrive

    Returns
    -------
    bool
    """
    return drive.steady and not simulator.paused and all(
        plugin is drive or _sleeps(plugin, simulator.now_ns) for plugin, _, _ in simulator.plugins.entries())


def _sleeps(plugin: Plugin, now_ns: int) -> bool:
    """Return whether a plugin neither acts nor measures until something outside of the simulation wakes it."""
    acts = type(plugin).after_step is not Plugin.after_step and not isinstance(plugin, LazySensor)
    return not acts and plugin.next_before(now_ns) is None and plugin.next_after(now_ns) is None


class QuietBatch:
    """Worlds with one robot each, some of which are quiet.

    Parameters
    ----------
    worlds : sequence of (DirectSimulator, DirectDrive, DirectLaser, int)
        The number is the simulated time of :meth:`step` [ns], a multiple of the physics step.
    ranges : (n, beams) float32
        Gets the scans [m].

    Attributes
    ----------
    quiet : (n,) bool
        The worlds that :meth:`step` can step, by :meth:`begin`.
    motions : (n, 13) float64
        Pose and velocity of the robots after :meth:`step`, see
        :meth:`m2wr_sim.plugins.base.PluginContext.motion_reader`.
    """

    def __init__(self, worlds: Sequence[Tuple[DirectSimulator, DirectDrive, DirectLaser, int]],
                 ranges: NDArray[np.float32]) -> None:
        count = len(worlds)
        self.quiet, self.motions, self._ranges = np.zeros(count, bool), np.zeros((count, 13)), ranges
        self._packed = np.zeros(count, bool)            # whose scans compiled code takes
        self._counts, self._taken = np.zeros((count, 2), np.int64), np.zeros((count, 2), np.int64)
        self._rates = np.zeros((count, 2))
        self._compiled = all(simulator.engine.compiled for simulator, _, _, _ in worlds)
        if not self._compiled:
            return
        # There is a compiler, as there are compiled engines.
        from m2wr_sim.api import quiet_kernels

        self._kernels: Any = quiet_kernels
        self._rows = np.zeros((count, quiet_kernels.QUIET_WORDS), np.uint64)
        self._worlds: List[_Quiet] = [
            _Quiet(*world, self.motions[index], ranges[index]) for index, world in enumerate(worlds)]

    def begin(self, index: int) -> bool:
        """Find out whether a world is quiet, after its reset, and return it."""
        self.quiet[index] = self._compiled and self._worlds[index].begins()
        if self.quiet[index]:
            self._fill(index)
        return bool(self.quiet[index])

    def _fill(self, index: int) -> None:
        """Write the row of addresses of a world."""
        self._packed[index] = self._worlds[index].write(self._rows[index], self._kernels)

    def step(self, chosen: Indices, commands: Sequence[Sequence[float]]) -> List[int]:
        """Drive the robots of quiet worlds, and take their scans.

        Parameters
        ----------
        chosen : (k,) int64
            Which worlds.
        commands : (n, 2) sequence of float
            Linear x [m/s] and angular z [rad/s] for each world.

        Returns
        -------
        list of int
            The worlds whose simulator has new contacts.

        Raises
        ------
        LostError
            If a body has left a world.
        """
        kernels, worlds = self._kernels, self._worlds
        for index in chosen.tolist():
            world = worlds[index]
            if world.changed():
                self._fill(index)
            world.prepare(commands[index], self._counts[index], self._rates[index])
        kernels.drive_all(self._rows, chosen, self._counts, self._rates, self._taken)
        ended = (self._taken[chosen] != self._counts[chosen]).any(axis=1)
        for index in chosen[ended].tolist():
            worlds[index].finish(self._counts[index].tolist(), self._taken[index].tolist(), self._rates[index])
        for index in chosen[~ended].tolist():
            worlds[index].count()
        kernels.read_all(self._rows, chosen)
        packed = self._packed[chosen]
        for index in chosen[packed].tolist():
            worlds[index].sensor.begin_scan()
        kernels.scan_all(self._rows, chosen[packed])
        for index in chosen[~packed].tolist():
            self._ranges[index] = worlds[index].laser.measure()[0]
        return [index for index in chosen[ended].tolist() if worlds[index].simulator.contacts]


class _Quiet:
    """One world of a batch.

    Parameters
    ----------
    simulator : DirectSimulator
    drive : DirectDrive
    laser : DirectLaser
    length_ns : int
        Simulated time of a step of the batch [ns].
    motion : (13,) float64
        Gets pose and velocity of the robot.
    ranges : (beams,) float32
        Gets the scans that compiled code takes [m].
    """

    def __init__(self, simulator: DirectSimulator, drive: DirectDrive, laser: DirectLaser, length_ns: int,
                 motion: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        self.simulator, self.laser, self.sensor = simulator, laser, laser.sensor
        self._drive, self._ranges = drive, ranges
        self._engine: Any = simulator.engine            # a NativeEngine
        self._read_motion: Any = drive.motion_reader(motion)
        self._words, self._length_ns = np.zeros(0, np.uint64), length_ns
        self._steps = length_ns // simulator.step_ns

    def begins(self) -> bool:
        """Return whether the world is quiet, and its drive turns two hinges."""
        return is_quiet(self.simulator, self._drive) and hasattr(self._read_motion, "table") and all(
            map(self._engine.hinge_handle, self._drive.joints))

    def changed(self) -> bool:
        """Return whether the world has been changed from outside since :meth:`write`."""
        return self._engine.words is not self._words

    def write(self, row: NDArray[np.uint64], kernels: Any) -> bool:
        """Write the world's addresses into a row for the kernels; return whether compiled code can take its scans."""
        engine, self._words = self._engine, self._engine.words
        left, right = (engine.hinge_handle(joint) for joint in self._drive.joints)
        robot = self._read_motion
        robot.update()
        row[:kernels.Q_LASER] = (self._words.ctypes.data, self._words.size, left, right, robot.table.ctypes.data,
                                 robot.out.ctypes.data)
        moving = self.simulator.moving_shapes()
        eye: Any = self.laser.pose_reader
        block = self.sensor.packed_scan(self.simulator.scene)
        if block is None or moving is None or not hasattr(eye, "table"):
            return False
        shapes: Any = moving[0]
        mover: Any = moving[1]
        mover.update()
        if mover.rests or not (eye.update() and shapes.update()):
            return False
        row[kernels.Q_LASER:kernels.Q_MOVE] = (
            eye.table.ctypes.data, eye.out.ctypes.data, shapes.table.ctypes.data, shapes.out.ctypes.data,
            len(shapes.table))
        row[kernels.Q_MOVE:kernels.Q_SCAN] = mover.block
        row[kernels.Q_SCAN:] = block
        row[kernels.Q_SCAN + kernels.S_RANGES] = self._ranges.ctypes.data
        return True

    def prepare(self, command: Sequence[float], counts: Indices, rates: NDArray[np.float64]) -> None:
        """Give the drive a command, write steps before and after it takes effect and the rates, and count the time."""
        simulator, drive = self.simulator, self._drive
        step_ns, now_ns = simulator.step_ns, simulator.now_ns
        end_ns = now_ns + self._length_ns
        drive.command(command[0], command[1])
        before_ns = drive.next_before(now_ns) - step_ns - now_ns        # until the next update of the drive
        before = 0 if before_ns <= 0 else min(before_ns, self._length_ns) // step_ns
        counts[0], counts[1] = before, self._steps - before
        if counts[1]:
            rates[0], rates[1] = drive.wheel_rates(now_ns)
            drive.skip_updates(end_ns)                  # they would set the same rates
        simulator.now_ns, simulator.steps = end_ns, simulator.steps + self._steps

    def count(self) -> None:
        """Count the steps that compiled code has made."""
        self._engine.count_run(self._steps, self._steps)

    def finish(self, counts: Sequence[int], taken: Sequence[int], rates: NDArray[np.float64]) -> None:
        """Take over events, and make the steps that compiled code has not made."""
        engine = self._engine
        if counts[0]:
            engine.count_run(taken[0], counts[0])
        if counts[1]:
            if taken[0] != counts[0]:
                self._drive.turn_wheels(*rates.tolist())
                engine.step(counts[1])
            else:
                engine.count_run(taken[1], counts[1])
        self.simulator.collect_contacts()
