# SPDX-License-Identifier: BSD-3-Clause
"""Saving and loading of a mapper's state, so that a run continues with the same results.

See ``m2wr_files.state_file`` for the container and ``state_layout`` for the attributes. The stored values are checked
and then assigned to a new mapper. A file cannot run code or cause access outside an array.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Mapping, Optional, Tuple

import numpy as np

from m2wr_files import state_file
from m2wr_files.state_file import StateError
from m2wr_files.state_store import KindError, Store
from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.matcher import NO_PRIOR, WINDOW_MOST, FastMatcher
from m2wr_gmapping.io import state_layout
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.tuning import LINKS, MATCHING, ODOMETRY
from m2wr_maps.occupancy import Occupancy
from m2wr_maps.se2 import between, compose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray

# parameters of the program, not of the map: those of the running program are used
OWN = ("throttle_scans", "base_frame", "map_frame", "odom_frame", "map_update_interval", "transform_publish_period",
       "tf_delay", "threads")
MOST_WORDS = 1000       # characters of each value that the saving program added


@dataclass
class State:
    """What a state file held.

    Attributes
    ----------
    mapper : Mapper
        Ready for the next scan.
    host : dict
        Values that the saving program added.
    differing : dict
        Parameters of the running program that the state overrides: name -> both values.
    """

    mapper: Mapper
    host: Dict[str, Any]
    differing: Dict[str, str]


@dataclass(frozen=True)
class Snapshot:
    """Copy of a mapper's state; it shares no memory with the mapper."""

    document: Dict[str, Any]
    arrays: Dict[str, NDArray[Any]]


def snapshot(mapper: Mapper, host: Optional[Mapping[str, Any]] = None) -> Snapshot:
    """Return a copy of a mapper's state; call this between two scans, and while no map is made of it.

    Parameters
    ----------
    mapper : Mapper
    host : dict of str to str or number, optional
        Values of the program that are stored too.

    Raises
    ------
    StateError
        Before the first scan.
    """
    if mapper.filter is None:
        raise StateError("no state to save: no scan has been processed yet")
    store, ground = Store(), mapper._occupancy.ground
    try:
        state_layout.LASER.take(mapper.laser, "laser", store)
        if ground is not None:
            state_layout.GIVEN.take(ground, "saved_map", store)
        state_layout.MAPPER.take(mapper, "", store)
    except KindError as error:
        raise StateError("this mapper cannot be saved: {}".format(error)) from error
    return Snapshot(dict(config=dict(mapper.config.values), host=dict(host or {}), values=store.values), store.arrays)


def save(path: str, taken: Snapshot) -> None:
    """Write a state to a file atomically.

    Parameters
    ----------
    path : str
    taken : Snapshot

    Raises
    ------
    StateError
        If the file cannot be written.
    """
    state_file.write(path, state_layout.FORMAT, taken.document, taken.arrays)


def load(path: str, live: Optional[GmappingConfig] = None) -> State:
    """Return the State in a file.

    Parameters
    ----------
    path : str
    live : GmappingConfig, optional
        Configuration of the running program: the parameters in ``OWN`` are taken from it, all others from the file.

    Raises
    ------
    StateError
        If the file is missing, damaged, of another version, or no state.
    """
    document, arrays = state_file.read(path, state_layout.FORMAT)
    try:
        config, differing = _config(document.get("config"), live)
        return State(_mapper(config, Store(_plain(document.get("values"), "values"), arrays)),
                     _plain(document.get("host"), "host", words_only=True), differing)
    except (KindError, ConfigError) as error:
        raise StateError("{}: it was damaged, or written by another version of this program: {}".format(
            path, error)) from error
    except (ValueError, ArithmeticError) as error:
        raise StateError("{}: its parts do not fit together: {}".format(path, str(error)[:300])) from error
    except MemoryError:
        raise StateError("{}: not enough memory to load it".format(path)) from None


def _plain(found: object, name: str, words_only: bool = False) -> Dict[str, Any]:
    """Return a value of JSON if it is a dict; with ``words_only``, only of words, numbers and None."""
    if not isinstance(found, dict):
        raise KindError("{} is no table of names and values".format(name))
    for key, value in found.items() if words_only else ():
        if not isinstance(value, (str, int, float, type(None))) or len(str(value)) > MOST_WORDS:
            raise KindError("{} {:.40} is no number or short word".format(name, key))
    return found


def _config(values: object, live: Optional[GmappingConfig]) -> Tuple[GmappingConfig, Dict[str, str]]:
    """Return the configuration of a state, and the overridden parameters of the running program."""
    stored, differing = _plain(values, "config", words_only=True), {}
    if live is not None:
        given = live.values
        differing = {name: "{} {} (asked for {})".format(name, stored[name], given[name]) for name in stored
                     if name not in OWN and name in given and stored[name] != given[name]}
        stored = dict(stored, **{name: given[name] for name in OWN})
    config = GmappingConfig.from_mapping({name: value for name, value in stored.items() if value is not None})
    if config.unknown or config.unusable:
        raise KindError("parameters that cannot be used: {}".format(", ".join(config.unknown + config.unusable)[:300]))
    return config, differing


def _mapper(config: GmappingConfig, store: Store) -> Mapper:
    """Return a Mapper with all that is stored."""
    laser = state_layout.LASER.give("laser", store, {})
    state_layout.check_laser(laser)
    mapper = Mapper(config, laser)
    try:
        if any(name.startswith("saved_map.") for name in store.arrays):
            saved = state_layout.GIVEN.give("saved_map", store, {})
            if saved.resolution != config["delta"] or saved.data.size > state_layout.MOST_CELLS:
                raise KindError("a saved map of {} cells of {} m; expected at most {} of {}".format(
                    saved.data.size, saved.resolution, state_layout.MOST_CELLS, config["delta"]))
            mapper._occupancy = Occupancy.on(saved, config["occ_thresh"])
        mapper.process(mapper.reading(np.full(len(laser.angles), np.nan)), np.zeros(3), 0.0)
        state_layout.MAPPER.give_to(mapper, "", store)
        state_layout.check(mapper)
    except BaseException:
        mapper.close()
        raise
    return mapper


def _fit(mapper: Mapper, matcher: FastMatcher, reading: ScanReading, pose: FloatArray) -> float:
    """Return the score of a scan around a pose of the centred laser, as a share of its beams."""
    particles = mapper.particles
    found = matcher.search(particles.maps, particles.best, reading, pose, WINDOW_MOST, NO_PRIOR)
    row = matcher.match_one(particles.maps, particles.best, reading.beams, found, found, 1.0 / np.square(LINKS.prior))
    return float(row[mk.SCORE]) / reading.beams.shape[1]


def _is_odometry_reset(mapper: Mapper, reading: ScanReading, odom_pose: FloatArray) -> bool:
    """Whether a scan fits at the last pose, and clearly better than at the pose of odometry.

    If each pose is in the window of the search around the other, both find the same place: the scan decides nothing.
    """
    matcher = mapper._matcher
    if not isinstance(matcher, FastMatcher) or not reading.beams.shape[1]:
        return False
    step = between(mapper.odometry, odom_pose)
    across, turn = WINDOW_MOST
    if math.hypot(step[0], step[1]) <= across and abs(step[2]) <= turn:
        return False
    last = _fit(mapper, matcher, reading, mapper.pose)
    if last < MATCHING.score:           # it is elsewhere, maybe where the map does not reach
        return False
    led = _fit(mapper, matcher, reading, compose(mapper.map_from_odom, odom_pose))
    return led < MATCHING.good_share * last


def connect_odometry(mapper: Mapper, reading: ScanReading, odom_pose: FloatArray, stamp: float,
                     runs_on: bool = True) -> Optional[str]:
    """Connect a loaded mapper to the odometry of its next scan.

    Parameters
    ----------
    mapper : Mapper
    reading : ScanReading
        The next scan.
    odom_pose : (3,) float
        Of the centred laser at the next scan.
    stamp : float
        Of the next scan [s].
    runs_on : bool
        Whether odometry was not reset since the state was saved. A reset is also assumed if time has jumped back, the
        speed would exceed ``ODOMETRY.fastest``, or the scan fits at the last pose, and clearly better than where
        odometry has led. After a reset the robot continues at the last pose.

    Returns
    -------
    str or None
        For the log, after a reset.
    """
    before = mapper.odometry
    apart, seconds = math.hypot(odom_pose[0] - before[0], odom_pose[1] - before[1]), stamp - mapper.stamps[-1]
    if runs_on and apart <= ODOMETRY.fastest * max(seconds, 0.0) and not _is_odometry_reset(mapper, reading, odom_pose):
        return None
    mapper.reset_odometry(odom_pose)
    return ("odometry was reset ({:.2f} m and {:.1f} s from that of the state): "
            "the robot continues at its last pose".format(apart, seconds))
