"""Everything a mapper needs to go on as if it had never stopped, in one file.

A line that says what it is, a line of JSON (version, length, checksum), then a packed stream of the attributes. That
stream can only make arrays, random generators and objects of this package: a file from elsewhere runs no code.
"""
import hashlib
import importlib
import inspect
import io
import json
import math
import pickle
import zlib
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.se2 import between, compose
from m2wr_gmapping.whole_files import write_whole

MAGIC = b"m2wr_gmapping state\n"
VERSION = 4             # goes up whenever the same attributes come to mean something else
PROTOCOL = 4            # readable by Python 3.8
PACKAGE = __name__.split(".")[0]
# parameters that are the program's own, not the map's: those of the running program hold
OWN = ("throttle_scans", "base_frame", "map_frame", "odom_frame", "map_update_interval", "transform_publish_period",
       "tf_delay", "threads")
FASTEST = 5.0           # an odometry that went faster between state and scan has begun anew [m/s]
FAR = np.array([1.0, 0.7])          # so far from that of the state an odometry is checked by the scan [m, rad]
LOOK = np.array([0.5, 0.3])         # each place is looked at so far around [m, rad]
FIT = 1.0 / np.square([0.3, 0.3, 0.2])
BETTER_SHARE = 0.1      # by so much of its beams a scan must fit better where the robot stood than where odometry leads


class StateError(ValueError):
    """A state file cannot be written or used; says which one and why."""


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


class _Pickler(pickle.Pickler):
    """Writes ``outside`` objects by name and random generators by their state."""

    def __init__(self, stream, outside):
        super().__init__(stream, PROTOCOL)
        self._outside = {id(found): name for name, found in outside.items()}
        self._generators = {}

    def persistent_id(self, found):
        if id(found) in self._outside:
            return "outside", self._outside[id(found)]
        if isinstance(found, np.random.Generator):
            number = self._generators.setdefault(id(found), len(self._generators))
            return "generator", number, found.bit_generator.state
        return None


class _Unpickler(pickle.Unpickler):
    """Makes arrays, generators and objects of this package, nothing else."""

    ARRAYS = {"numpy": ("ndarray", "dtype"), "numpy.core.multiarray": ("_reconstruct", "scalar"),
              "numpy._core.multiarray": ("_reconstruct", "scalar")}

    def __init__(self, stream, outside):
        super().__init__(stream)
        self._outside, self._generators = outside, {}

    def persistent_load(self, pid):
        if pid[0] == "outside":
            return self._outside[pid[1]]
        if pid[1] not in self._generators:
            generator = np.random.default_rng()
            generator.bit_generator.state = pid[2]
            self._generators[pid[1]] = generator
        return self._generators[pid[1]]

    def find_class(self, module, name):
        if name in self.ARRAYS.get(module, ()):
            return super().find_class("numpy.core.multiarray" if module.endswith("multiarray") else module, name)
        if module.startswith(PACKAGE + ".") and module.count(".") == 1:
            found = getattr(importlib.import_module(module), name, None)
            if inspect.isclass(found) and found.__module__ == module:
                return found
        raise pickle.UnpicklingError("it holds {}.{}, which is no part of a map".format(module, name))


def _outside(mapper):
    """Objects that belong to the program and its parameters, not to the state."""
    return {"config": mapper.config, "matcher": mapper._matcher, "workers": mapper._workers}


def snapshot(mapper, host=None):
    """Return the state (bytes) of a mapper as it is now; between two scans, and while nobody makes a map of it.

    ``host`` (dict of plain values) comes back with it. Raises StateError before the first scan.
    """
    if mapper.filter is None:
        raise StateError("there is nothing to save yet: no scan has been processed")
    stream = io.BytesIO()
    _Pickler(stream, {}).dump((mapper.config.as_dict(), mapper.laser, dict(host or {})))
    _Pickler(stream, _outside(mapper)).dump({name: value for name, value in vars(mapper).items() if name not in (
        "config", "laser", "_matcher", "_workers")})
    return stream.getvalue()


def save(path, taken):
    """Write a snapshot to a file; an older file is replaced only by a complete new one. Raises StateError."""
    packed = zlib.compress(taken, 1)
    head = dict(version=VERSION, bytes=len(packed), sha256=hashlib.sha256(packed).hexdigest())
    try:
        write_whole((path, (MAGIC, json.dumps(head).encode(), b"\n", packed)))
    except OSError as error:
        raise StateError("cannot write the state {}: {}; what was there before is kept".format(
            path, error.strerror or error))


def _checked(path):
    """Return the snapshot in a file; raises StateError."""
    try:
        with open(path, "rb") as stream:
            magic = stream.read(len(MAGIC))
            if magic != MAGIC:
                raise StateError("{}: begins with {!r}; expected a state that slam_gmapping saved".format(path, magic))
            line, packed = stream.readline(100000), stream.read()
    except OSError as error:
        raise StateError("cannot read the state {}: {}".format(path, error.strerror or error))
    try:
        head = json.loads(line.decode())
        version, length, checksum = head["version"], head["bytes"], head["sha256"]
    except (ValueError, KeyError, TypeError):
        raise StateError("{}: its second line cannot be read; the file is damaged or cut off".format(path))
    if version != VERSION:
        raise StateError("{}: a state of version {}; this program reads version {} only".format(path, version, VERSION))
    if len(packed) != length:
        raise StateError("{}: {} bytes where {} are expected; the file is cut off".format(path, len(packed), length))
    if hashlib.sha256(packed).hexdigest() != checksum:
        raise StateError("{}: the checksum is another one; the file is damaged".format(path))
    return zlib.decompress(packed)


def load(path, live=None):
    """Return the State in a file.

    Parameters
    ----------
    live : GmappingConfig, optional
        Of the running program: from it are taken the parameters in ``OWN``. All others are those of the file.

    Raises
    ------
    StateError
        If there is no such file, or it is damaged, of another version or not a state at all.
    """
    stream = io.BytesIO(_checked(path))
    try:
        values, laser, host = _Unpickler(stream, {}).load()
        differing = {}
        if live is not None:
            given = live.as_dict()
            differing = {name: "{} {} (asked for {})".format(name, values[name], given[name]) for name in values
                         if name not in OWN and name in given and values[name] != given[name]}
            values.update((name, given[name]) for name in OWN)
        config = GmappingConfig.from_mapping({name: value for name, value in values.items() if value is not None})
        mapper = Mapper(config, laser)
        try:
            vars(mapper).update(_Unpickler(stream, _outside(mapper)).load())
            _compare(mapper, config, laser)
        except BaseException:
            mapper.close()
            raise
    except StateError as error:
        raise StateError("{}: {}".format(path, error))
    except Exception as error:          # whatever unpickling another program's attributes may raise
        raise StateError("{}: written by another version of this program ({}: {})".format(
            path, type(error).__name__, error))
    return State(mapper, host, differing)


def _compare(mapper, config, laser):
    """Raise StateError if a mapper made now would have attributes that the one from the file has not."""
    fresh = Mapper(config, laser)
    try:
        fresh.process(fresh.reading(np.full(len(laser.angles), np.nan)), np.zeros(3), 0.0)
        missing = list(_missing(vars(mapper), vars(fresh), "Mapper"))
    finally:
        fresh.close()
    if missing:
        raise StateError("written by another version of this program; it has no {}".format(", ".join(missing)))


def _missing(found, expected, where):
    for name, value in expected.items():
        if name not in found:
            yield "{}.{}".format(where, name)
            continue
        one, other = found[name], value
        if isinstance(one, list) and isinstance(other, list) and one and other:
            one, other = one[0], other[0]
        inside = type(other).__module__.split(".")[0] == PACKAGE and hasattr(other, "__dict__")
        if inside and type(one).__name__ == type(other).__name__ and name not in ("_matcher", "_workers", "config"):
            for sentence in _missing(vars(one), vars(other), type(other).__name__):
                yield sentence


def _fit(mapper, reading, pose):
    """Return the score of a scan around a pose of the centred laser, as a share of its beams."""
    particles, matcher = mapper.filter, mapper._matcher
    found = matcher.search(particles.maps, particles.best, reading, pose, LOOK)
    row = matcher.match_one(particles.maps, particles.best, reading, found, found, FIT)
    return row[mk.SCORE] / reading.beams.shape[1]


def _stands_still(mapper, reading, odom_pose):
    """Whether a scan fits the map clearly better where the robot stood than where its odometry leads."""
    if mapper.config["compatible"] or not reading.beams.shape[1]:
        return False
    step = between(mapper.odometry, odom_pose)
    if math.hypot(step[0], step[1]) <= FAR[0] and abs(step[2]) <= FAR[1]:
        return False
    led = compose(mapper.map_from_odom, odom_pose)
    return _fit(mapper, reading, mapper.pose) > _fit(mapper, reading, led) + BETTER_SHARE


def go_on(mapper, reading, odom_pose, stamp, runs_on=True):
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
    if runs_on and apart <= FASTEST * max(seconds, 0.0) and not _stands_still(mapper, reading, odom_pose):
        return None
    mapper.take_up(odom_pose)
    return ("the odometry is taken to have begun anew ({:.2f} m and {:.1f} s from that of the state): "
            "the robot goes on where it stood".format(apart, seconds))
