# SPDX-License-Identifier: BSD-3-Clause
"""Initial state of a run: empty, a saved map, or the state of an earlier run. Used by node and replay."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Collection, List, Optional, Tuple

import numpy as np

from m2wr_gmapping.frontend.scan import ScanError
from m2wr_gmapping.io import state
from m2wr_gmapping.mapper import Mapper, is_usable
from m2wr_maps.saved_map_reader import read_map
from m2wr_maps.se2 import compose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.frontend.scan import LaserModel, ScanReading
    from m2wr_gmapping.io.state import State
    from m2wr_maps.saved_map import SavedMap
    from m2wr_node.array_types import FloatArray

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

    def __init__(self, saved: Optional[SavedMap] = None, pose: Optional[ArrayLike] = None,
                 loaded: Optional[State] = None, runs_on: bool = True) -> None:
        self._saved, self._pose, self.loaded, self._runs_on = saved, pose, loaded, runs_on
        self._connected = False

    @classmethod
    def from_files(cls, config: GmappingConfig, map_file: str = "", pose: Optional[ArrayLike] = None,
                   state_file: str = "", runs_on: bool = True) -> Tuple[InitialState, GmappingConfig]:
        """Read the files.

        Parameters
        ----------
        config : GmappingConfig
            Of the running program.
        map_file : str
            YAML file of a saved map; empty: none.
        pose : (3,) float, optional
            See the class.
        state_file : str
            State of an earlier run; empty: none.
        runs_on : bool
            See the class.

        Returns
        -------
        InitialState, GmappingConfig
            The configuration has the cell size of the map, or the parameters of the state.

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
        values = dict(config.values, delta=saved.resolution)
        return cls(saved, pose), replace(config, values=values)

    def differing(self, given: Collection[str]) -> List[str]:
        """Return messages about parameters (names ``given``) that the state overrides."""
        if self.loaded is None:
            return []
        return [text for name, text in self.loaded.differing.items() if name in given]

    def mapper(self, config: GmappingConfig, laser: LaserModel) -> Mapper:
        """Return the Mapper for a laser.

        Parameters
        ----------
        config : GmappingConfig
        laser : LaserModel
            Of the first scan.

        Raises
        ------
        ScanError
            If the state has another laser.
        """
        if self.loaded is None:
            return Mapper(config, laser)
        there = self.loaded.mapper.laser
        if there.angles.shape != laser.angles.shape or not np.allclose(there.angles, laser.angles, atol=SAME):
            raise ScanError("{} beams over {:.3f} rad; the laser of the state has {} over {:.3f}".format(
                len(laser.angles), float(np.ptp(laser.angles)), len(there.angles), float(np.ptp(there.angles))))
        if not np.allclose(there.base_from_sensor, laser.base_from_sensor, atol=SAME):
            raise ScanError("the laser is mounted at {} on the base; that of the state at {}".format(
                np.round(laser.base_from_sensor, 3).tolist(), np.round(there.base_from_sensor, 3).tolist()))
        return self.loaded.mapper

    def connect(self, mapper: Mapper, reading: ScanReading, odom_pose: FloatArray, stamp: float) -> Optional[str]:
        """Prepare a mapper for its first scan, before ``process``. Later calls do nothing.

        Parameters
        ----------
        mapper : Mapper
        reading : ScanReading
            The first scan.
        odom_pose : (3,) float64
            Pose of the centred laser in ``odom`` [m, m, rad].
        stamp : float
            Time of the scan [s].

        Returns
        -------
        str or None
            For the log.
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
        x, y, theta = mapper.base_poses(mapper.pose).tolist()
        return "starts on the map {} with the base at ({:.2f}, {:.2f}), heading {:.2f} rad".format(
            self._saved.name, x, y, theta)

    def again(self) -> InitialState:
        """Return the InitialState after a jump back in time: a saved map is used again, a state is not."""
        return InitialState(self._saved, self._pose)
