# SPDX-License-Identifier: BSD-3-Clause
"""Everything a mapper needs to go on as if it had never stopped, in one file of numbers.

See ``state_file`` for the container and ``state_layout`` for what is stored. A mapper that this program makes by itself
is filled with what was stored, checked value by value: a file runs no code and reaches outside no array.
"""
import math
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.io import state_file, state_layout
from m2wr_gmapping.io.saved_map import SavedMapOccupancy
from m2wr_gmapping.io.state_file import StateError
from m2wr_gmapping.io.state_types import KindError, Store
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.se2 import between, compose

# parameters that are the program's own, not the map's: those of the running program hold
OWN = ("throttle_scans", "base_frame", "map_frame", "odom_frame", "map_update_interval", "transform_publish_period",
       "tf_delay", "threads")
MOST_WORDS = 1000       # letters of what the program that saved a state added, each
FASTEST = 5.0           # an odometry that went faster between state and scan has begun anew [m/s]
FAR = np.array([1.0, 0.7])          # so far from that of the state an odometry is checked by the scan [m, rad]
LOOK = np.array([0.5, 0.3])         # each place is looked at so far around [m, rad]
FIT = 1.0 / np.square([0.3, 0.3, 0.2])
BETTER_SHARE = 0.1      # by so much of its beams a scan must fit better where the robot stood than where odometry leads


@dataclass
class State:
    """What a state file held.

    Attributes
    ----------
    mapper : Mapper
        Ready for the next scan.
    host : dict
        What the program that saved it added.
    differing : dict
        Parameters of the running program that do not hold, because the map was begun with others: name -> both values.
    """

    mapper: Mapper
    host: dict
    differing: dict


@dataclass(frozen=True)
class Snapshot:
    """A mapper as it was at one moment; it shares no memory with the mapper."""

    document: dict
    arrays: dict


def snapshot(mapper, host=None):
    """Return the Snapshot of a mapper as it is now; between two scans, and while nobody makes a map of it.

    ``host`` (dict of words and numbers) comes back with it. Raises StateError before the first scan.
    """
    if mapper.filter is None:
        raise StateError("there is nothing to save yet: no scan has been processed")
    store, given = Store(), isinstance(mapper._occupancy, SavedMapOccupancy)
    try:
        state_layout.LASER.take(mapper.laser, "laser", store)
        if given:
            state_layout.GIVEN.take(mapper._occupancy._given, "saved_map", store)
        state_layout.mapper_part(given).take(mapper, "", store)
    except KindError as error:
        raise StateError("this mapper cannot be saved: {}".format(error)) from error
    return Snapshot(dict(config=mapper.config.as_dict(), host=dict(host or {}), values=store.values), store.arrays)


def save(path, taken):
    """Write a Snapshot to a file; an older file is replaced only by a complete new one. Raises StateError."""
    state_file.write(path, taken.document, taken.arrays)


def load(path, live=None):
    """Return the State in a file.

    Parameters
    ----------
    live : GmappingConfig, optional
        Of the running program: from it are taken the parameters in ``OWN``. All others are those of the file.

    Raises
    ------
    StateError
        If there is no such file, or it is damaged, of another version, not a state at all, or made to do harm.
    """
    document, arrays = state_file.read(path)
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
        raise StateError("{}: there is not enough memory for it".format(path)) from None


def _plain(found, name, words_only=False):
    """Return a dict of JSON as it is if it is one; with ``words_only``, of words, numbers and None."""
    if not isinstance(found, dict):
        raise KindError("{} is no table of names and values".format(name))
    for key, value in found.items() if words_only else ():
        if not isinstance(value, (str, int, float, type(None))) or len(str(value)) > MOST_WORDS:
            raise KindError("{} {:.40} is no number or short word".format(name, key))
    return found


def _config(values, live):
    """Return the configuration of a state, and which parameters of the running program do not hold."""
    values, differing = _plain(values, "config", words_only=True), {}
    if live is not None:
        given = live.as_dict()
        differing = {name: "{} {} (asked for {})".format(name, values[name], given[name]) for name in values
                     if name not in OWN and name in given and values[name] != given[name]}
        values = dict(values, **{name: given[name] for name in OWN})
    config = GmappingConfig.from_mapping({name: value for name, value in values.items() if value is not None})
    if config.unknown or config.unusable:
        raise KindError("parameters that cannot be used: {}".format(", ".join(config.unknown + config.unusable)[:300]))
    return config, differing


def _mapper(config, store):
    """Return a Mapper with all that is stored."""
    laser = state_layout.LASER.give("laser", store, {})
    mapper = Mapper(config, laser)
    try:
        given = any(name.startswith("saved_map.") for name in store.arrays)
        if given:
            saved = state_layout.GIVEN.give("saved_map", store, {})
            if saved.resolution != config["delta"] or saved.data.size > state_layout.MOST_CELLS:
                raise KindError("a saved map of {} cells of {} m; expected at most {} of {}".format(
                    saved.data.size, saved.resolution, state_layout.MOST_CELLS, config["delta"]))
            mapper._occupancy = SavedMapOccupancy(saved, config["occ_thresh"])
        mapper.process(mapper.reading(np.full(len(laser.angles), np.nan)), np.zeros(3), 0.0)
        state_layout.mapper_part(given).give_to(mapper, "", store)
        state_layout.check(mapper)
    except BaseException:
        mapper.close()
        raise
    return mapper


def _fit(mapper, reading, pose):
    """Return the score of a scan around a pose of the centred laser, as a share of its beams."""
    particles, matcher = mapper.filter, mapper._matcher
    found = matcher.search(particles.maps, particles.best, reading, pose, LOOK)
    row = matcher.match_one(particles.maps, particles.best, reading, found, found, FIT)
    return row[mk.SCORE] / reading.beams.shape[1]


def _is_odometry_reset(mapper, reading, odom_pose):
    """Whether a scan fits the map clearly better where the robot stood than where its odometry leads."""
    if mapper.config["compatible"] or not reading.beams.shape[1]:
        return False
    step = between(mapper.odometry, odom_pose)
    if math.hypot(step[0], step[1]) <= FAR[0] and abs(step[2]) <= FAR[1]:
        return False
    led = compose(mapper.map_from_odom, odom_pose)
    return _fit(mapper, reading, mapper.pose) > _fit(mapper, reading, led) + BETTER_SHARE


def connect_odometry(mapper, reading, odom_pose, stamp, runs_on=True):
    """Connect a loaded mapper to the odometry of its next scan; returns what is to be said about it, or None.

    Parameters
    ----------
    reading : ScanReading
        The next scan.
    odom_pose : (3,) float
        Of the centred laser at the next scan.
    stamp : float
        Of the next scan [s].
    runs_on : bool
        Whether the odometry is the one that the state was made with. If not, or if it cannot be, because time has gone
        back, the robot would have been faster than ``FASTEST`` or the scan fits far better without it, the robot is
        taken to stand where it stood.
    """
    before = mapper.odometry
    apart, seconds = math.hypot(odom_pose[0] - before[0], odom_pose[1] - before[1]), stamp - mapper.stamps[-1]
    if runs_on and apart <= FASTEST * max(seconds, 0.0) and not _is_odometry_reset(mapper, reading, odom_pose):
        return None
    mapper.reset_odometry(odom_pose)
    return ("the odometry is taken to have begun anew ({:.2f} m and {:.1f} s from that of the state): "
            "the robot goes on where it stood".format(apart, seconds))
