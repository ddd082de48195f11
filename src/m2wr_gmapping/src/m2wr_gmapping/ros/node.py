"""``slam_gmapping``: scans and transforms in; map, transform and pose out."""
import logging
import sys
import threading
import time
from collections import deque

import rospy
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_gmapping import map_file
from m2wr_gmapping.config import ConfigError
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.ros.intake import Intake
from m2wr_gmapping.ros.outputs import Diagnostics, MapOutput, PoseOutput, TransformOutput
from m2wr_gmapping.ros.params import frame, private_parameters, read_parameters
from m2wr_gmapping.ros.reconfigure import make_reconfigure
from m2wr_gmapping.scan import LaserModel, ScanError
from m2wr_gmapping.warm_up import warm_up

SWITCH_INTERVAL = 0.0005    # threads that bring scans must not wait Python's default of 5 ms for the worker [s]
NO_SCAN_WARNING = 10.0      # [s], wall
TIMES_KEPT = 200


class SlamNode:
    """The filter behind topics: one worker thread runs it, callbacks only store.

    Parameters
    ----------
    config : GmappingConfig
    options : NodeOptions
    """

    def __init__(self, config, options):
        self._config, self._options = config, options
        self._base, self._map_frame = frame(config["base_frame"]), frame(config["map_frame"])
        self._lock = threading.RLock()          # of the mapper
        self._mapper = None
        self._generation = 0
        self._counted = self._refused = 0
        self._map_stamp = self._first_stamp = None
        self._times = deque(maxlen=TIMES_KEPT)
        self._intake = Intake(frame(config["odom_frame"]), options.scan_queue)
        self._maps = MapOutput(self._map_frame)
        self._poses = PoseOutput(self._map_frame)
        self._transform = TransformOutput(config)
        self._diagnostics = Diagnostics(self._intake, lambda: (self._mapper, self._refused, list(self._times)),
                                        self._maps, options.scan_queue)
        self._reconfigure = make_reconfigure(config, self._take_config)
        self._worker = threading.Thread(target=self._work, name="filter", daemon=True)
        self._worker.start()
        intake = self._intake
        rospy.Subscriber("/tf_static", TFMessage, lambda message: intake.on_transforms(message, True), queue_size=100)
        rospy.Subscriber("/tf", TFMessage, intake.on_transforms, queue_size=1000, tcp_nodelay=True)
        self._scans = rospy.Subscriber("scan", LaserScan, intake.on_scan, queue_size=options.scan_queue,
                                       buff_size=2**22, tcp_nodelay=True)
        threading.Thread(target=self._watch, name="watch", daemon=True).start()

    # ---- parameters that change

    def _take_config(self, config):
        with self._lock:
            self._config = config
            if self._mapper is not None:
                self._mapper.config = config
            self._transform.period = config["transform_publish_period"]

    # ---- the worker

    def _work(self):
        while True:
            taken = self._intake.next()
            if taken is None:
                return
            scan, odom_from_laser, generation = taken
            try:
                with self._lock:
                    if generation != self._generation:
                        self._begin_anew(generation)
                    self._take(scan, odom_from_laser)
            except (ScanError, ValueError) as error:
                self._refuse(scan, error)
            except rospy.ROSException:
                if rospy.is_shutdown():
                    return
                raise
            except Exception as error:      # a fault of this program must not end the map that is there
                logging.getLogger("rosout").exception("scan at %.3f failed", scan.header.stamp.to_sec())
                self._refuse(scan, error)

    def _refuse(self, scan, error):
        self._refused += 1
        rospy.logwarn_throttle(5.0, "scan at %.3f refused (%d so far): %s" % (
            scan.header.stamp.to_sec(), self._refused, error))

    def _begin_anew(self, generation):
        self._generation = generation
        self._maps.forget()
        if self._mapper is not None:
            self._mapper.close()
        self._mapper = self._map_stamp = self._first_stamp = None
        self._transform.set((0.0, 0.0, 0.0))

    def _take(self, scan, odom_from_laser):
        self._counted += 1
        if self._counted % max(1, self._config["throttle_scans"]):
            return
        began, stamp = time.perf_counter(), scan.header.stamp.to_sec()
        self._first_stamp = stamp if self._first_stamp is None else self._first_stamp
        if stamp < self._first_stamp + self._options.settle_time:
            return
        if self._mapper is None:
            self._begin(scan)
        mapper = self._mapper
        if frame(scan.header.frame_id) != self._laser_frame:
            raise ScanError("it is of the laser {}; expected {} as in the first one".format(
                frame(scan.header.frame_id), self._laser_frame))
        update = mapper.process(mapper.reading(scan.ranges), mapper.laser.sensor_pose(*odom_from_laser), stamp)
        self._times.append(1e3 * (time.perf_counter() - began))
        self._transform.set(mapper.map_from_odom)
        self._poses.publish(mapper, update, scan.header.stamp)
        if update.processed and (self._map_stamp is None
                                 or stamp - self._map_stamp > self._config["map_update_interval"]):
            self._map_stamp = stamp
            self._maps.ask(mapper)

    def _begin(self, scan):
        mount = self._intake.mount(self._base, scan)
        if mount is None:
            raise ScanError("no mount of the laser, " + self._intake.missing(
                self._base, scan.header.frame_id, scan.header.stamp))
        config = self._config
        laser = LaserModel.from_message(
            scan.angle_min, scan.angle_max, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max,
            mount, config["maxRange"], config["maxUrange"])
        beams = len(scan.ranges) // (config["lskip"] + 1)
        if config["minimumScore"] >= beams:
            rospy.logwarn("minimumScore %g can never be reached: a score is at most the beams matched, %d here; %s",
                          config["minimumScore"], beams, "no scan will be matched" if config["compatible"]
                          else "half the beams of a scan are taken instead")
        self._laser_frame = frame(scan.header.frame_id)
        self._mapper = Mapper(config, laser)
        rospy.loginfo("laser %s: %d beams of %.2f degrees, used to %g m; map begins at %.3f", self._laser_frame,
                      len(scan.ranges), abs(scan.angle_increment) * 57.29577951308232, laser.max_urange,
                      scan.header.stamp.to_sec())

    # ---- what is missing

    def _watch(self):
        """Say so when no scan comes at all."""
        while not rospy.is_shutdown() and not self._intake.arrived:
            rospy.rostime.wallsleep(NO_SCAN_WARNING)
            if self._intake.arrived or rospy.is_shutdown():
                return
            try:
                others = sorted(name for name, kind in rospy.get_published_topics() if kind == LaserScan._type)
            except (OSError, rospy.ROSException):
                continue
            rospy.logwarn("no scan on %s yet; topics with scans: %s", self._scans.resolved_name,
                          ", ".join(others) or "none")

    # ---- the end

    def close(self):
        """End all threads; write the map if that is wanted. Returns whether that went well."""
        self._intake.close()
        self._worker.join()
        self._maps.close()
        mapper, name = self._mapper, self._options.save_on_exit
        if mapper is None:
            if name:
                rospy.logwarn("there is no map to save as %s: no scan has been processed", name)
            return not name
        try:
            if name and mapper.filter is not None:
                mapper.finish()
                grid = mapper.occupancy()
                for path in map_file.save(name, grid.data, grid.resolution, (grid.origin[0], grid.origin[1], 0.0)):
                    rospy.loginfo("wrote %s", path)
        except (OSError, ValueError) as error:
            rospy.logerr("%s", error)
            return False
        finally:
            mapper.close()
        return True


def log_through_rospy():
    """Send the library's log lines to the screen and to /rosout."""
    log, rosout = logging.getLogger("m2wr_gmapping"), logging.getLogger("rosout")
    log.handlers, log.propagate = rosout.handlers, rosout.propagate
    log.setLevel(logging.INFO)


def main():
    """Entry point of the executable; returns the exit code."""
    try:
        rospy.init_node("slam_gmapping")
    except rospy.ROSException:
        return 1                            # interrupted before there was a master
    sys.setswitchinterval(SWITCH_INTERVAL)
    log_through_rospy()
    try:
        config, options, warnings = read_parameters(private_parameters())
    except ConfigError as error:
        rospy.logfatal("%s", error)
        return 1
    for warning in warnings:
        rospy.logwarn("%s", warning)
    rospy.loginfo("parameters: %s", ", ".join("%s %s" % item for item in config.as_dict().items()))
    warm_up()
    node = SlamNode(config, options)
    rospy.loginfo("ready, listening to %s", rospy.resolve_name("scan"))
    rospy.spin()
    return 0 if node.close() else 1
