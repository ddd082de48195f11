# SPDX-License-Identifier: BSD-3-Clause
"""``slam_gmapping_replay``: makes a map and a trajectory from a bag, as fast as possible."""
from __future__ import annotations

import argparse
import logging
import math
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple

import yaml

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.frontend.scan import LaserModel, ScanError
from m2wr_gmapping.io import state
from m2wr_gmapping.io.initial_state import InitialState
from m2wr_gmapping.kernel_warm_up import compile_kernels
from m2wr_gmapping.replay import result_files
from m2wr_gmapping.replay.bag_messages import BagError, BagFile
from m2wr_gmapping.replay.master_check import master_answers
from m2wr_gmapping.replay.run_statistics import Stopwatch, peak_memory_mib
from m2wr_gmapping.replay.scan_source import ScanSource
from m2wr_maps.saved_map_reader import MapReadingError
from m2wr_maps.scan_account import (
    AT_END,
    BAD_HEADER,
    EARLY,
    NO_TRANSFORM,
    OUT_OF_ORDER,
    REFUSED,
    SETTLING,
    THROTTLED,
)
from m2wr_node.heap_memory import use_one_heap
from m2wr_node.numbers import number

if TYPE_CHECKING:
    from sensor_msgs.msg import LaserScan

    from m2wr_gmapping.mapper import Mapper
    from m2wr_gmapping.ros.replay_node import ReplayNode
    from m2wr_maps.saved_map import SavedMap
    from m2wr_maps.transforms import Transform
    from m2wr_node.array_types import FloatArray

log = logging.getLogger("slam_gmapping_replay")
EXPECTED = {EARLY, THROTTLED, SETTLING}         # reasons for unused scans that are no fault
PROGRESS_PERIOD = 1.0       # [s]
LARGEST_IN_HEAP = 2 << 20   # above the rasters of a search, below the arrays of a large map [bytes]
FAILED, USAGE, INTERRUPTED = 1, 2, 130
LONGEST_BUFFER = 1e9        # about half the limit of a duration of ROS [s]


def parse(arguments: Sequence[str]) -> Tuple[argparse.Namespace, Dict[str, Any]]:
    """Return options and private parameters from a command line that may hold ``_name:=value`` and remappings."""
    parser = argparse.ArgumentParser(prog="slam_gmapping_replay", description=__doc__.split(": ", 1)[1],
                                     epilog="Parameters: _name:=value, as for slam_gmapping.")
    add = parser.add_argument
    add("--bag_filename", required=True, metavar="FILE", help="ROS 1 bag with scans and transforms")
    add("--scan_topic", metavar="TOPIC", help="topic of the scans (default: /scan, or scan:=TOPIC)")
    add("--seed", type=int, metavar="N", help="seed of all random numbers (0)")
    add("--max_duration_buffer", type=float, default=99999.0, metavar="S", help="length of the transform buffer [s]")
    add("--on_done", metavar="COMMAND", help="shell command to run at the end")
    add("--trajectory", metavar="FILE", help="final path of the base at processed scans: stamp x y z qx qy qz qw")
    add("--tracked", metavar="FILE", help="the same with all matched scans between processed ones")
    add("--online", metavar="FILE", help="best pose known at the time of each scan, same format")
    add("--graph", metavar="FILE", help="pose graph with loop closures as JSON, for plot_map --graph")
    add("--map", metavar="NAME", help="write NAME.pgm and NAME.yaml")
    add("--stats", metavar="FILE", help="write times and counts as JSON")
    add("--save-state", metavar="FILE", help="write the state after the last scan, for --load-state")
    add("--load-state", metavar="FILE", help="continue from this state, with its parameters")
    add("--new-odometry", action="store_true", help="odometry was reset: the robot is at its last pose")
    add("--load-map", metavar="FILE", help="start on a saved map (YAML)")
    add("--pose", nargs=3, type=float, metavar=("X", "Y", "YAW"),
        help="pose of the base on that map at the first scan [m, rad] (default: odometry)")
    add("--quiet", action="store_true", help="no progress")
    plain: List[str] = []
    parameters: Dict[str, Any] = {}
    remaps: Dict[str, str] = {}
    launched = False
    for word in arguments:
        name, assigned, value = word.partition(":=")
        if not assigned or name.startswith("--"):
            plain.append(word)
        elif name.startswith("__"):
            launched = launched or name == "__name"
        elif name.startswith("_"):
            try:
                parameters[name[1:]] = yaml.safe_load(value)
            except yaml.YAMLError as error:
                parser.error("{}: no value that YAML can read: {}".format(word, str(error).splitlines()[0]))
        else:
            remaps[name.lstrip("/")] = value
    options = parser.parse_args(plain)
    if options.pose and not options.load_map:
        parser.error("--pose {:g} {:g} {:g}: expected --load-map as well".format(*options.pose))
    if not 0.0 < options.max_duration_buffer < LONGEST_BUFFER:
        parser.error("--max_duration_buffer {:g}: expected seconds, above 0 and below {:g}".format(
            options.max_duration_buffer, LONGEST_BUFFER))
    if options.scan_topic is None:
        options.scan_topic = remaps.get("scan", "/scan")
    options.launched = launched         # by a launch file, which gives a node its name
    return options, parameters


def settle_time(parameters: Dict[str, Any]) -> float:
    """Remove the parameter ``settle_time`` from a dict and return it [s]; raises ConfigError."""
    given = parameters.pop("settle_time", 0.0)
    value = number(given)
    if value is None or not value >= 0.0:
        raise ConfigError("parameter settle_time is {!r}; expected a number of seconds, at least 0".format(given))
    return value


def files_wanted(options: argparse.Namespace) -> bool:
    """Return whether an output file is requested."""
    return any(getattr(options, name) for name in result_files.NAMES)


def as_node(options: argparse.Namespace) -> Optional[ReplayNode]:
    """Return the ReplayNode of this run, or None; launch files and runs without output files need one."""
    if files_wanted(options) and not (options.launched or options.on_done):
        return None
    if not master_answers():
        return None
    from m2wr_gmapping.ros.replay_node import ReplayNode  # only if a master is needed
    return ReplayNode((log.name, "m2wr_gmapping"))


class Replay:
    """One run over one bag.

    Parameters
    ----------
    bag : BagFile
    options : argparse.Namespace
    config : GmappingConfig
    beginning : InitialState, optional
    settle : float
        Scans in this time after the first one are skipped [s].
    node : ReplayNode, optional
        Publishes each map.
    """

    def __init__(self, bag: BagFile, options: argparse.Namespace, config: GmappingConfig,
                 beginning: Optional[InitialState] = None, settle: float = 0.0,
                 node: Optional[ReplayNode] = None) -> None:
        self.bag, self._options, self._config = bag, options, config
        self._settle, self._node = settle, node
        self._beginning = beginning or InitialState()
        self.source = ScanSource(bag, options.scan_topic, config["odom_frame"], config["base_frame"],
                                 options.max_duration_buffer, config["map_frame"])
        self.mapper: Optional[Mapper] = None
        self.grid: Optional[SavedMap] = None
        self.online: List[Tuple[float, FloatArray]] = []        # stamp [s], pose of the base
        self.filter_watch, self.map_watch = Stopwatch(), Stopwatch()
        self.stopped = False
        self.account = self.source.account
        self.used = 0                   # scans given to the mapper
        self._arrived = self._generation = 0
        self._laser_frame = ""
        self._map_stamp: Optional[float] = None
        self._first_stamp: Optional[float] = None
        self.snapshot: Optional[state.Snapshot] = None          # after the last scan, if a state is saved
        loaded = self._beginning.loaded
        if loaded is not None:
            self._arrived, self._map_stamp = loaded.host.get("arrived", 0), loaded.host.get("map_stamp")
        self._told = time.monotonic()

    def stop(self, *_: object) -> None:
        """Stop after the current scan; a signal handler."""
        self.stopped = True

    def run(self) -> None:
        """Process all scans, until the end or ``stop``."""
        for scan, odom_from_laser in self.source:
            if self.stopped:
                break
            if self.source.generation != self._generation:
                self._start_new_run()
            self._progress()
            self._arrived += 1
            if self._arrived % self._config["throttle_scans"]:
                self.account.leave_out(THROTTLED)
                continue
            try:
                self._scan(scan, odom_from_laser)
            except (ScanError, ValueError) as error:
                if self.account.leave_out(REFUSED) == 1:
                    log.warning("scan at %.3f refused: %s", scan.header.stamp.to_sec(), error)
        # those that wait when a signal ends the run
        self.account.leave_out(AT_END, self.account.received - self.used - sum(self.account.unused.values()))
        mapper = self.mapper
        if mapper is not None and mapper.filter is not None:
            if self._options.save_state:
                self.snapshot = state.snapshot(mapper, dict(arrived=self._arrived, map_stamp=self._map_stamp))
            with self.filter_watch:
                mapper.finish()
            if self._node is not None:
                self._show_map(mapper, self._node, exact=True)
            else:                               # without a master no map before has a subscriber
                with self.map_watch:
                    self.grid = mapper.last_map()
                self.map_watch.piece()
        self._progress(last=True)

    def _scan(self, scan: LaserScan, odom_from_laser: Transform) -> None:
        stamp = scan.header.stamp.to_sec()
        self._first_stamp = stamp if self._first_stamp is None else self._first_stamp
        if stamp < self._first_stamp + self._settle:
            self.account.leave_out(SETTLING)
            return
        mapper = self._begin(scan) if self.mapper is None else self.mapper
        if scan.header.frame_id.lstrip("/") != self._laser_frame:
            raise ScanError("its frame is {}; expected {} as in the first one".format(
                scan.header.frame_id.lstrip("/"), self._laser_frame))
        laser = mapper.laser
        with self.filter_watch:
            reading, odom_pose = mapper.reading(scan.ranges), laser.sensor_pose(*odom_from_laser)
            told = self._beginning.connect(mapper, reading, odom_pose, stamp)
            update = mapper.process(reading, odom_pose, stamp, laser.slope(odom_from_laser[1]))
        self.used += 1
        if told:
            log.info("%s", told)
        if update.processed:
            self.filter_watch.piece()
            since = math.inf if self._map_stamp is None else stamp - self._map_stamp
            if not 0.0 <= since <= self._config["map_update_interval"]:
                self._map_stamp = stamp
                if self._node is not None:
                    self._show_map(mapper, self._node, exact=False)
        if self._options.online:
            self.online.append((stamp, mapper.base_poses(update.pose)))

    def _start_new_run(self) -> None:
        """Start a new run after a jump back in time, as the live node does."""
        self._generation = self.source.generation
        if self.mapper is not None:
            self.mapper.close()
        self.mapper, self._beginning = None, self._beginning.again()
        self._map_stamp = self._first_stamp = None
        self.online = []
        self.filter_watch, self.map_watch = Stopwatch(), Stopwatch()

    def _begin(self, scan: LaserScan) -> Mapper:
        mount = self.source.base_from_laser(scan)
        if mount is None:
            raise ScanError("the mount of the laser is unknown: {}".format(self.source.why))
        laser = LaserModel.from_message(
            scan.angle_min, scan.angle_max, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max,
            mount, self._config["maxRange"], self._config["maxUrange"])
        warning = self._config.score_warning(len(scan.ranges))
        if warning is not None:
            log.warning("%s", warning)
        self.mapper = self._beginning.mapper(self._config, laser)
        self._laser_frame = scan.header.frame_id.lstrip("/")
        return self.mapper

    def _show_map(self, mapper: Mapper, node: ReplayNode, exact: bool) -> None:
        self.grid = None            # at the default size a map has 16 million cells
        with self.map_watch:
            self.grid = mapper.occupancy(exact)
        self.map_watch.piece()
        node.show(self.grid, mapper.entropy, self._config["map_frame"].lstrip("/"))

    def _progress(self, last: bool = False) -> None:
        if self._options.quiet or (not last and time.monotonic() - self._told < PROGRESS_PERIOD):
            return
        self._told = time.monotonic()
        processed = 0 if self.mapper is None else self.mapper.processed
        sys.stderr.write("\r{:5.1f} %  {} scans, {} processed{}".format(
            100.0 if last and not self.stopped else 100.0 * self.bag.fraction, self.account.received, processed,
            "\n" if last else ""))
        sys.stderr.flush()

    def complaint(self) -> Optional[str]:
        """Return why the bag gave no map, or None."""
        source = self.source
        if self.mapper is not None and self.mapper.filter is not None:
            return None
        if not self.account.received:
            topics = ", ".join("{} ({})".format(*item) for item in sorted(self.bag.topics.items()))
            return "no scan on {}; the bag has {}".format(self._options.scan_topic, topics or "no topics")
        if not source.frames:
            return "no transforms on /tf or /tf_static in the bag; a scan needs {} -> its frame".format(
                self._config["odom_frame"])
        if self.account.count(THROTTLED, SETTLING) == self.account.received:
            return "no scan could be used: throttle_scans {} and settle_time {:g} skip all {}".format(
                self._config["throttle_scans"], self._settle, self.account.received)
        return "no scan could be used. {}. Frames in the bag: {}; parameters odom_frame {}, base_frame {}".format(
            source.why or "See the warning above", ", ".join(sorted(source.frames)), self._config["odom_frame"],
            self._config["base_frame"])

    def statistics(self) -> Dict[str, Any]:
        """Return the content of the statistics file; call this after a run that gave a map."""
        mapper, account = self.mapper, self.account
        assert mapper is not None
        updates = self.map_watch.summary()
        return dict(
            scans=account.received, used=self.used, unused=account.unused, processed=mapper.processed,
            tracked=mapper.tracked,
            without_transform=account.count(NO_TRANSFORM), before_first_transform=account.count(EARLY),
            refused=account.count(REFUSED, OUT_OF_ORDER, BAD_HEADER), time_jumps=self.source.generation,
            particles=self._config["particles"], beams=len(mapper.laser.angles), seed=self._config["seed"],
            processScan=self.filter_watch.summary(), map_updates=updates, peak_memory_mib=peak_memory_mib(),
            process_cpu_s=round(time.process_time(), 3),
            resamplings=mapper.particles.resamplings, **mapper.info())


def prepare(options: argparse.Namespace, parameters: Dict[str, Any], node: Optional[ReplayNode]) -> Replay:
    """Return the replay of a bag.

    Parameters
    ----------
    options : argparse.Namespace
    parameters : dict of str to object
        Private parameters of the command line.
    node : ReplayNode or None
        Gives the parameters of the server.

    Raises
    ------
    ConfigError, BagError, MapReadingError, StateError
        If a value or a file cannot be used.
    """
    if options.seed is not None:
        parameters.setdefault("seed", options.seed)
    if node is not None:
        parameters = dict(node.parameters(), **parameters)
    settle = settle_time(parameters)
    asked = GmappingConfig.from_mapping(parameters)
    beginning, config = InitialState.from_files(asked, options.load_map, options.pose, options.load_state,
                                                not options.new_odometry)
    replay = Replay(BagFile(options.bag_filename), options, config, beginning, settle, node)
    for label, names in (("unknown parameters, ignored", asked.unknown),
                         ("of the wrong type, ignored", asked.unusable),
                         ("the state overrides", beginning.differing(parameters))):
        if names:
            log.warning("%s: %s", label, ", ".join(names))
    return replay


def run_and_save(replay: Replay, options: argparse.Namespace) -> int:
    """Run a replay to its end or the first signal, and write the output files.

    Parameters
    ----------
    replay : Replay
    options : argparse.Namespace

    Returns
    -------
    int
        Exit code.
    """
    ends = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:               # nohup ignores it
        ends.append(signal.SIGHUP)
    before = [(end, signal.signal(end, replay.stop)) for end in ends]
    try:
        replay.run()
        if replay.bag.damage:
            log.warning("%s; the readable part was used", replay.bag.damage)
        if replay.mapper is not None and replay.mapper.beyond:
            log.warning("the map has reached its size limit; points outside were ignored")
        complaint = replay.complaint()
        if complaint:
            log.error("%s: %s", options.bag_filename, complaint)
            return FAILED
        tell = log.warning if set(replay.account.unused) - EXPECTED else log.info
        tell("%s", replay.account.text())
        written, errors = result_files.save(replay, options)     # signals do not interrupt this
    finally:
        for end, handler in before:
            signal.signal(end, handler)
    if replay.mapper is not None:
        replay.mapper.close()
    for path in written:
        log.info("wrote %s", path)
    for error in errors:
        log.error("%s", error)
    return FAILED if errors else INTERRUPTED if replay.stopped else 0


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    use_one_heap(LARGEST_IN_HEAP)
    logging.basicConfig(format="%(levelname)s %(message)s", stream=sys.stderr)     # of rospy only warnings
    for name in (log.name, "m2wr_gmapping"):
        logging.getLogger(name).setLevel(logging.INFO)
    options, parameters = parse(sys.argv[1:] if arguments is None else arguments)
    missing = result_files.missing_folders(options)
    if missing:                                 # before the run
        log.error("no folder %s: expected one to write into", ", ".join(missing))
        return USAGE
    node = as_node(options)
    try:
        return work(options, parameters, node)
    except (ConfigError, BagError, MapReadingError, state.StateError) as error:
        log.error("%s", error)
        return USAGE
    finally:
        if node is not None:
            node.leave()


def work(options: argparse.Namespace, parameters: Dict[str, Any], node: Optional[ReplayNode] = None) -> int:
    """Run the replay and the command of ``--on_done``.

    Parameters
    ----------
    options, parameters, node
        As for :func:`prepare`, which raises the same errors.

    Returns
    -------
    int
        Exit code.
    """
    replay = prepare(options, parameters, node)
    compile_kernels()
    if node is not None:
        node.on_end(replay.stop)
    with replay.bag:
        code = run_and_save(replay, options)
    if not code and options.on_done:
        return subprocess.call(options.on_done, shell=True)
    if not code and not files_wanted(options):
        if node is not None:
            node.stay()
        else:
            log.warning("no result is kept: no output file was requested, such as --map, and there is no master")
    return code
