# SPDX-License-Identifier: BSD-3-Clause
"""Drives a robot while no other plugin acts: the numbers of Simulator.advance, without asking all plugins."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_sim.plugins.base import LazySensor, Plugin

if TYPE_CHECKING:
    from m2wr_sim.api.devices import DirectDrive, DirectSimulator


class QuietRun:
    """The steps of a robot whose drive is the only plugin that acts.

    Parameters
    ----------
    simulator : DirectSimulator
    drive : DirectDrive
    """

    def __init__(self, simulator: DirectSimulator, drive: DirectDrive) -> None:
        self._simulator, self._drive = simulator, drive

    def possible(self) -> bool:
        """Return whether all other plugins sleep, and the drive only sets its motors; to be asked after each reset."""
        simulator = self._simulator
        return self._drive.steady and not simulator.paused and all(
            plugin is self._drive or _sleeps(plugin, simulator.now_ns)
            for plugin, _, _ in simulator.plugins.entries())

    def run(self, linear: float, angular: float, end_ns: int) -> None:
        """Drive with a command up to a time.

        Parameters
        ----------
        linear, angular : float
            [m/s, rad/s]
        end_ns : int
            A time at which a step ends [ns].
        """
        simulator, drive = self._simulator, self._drive
        step_ns, now_ns = simulator.step_ns, simulator.now_ns
        drive.command(linear, angular)
        due_ns = drive.next_before(now_ns)
        if now_ns < due_ns - step_ns:               # the command waits for the next update
            now_ns = min(due_ns - step_ns, end_ns)
            simulator.run_quietly((now_ns - simulator.now_ns) // step_ns)
        if now_ns < end_ns:
            drive.before_step(now_ns + step_ns)
            drive.skip_updates(end_ns)              # they would set the same targets
            simulator.run_quietly((end_ns - now_ns) // step_ns)


def _sleeps(plugin: Plugin, now_ns: int) -> bool:
    """Return whether a plugin neither acts nor measures until something outside of the simulation wakes it."""
    acts = type(plugin).after_step is not Plugin.after_step and not isinstance(plugin, LazySensor)
    return not acts and plugin.next_before(now_ns) is None and plugin.next_after(now_ns) is None
