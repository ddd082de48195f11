"""``slam_gmapping_replay``: a bag in, a map and a trajectory out, as fast as it goes."""
import argparse
import json
import logging
import math
import os
import signal
import subprocess
import sys
import tempfile
import time

import yaml

from m2wr_gmapping import map_file
from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.replay.bag_file import BagError, BagFile
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
    add("--trajectory", metavar="FILE", help="final path of the base: stamp x y z qx qy qz qw")
    add("--online", metavar="FILE", help="best pose as it was known at each scan, same format")
    add("--map", metavar="NAME", help="write NAME.pgm and NAME.yaml")
    add("--stats", metavar="FILE", help="write times and counts as JSON")
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
    if options.scan_topic is None:
        options.scan_topic = remaps.get("scan", "/scan")
    parameters.setdefault("seed", options.seed)
    return options, parameters


class Replay:
    """One run over one bag.

    Parameters
    ----------
    bag : BagFile
    options : argparse.Namespace
    config : GmappingConfig
    """

    def __init__(self, bag, options, config):
        self._bag, self._options, self._config = bag, options, config
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
        if self.mapper is not None:
            with self.filter_watch:
                self.mapper.finish()
            self._map(exact=True)
        self._progress(last=True)

    def _scan(self, scan, odom_from_laser):
        stamp = scan.header.stamp.to_sec()
        if self.mapper is None and not self._begin(scan):
            return
        laser = self.mapper.laser
        with self.filter_watch:
            reading = self.mapper.reading(scan.ranges)
            update = self.mapper.process(reading, laser.sensor_pose(*odom_from_laser), stamp)
        if update.processed:
            self.filter_watch.piece()
            if self._map_stamp is None or stamp - self._map_stamp > self._config["map_update_interval"]:
                self._map_stamp = stamp
                self._map()
        if update.processed or update.tracked:
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
        self.mapper = Mapper(self._config, laser)
        return True

    def _map(self, exact=False):
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
        if self.mapper is not None:
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


def pose_lines(stamps, poses):
    """Return the text of a trajectory file: stamp x y z qx qy qz qw."""
    return "".join("{:.9f} {:.6f} {:.6f} 0 0 0 {:.9f} {:.9f}\n".format(
        stamp, x, y, math.sin(0.5 * theta), math.cos(0.5 * theta)) for stamp, (x, y, theta) in zip(stamps, poses))


def _write(path, text):
    """Replace a file by a complete new one."""
    folder = os.path.dirname(os.path.abspath(path))
    descriptor, temporary = tempfile.mkstemp(prefix=".replay-", dir=folder)
    try:
        with os.fdopen(descriptor, "w") as stream:
            stream.write(text)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError:
        os.unlink(temporary)
        raise


def save(replay, options):
    """Write what was asked for; return the paths."""
    mapper, written = replay.mapper, []
    if options.trajectory:
        _write(options.trajectory, pose_lines(*mapper.trajectory()))
        written.append(options.trajectory)
    if options.online:
        _write(options.online, pose_lines(*zip(*replay.online)) if replay.online else "")
        written.append(options.online)
    if options.map:
        grid = replay.grid
        written += map_file.save(options.map, grid.data, grid.resolution, [grid.origin[0], grid.origin[1], 0.0])
    if options.stats:
        _write(options.stats, json.dumps(replay.statistics(), indent=2, sort_keys=True) + "\n")
        written.append(options.stats)
    return written


def main(arguments=None):
    """Run the command; return its exit code."""
    logging.basicConfig(format="%(levelname)s %(message)s", stream=sys.stderr)     # of rospy only what is a warning
    for name in (log.name, "m2wr_gmapping"):
        logging.getLogger(name).setLevel(logging.INFO)
    options, parameters = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        config = GmappingConfig.from_mapping(parameters)
        bag = BagFile(options.bag_filename)
    except (ConfigError, BagError) as error:
        log.error("%s", error)
        return USAGE
    for label, names in (("unknown parameters, ignored", config.unknown),
                         ("of the wrong kind, ignored", config.unusable)):
        if names:
            log.warning("%s: %s", label, ", ".join(names))
    warm_up()
    with bag:
        replay = Replay(bag, options, config)
        before = {number: signal.signal(number, replay.stop) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            replay.run()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        if bag.damage:
            log.warning("%s; what comes before it was used", bag.damage)
    complaint = replay.complaint()
    if complaint:
        log.error("%s: %s", options.bag_filename, complaint)
        return FAILED
    if replay.source.without_transform:
        log.warning("%d of %d scans without a transform, the last: %s", replay.source.without_transform,
                    replay.source.scans, replay.source.why)
    try:
        for path in save(replay, options):
            log.info("wrote %s", path)
    except OSError as error:
        log.error("%s", error)
        return FAILED
    finally:
        replay.mapper.close()
    if options.on_done and not replay.stopped:
        return subprocess.call(options.on_done, shell=True)
    return INTERRUPTED if replay.stopped else 0
