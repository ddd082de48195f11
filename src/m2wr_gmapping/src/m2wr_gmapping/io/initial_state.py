# SPDX-License-Identifier: BSD-3-Clause
"""Initial state of a run: empty, a saved map, or the state of an earlier run. Used by node and replay."""
from dataclasses import replace

import numpy as np

from m2wr_gmapping.frontend.scan import ScanError
from m2wr_gmapping.io import state
from m2wr_gmapping.io.saved_map_reader import read_map
from m2wr_gmapping.mapper import Mapper, is_usable
from m2wr_gmapping.se2 import compose

SAME = 1e-3         # lasers agree within this [m, rad]


class InitialState:
    """Creates the mapper of a run, and connects it with the first scan.

    Parameters
    ----------
    saved : SavedMap, optional
        Map on which the run starts.
    pose : (3,) float, optional
        Pose of the base on that map at the first scan [m, m, rad]; default: the pose of odometry.
    loaded : State, optional
        State of an earlier run; its mapper is used once.
    runs_on : bool
        Whether odometry was not reset since that run.
    """

    def __init__(self, saved=None, pose=None, loaded=None, runs_on=True):
        self._saved, self._pose, self.loaded, self._runs_on = saved, pose, loaded, runs_on
        self._connected = False

    @classmethod
    def from_files(cls, config, map_file="", pose=None, state_file="", runs_on=True):
        """Read the files; returns an InitialState and the resulting configuration.

        Raises
        ------
        StateError, MapReadingError
            If a file cannot be used, or both are given.
        """
        if state_file and map_file:
            raise state.StateError("a state ({}) and a map ({}): expected one of them".format(state_file, map_file))
        if state_file:
            loaded = state.load(state_file, config)
            return cls(loaded=loaded, runs_on=runs_on), loaded.mapper.config
        if not map_file:
            return cls(), config
        saved = read_map(map_file)
        values = dict(config.as_dict(), delta=saved.resolution)
        return cls(saved, pose), replace(config, values=tuple(values.items()))

    def differing(self, given):
        """Return messages about parameters (names ``given``) that the state overrides."""
        if self.loaded is None:
            return []
        return [text for name, text in self.loaded.differing.items() if name in given]

    def mapper(self, config, laser):
        """Return the Mapper for a laser; raises ScanError if the state has another laser."""
        if self.loaded is None:
            return Mapper(config, laser)
        there = self.loaded.mapper.laser
        if there.angles.shape != laser.angles.shape or not np.allclose(there.angles, laser.angles, atol=SAME):
            raise ScanError("{} beams over {:.3f} rad; the laser of the state has {} over {:.3f}".format(
                len(laser.angles), np.ptp(laser.angles), len(there.angles), np.ptp(there.angles)))
        if not np.allclose(there.base_from_sensor, laser.base_from_sensor, atol=SAME):
            raise ScanError("the laser is mounted at {} on the base; that of the state at {}".format(
                np.round(laser.base_from_sensor, 3).tolist(), np.round(there.base_from_sensor, 3).tolist()))
        return self.loaded.mapper

    def connect(self, mapper, reading, odom_pose, stamp):
        """Prepare a mapper for its first scan, before ``process``; returns a log message or None.

        Later calls do nothing.
        """
        if self._connected or not is_usable(odom_pose, stamp):
            return None                 # ``process`` refuses the latter
        self._connected = True
        if self.loaded is not None:
            return state.connect_odometry(mapper, reading, odom_pose, stamp, self._runs_on)
        if self._saved is None:
            return None
        start = odom_pose if self._pose is None else compose(self._pose, mapper.laser.base_from_sensor)
        mapper.begin_on(self._saved, start, reading, odom_pose, stamp)
        x, y, theta = mapper.base_poses(mapper.pose)
        return "starts on the map {} with the base at ({:.2f}, {:.2f}), heading {:.2f} rad".format(
            self._saved.name, x, y, theta)

    def again(self):
        """Return the InitialState after a jump back in time: a saved map is used again, a state is not."""
        return InitialState(self._saved, self._pose)
