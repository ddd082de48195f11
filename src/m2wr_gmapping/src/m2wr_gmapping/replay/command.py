"""``slam_gmapping_replay``: a bag in, a map and a trajectory out, as fast as it goes."""
import argparse
import logging
import math
import signal
import subprocess
import sys
import time

import yaml

from m2wr_gmapping import state
from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.replay.bag_file import BagError, BagFile
from m2wr_gmapping.replay import results
from m2wr_gmapping.replay.beginning import Beginning
from m2wr_gmapping.replay.map_reading import MapReadingError
from m2wr_gmapping.replay.source import ScanSource
from m2wr_gmapping.replay.statistics import Stopwatch, peak_memory_mib
from m2wr_gmapping.scan import LaserModel, ScanError
from m2wr_gmapping.warm_up import warm_up

log = logging.getLogger("slam_gmapping_replay")
PROGRESS_PERIOD = 1.0       # [s]
FAILED, USAGE, INTERRUPTED = 1, 2, 130


def parse(arguments):
    """Return options and private parameters from a command line that may hold ``_name:=value`` and remappings."""
    parser = argparse.ArgumentParser(prog="slam_gmapping_replay", description=__doc__.split(": ", 1)[1],
                                     epilog="Parameters: _name:=value, as for slam_gmapping.")
    add = parser.add_argument
    add("--bag_filename", required=True, metavar="FILE", help="ROS 1 bag with scans and transforms")
    add("--scan_topic", metavar="TOPIC", help="topic of the scans (default: /scan, or what scan:= says)")
    add("--seed", type=int, default=0, help="seed of all random numbers")
    add("--max_duration_buffer", type=float, default=99999.0, metavar="S", help="time that transforms are kept [s]")
    add("--on_done", metavar="COMMAND", help="shell command run at the end")
    add("--trajectory", metavar="FILE", help="final path of the base, each processed scan: stamp x y z qx qy qz qw")
    add("--tracked", metavar="FILE", help="the same with the scans that were only matched, between processed ones")
    add("--online", metavar="FILE", help="best pose as it was known at each processed scan, same format")
    add("--map", metavar="NAME", help="write NAME.pgm and NAME.yaml")
    add("--stats", metavar="FILE", help="write times and counts as JSON")
    add("--save-state", metavar="FILE", help="write everything that is needed to go on, after the last scan")
    add("--load-state", metavar="FILE", help="go on where that was written; its parameters hold")
    add("--new-odometry", action="store_true", help="the odometry has begun anew: the robot stands where it stood")
    add("--load-map", metavar="FILE", help="begin on a saved map (YAML)")
    add("--pose", nargs=3, type=float, metavar=("X", "Y", "YAW"),
        help="where the base stands on it at the first scan [m, rad] (default: as the odometry says)")
    add("--quiet", action="store_true", help="no progress")
    plain, parameters, remaps = [], {}, {}
    for word in arguments:
        name, assigned, value = word.partition(":=")
        if not assigned or name.startswith("--"):
            plain.append(word)
        elif name.startswith("__"):
            continue
        elif name.startswith("_"):
            parameters[name[1:]] = yaml.safe_load(value)
        else:
            remaps[name.lstrip("/")] = value
    options = parser.parse_args(plain)
    if options.pose and not options.load_map:
        parser.error("--pose {:g} {:g} {:g}: expected --load-map as well".format(*options.pose))
    if options.scan_topic is None:
        options.scan_topic = remaps.get("scan", "/scan")
    parameters.setdefault("seed", options.seed)
    options.settle_time = parameters.pop("settle_time", 0.0)
    if isinstance(options.settle_time, bool) or not isinstance(options.settle_time, (int, float)) \
            or not options.settle_time >= 0.0:
        parser.error("_settle_time:={}: expected a number of seconds, at least 0".format(options.settle_time))
    return options, parameters


class Replay:
    """One run over one bag.

    Parameters
    ----------
    bag : BagFile
    options : argparse.Namespace
    config : GmappingConfig
    beginning : Beginning, optional
        What the map begins on, if not on nothing.
    """

    def __init__(self, bag, options, config, beginning=None):
        self._bag, self._options, self._config = bag, options, config
        self._beginning = beginning or Beginning()
        self.source = ScanSource(bag, options.scan_topic, config["odom_frame"], config["base_frame"],
                                 options.max_duration_buffer)
        self.mapper = None
        self.grid = None
        self.online = []
        self.filter_watch, self.map_watch = Stopwatch(), Stopwatch()
        self.stopped = False
        self.refused = 0
        self._arrived = 0
        self._map_stamp = None
        self._first_stamp = None
        self.snapshot = None            # of the mapper after the last scan, where a state is to be saved
        loaded = self._beginning.loaded
        if loaded is not None:
            self._arrived, self._map_stamp = loaded.host.get("arrived", 0), loaded.host.get("map_stamp")
        self._told = time.monotonic()

    def stop(self, *_):
        """End after the scan in hand; a signal handler."""
        self.stopped = True

    def run(self):
        """Process all scans, until the end or ``stop``."""
        for scan, odom_from_laser in self.source:
            if self.stopped:
                break
            self._progress()
            self._arrived += 1
            if self._arrived % self._config["throttle_scans"]:
                continue
            try:
                self._scan(scan, odom_from_laser)
            except (ScanError, ValueError) as error:
                if not self.refused:
                    log.warning("scan at %.3f refused: %s", scan.header.stamp.to_sec(), error)
                self.refused += 1
        if self.mapper is not None and self.mapper.filter is not None:
            if self._options.save_state:
                self.snapshot = state.snapshot(self.mapper, dict(arrived=self._arrived, map_stamp=self._map_stamp))
            with self.filter_watch:
                self.mapper.finish()
            self._map(exact=True)
        self._progress(last=True)

    def _scan(self, scan, odom_from_laser):
        stamp = scan.header.stamp.to_sec()
        self._first_stamp = stamp if self._first_stamp is None else self._first_stamp
        if stamp < self._first_stamp + self._options.settle_time:
            return
        if self.mapper is None and not self._begin(scan):
            return
        laser = self.mapper.laser
        with self.filter_watch:
            reading, odom_pose = self.mapper.reading(scan.ranges), laser.sensor_pose(*odom_from_laser)
            told = self._beginning.connect(self.mapper, reading, odom_pose, stamp)
            update = self.mapper.process(reading, odom_pose, stamp)
        if told:
            log.info("%s", told)
        if update.processed:
            self.filter_watch.piece()
            since = math.inf if self._map_stamp is None else stamp - self._map_stamp
            if not 0.0 <= since <= self._config["map_update_interval"]:
                self._map_stamp = stamp
                self._map()
        if update.processed:
            self.online.append((stamp, self.mapper.base_poses(update.pose)))

    def _begin(self, scan):
        mount = self.source.base_from_laser(scan)
        if mount is None:
            self.refused += 1
            return False
        laser = LaserModel.from_message(
            scan.angle_min, scan.angle_max, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max,
            mount, self._config["maxRange"], self._config["maxUrange"])
        beams = len(scan.ranges) // (self._config["lskip"] + 1)
        if self._config["minimumScore"] >= beams:
            log.warning("minimumScore %g can never be reached: a score is at most the beams matched, %d here; %s",
                        self._config["minimumScore"], beams, "no scan will be matched" if self._config["compatible"]
                        else "half the beams of a scan are taken instead")
        self.mapper = self._beginning.mapper(self._config, laser)
        return True

    def _map(self, exact=False):
        self.grid = None                # never two at a time: at its default size one has 16 million cells
        with self.map_watch:
            self.grid = self.mapper.occupancy(exact)
        self.map_watch.piece()

    def _progress(self, last=False):
        if self._options.quiet or (not last and time.monotonic() - self._told < PROGRESS_PERIOD):
            return
        self._told = time.monotonic()
        processed = 0 if self.mapper is None else self.mapper.processed
        sys.stderr.write("\r{:5.1f} %  {} scans, {} processed{}".format(
            100.0 if last and not self.stopped else 100.0 * self._bag.fraction, self.source.scans, processed,
            "\n" if last else ""))
        sys.stderr.flush()

    def complaint(self):
        """Return why nothing came of the bag, or None."""
        source = self.source
        if self.mapper is not None and self.mapper.filter is not None:
            return None
        if not source.scans:
            topics = ", ".join("{} ({})".format(*item) for item in sorted(self._bag.topics.items()))
            return "no scan on {}; the bag has {}".format(self._options.scan_topic, topics or "no topics")
        if not source.frames:
            return "no transforms on /tf or /tf_static in the bag; a scan needs {} -> its frame".format(
                self._config["odom_frame"])
        return "no scan could be used. {}. Frames in the bag: {}; parameters odom_frame {}, base_frame {}".format(
            source.why or "See the warning above", ", ".join(sorted(source.frames)), self._config["odom_frame"],
            self._config["base_frame"])

    def statistics(self):
        """Return what the statistics file holds (dict)."""
        mapper = self.mapper
        updates = self.map_watch.summary()
        return dict(
            scans=self.source.scans, processed=mapper.processed, tracked=mapper.tracked,
            without_transform=self.source.without_transform, refused=self.refused,
            particles=self._config["particles"], beams=len(mapper.laser.angles), seed=self._config["seed"],
            processScan=self.filter_watch.summary(), map_updates=updates, peak_memory_mib=peak_memory_mib(),
            resamplings=mapper.filter.resamplings, **mapper.info())


def main(arguments=None):
    """Run the command; return its exit code."""
    logging.basicConfig(format="%(levelname)s %(message)s", stream=sys.stderr)     # of rospy only what is a warning
    for name in (log.name, "m2wr_gmapping"):
        logging.getLogger(name).setLevel(logging.INFO)
    options, parameters = parse(sys.argv[1:] if arguments is None else arguments)
    missing = results.missing_folders(options)
    if missing:                                 # before the work, not after it
        log.error("no folder %s: expected one to write into", ", ".join(missing))
        return USAGE
    try:
        asked = GmappingConfig.from_mapping(parameters)
        beginning, config = Beginning.from_files(asked, options.load_map, options.pose, options.load_state,
                                                 not options.new_odometry)
        bag = BagFile(options.bag_filename)
    except (ConfigError, BagError, MapReadingError, state.StateError) as error:
        log.error("%s", error)
        return USAGE
    for label, names in (("unknown parameters, ignored", asked.unknown),
                         ("of the wrong kind, ignored", asked.unusable),
                         ("those of the state hold", beginning.differing(parameters))):
        if names:
            log.warning("%s: %s", label, ", ".join(names))
    warm_up()
    with bag:
        replay = Replay(bag, options, config, beginning)
        before = {number: signal.signal(number, replay.stop) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            replay.run()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        if bag.damage:
            log.warning("%s; what comes before it was used", bag.damage)
    if replay.mapper is not None and replay.mapper.beyond:
        log.warning("the map became as large as it may be; what lies beyond was left out")
    complaint = replay.complaint()
    if complaint:
        log.error("%s: %s", options.bag_filename, complaint)
        return FAILED
    if replay.source.without_transform:
        log.warning("%d of %d scans without a transform, the last: %s", replay.source.without_transform,
                    replay.source.scans, replay.source.why)
    written, errors = results.save(replay, options)
    replay.mapper.close()
    for path in written:
        log.info("wrote %s", path)
    for error in errors:
        log.error("%s", error)
    if errors:
        return FAILED
    if options.on_done and not replay.stopped:
        return subprocess.call(options.on_done, shell=True)
    return INTERRUPTED if replay.stopped else 0
