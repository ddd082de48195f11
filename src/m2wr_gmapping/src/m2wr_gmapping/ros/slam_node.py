# SPDX-License-Identifier: BSD-3-Clause
"""``slam_gmapping``: scans and transforms in; map, transform and pose out."""
from __future__ import annotations

import logging
import math
import os
import sys
import threading
import time
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, List, Mapping, Optional, Tuple

import rospkg
import rospy
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_files.safe_paths import OutsideError, confined
from m2wr_gmapping.config import ConfigError
from m2wr_gmapping.frontend.scan import LaserModel, ScanError
from m2wr_gmapping.io import state
from m2wr_gmapping.io.initial_state import InitialState
from m2wr_gmapping.kernel_warm_up import compile_kernels
from m2wr_gmapping.ros.backlog import may_pass
from m2wr_gmapping.ros.mount_check import MountCheck
from m2wr_gmapping.ros.node_parameters import (
    check_frames,
    private_parameters,
    read_parameters,
    read_ranges,
    save_on_exit_warnings,
    tf_prefix,
    with_prefix,
)
from m2wr_gmapping.ros.outputs import Diagnostics, MapOutput, PoseOutput, TransformOutput
from m2wr_gmapping.ros.reconfigure import CHANGEABLE, changed, make_reconfigure
from m2wr_gmapping.ros.state_autosave import StateAutosave, autosave_location
from m2wr_gmapping.srv import StateFile, StateFileResponse
from m2wr_maps import map_file
from m2wr_maps.ros.missing_inputs import warn_about_missing_inputs
from m2wr_maps.ros.scan_input import Intake, Wording
from m2wr_maps.saved_map_reader import MapReadingError
from m2wr_maps.scan_account import PASSED_OVER, REFUSED, SETTLING, THROTTLED, TIME_JUMP
from m2wr_node.ros.shutdown import until_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import frame
from m2wr_node.user_folder import from_user

if TYPE_CHECKING:
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.mapper import Mapper
    from m2wr_gmapping.ros.node_parameters import NodeOptions
    from m2wr_maps.transforms import Transform

WORDING = Wording("odom_frame", "base_frame", "set ~transform_publish_period to 0", "a new map is started")
SWITCH_INTERVAL = 0.0005    # callbacks of scans should not wait Python's default of 5 ms for the worker [s]
TIMES_KEPT = 200
PASSED_WARNING = 30.0       # time between two warnings about scans that are passed over [s]


class SlamNode:
    """ROS interface of the mapper: one worker thread runs it, callbacks only store messages.

    Parameters
    ----------
    config : GmappingConfig
    options : NodeOptions
    beginning : InitialState
    autosave : StateAutosave
    resumed : bool
        Whether the initial state is an autosaved one of this run.
    """

    def __init__(self, config: GmappingConfig, options: NodeOptions, beginning: InitialState,
                 autosave: StateAutosave, resumed: bool = False) -> None:
        self._config, self._options = config, options
        self._base, self._map_frame = frame(config["base_frame"]), frame(config["map_frame"])
        self._lock = threading.RLock()          # of the mapper
        self._mapper: Optional[Mapper] = None
        self._beginning = beginning
        self._autosave, self._resumed = autosave, resumed
        self._generation = 0
        self._counted = 0
        self._running: Optional[Mapper] = None      # the mapper that has used a scan of this run
        self._laser_frame = ""
        self._mount_check: Optional[MountCheck] = None      # of the first laser
        self._map_stamp: Optional[float] = None
        self._first_stamp: Optional[float] = None
        self._times: Deque[float] = deque(maxlen=TIMES_KEPT)        # of the last scans [ms], wall
        self._maps = MapOutput(self._map_frame)
        self._poses = PoseOutput(self._map_frame)
        self._transform = transform = TransformOutput(config)
        self._intake = Intake(frame(config["odom_frame"]), options.scan_queue, WORDING, self._map_frame,
                              lambda: transform.period > 0.0)
        self._diagnostics = Diagnostics(self._intake, lambda: (self._mapper, list(self._times)), self._maps,
                                        options.scan_queue)
        if beginning.loaded is not None:
            self._show(beginning.loaded)
        self._reconfigure = make_reconfigure(config, self._take_values)
        self._worker = threading.Thread(target=self._work, name="filter", daemon=True)
        self._worker.start()
        intake = self._intake
        rospy.Subscriber("/tf_static", TFMessage, lambda message: intake.on_transforms(message, True), queue_size=100)
        rospy.Subscriber("/tf", TFMessage, intake.on_transforms, queue_size=1000, tcp_nodelay=True)
        self._scans = rospy.Subscriber("scan", LaserScan, intake.on_scan, queue_size=options.scan_queue,
                                       buff_size=2**22, tcp_nodelay=True)
        self._services = [rospy.Service("~save_state", StateFile, self._save_state),
                          rospy.Service("~load_state", StateFile, self._load_state)]
        threading.Thread(target=warn_about_missing_inputs, args=(intake, self._scans.resolved_name), name="watch",
                         daemon=True).start()

    # ---- parameters that change

    def _take_values(self, values: Mapping[str, Any]) -> None:
        with self._lock:
            self._config = config = changed(self._config, values)
            if self._mapper is not None:
                self._mapper.config = config
            if self._beginning.loaded is not None:
                self._beginning.loaded.mapper.config = config
            self._transform.period = config["transform_publish_period"]

    # ---- state

    def _file(self, request: StateFile) -> str:
        if request.file:
            folder = self._options.state_folder or os.path.join(rospkg.get_ros_home(), "m2wr")
            try:
                return confined(folder, request.file, "~state_folder")
            except OutsideError as error:
                raise state.StateError(str(error)) from error
        if not self._options.state_file:
            raise state.StateError("no file name: expected one in the request or in the parameter ~state_file")
        return os.path.abspath(os.path.expanduser(self._options.state_file))

    def _save_state(self, request: StateFile) -> StateFileResponse:
        try:
            path = self._file(request)
            with self._lock, self._maps.busy:
                if self._mapper is None:
                    raise state.StateError("no state to save: no scan has been processed yet")
                taken = state.snapshot(self._mapper, self._host())
                processed = self._mapper.processed
            state.save(path, taken)
        except state.StateError as error:
            rospy.logerr("%s", error)
            return StateFileResponse(False, str(error))
        text = "saved the state after %d processed scans as %s" % (processed, path)
        rospy.loginfo("%s", text)
        return StateFileResponse(True, text)

    def _load_state(self, request: StateFile) -> StateFileResponse:
        try:
            path = self._file(request)
            with self._lock:
                live = self._config
            loaded = state.load(path, live)
        except state.StateError as error:
            rospy.logerr("%s", error)
            return StateFileResponse(False, str(error))
        with self._lock:
            self._forget_map()
            self._beginning = InitialState(loaded=loaded, runs_on=self._options.odometry_runs_on)
            self._config = config = loaded.mapper.config
            self._show(loaded)
        if self._reconfigure is not None:           # otherwise its next change would restore the old values
            self._reconfigure.update_configuration({name: config[name] for name in CHANGEABLE})
        text = "loaded the state after %d processed scans from %s" % (loaded.mapper.processed, path)
        rospy.loginfo("%s", text)
        for told in loaded.differing.values():
            rospy.logwarn("parameter of the state is used: %s", told)
        return StateFileResponse(True, text)

    def _show(self, loaded: state.State) -> None:
        """Publish the map of a state before the next scan."""
        mapper = loaded.mapper
        if mapper.filter is not None:
            self._transform.set(mapper.map_from_odom)
            self._maps.ask(mapper)

    def _forget_map(self) -> None:
        """Drop the mapper and the request of its map."""
        self._maps.forget()
        if self._mapper is not None:
            self._mapper.close()
        self._mapper = self._running = self._map_stamp = None

    # ---- the worker

    def _work(self) -> None:
        while True:
            taken = self._intake.next()
            if taken is None:
                return
            scan, odom_from_laser, generation = taken
            try:
                with self._lock, until_shutdown():
                    if generation != self._generation:
                        self._start_new_run(generation)
                    self._take(scan, odom_from_laser)
            except (ScanError, ValueError) as error:
                self._refuse(scan, error)
            except Exception as error:      # keep the map after an internal error
                logging.getLogger("rosout").exception("scan at %.3f failed", scan.header.stamp.to_sec())
                self._refuse(scan, error)

    def _refuse(self, scan: LaserScan, error: Exception) -> None:
        count = self._intake.account.leave_out(REFUSED)
        rospy.logwarn_throttle(5.0, "scan at %.3f refused (%d so far): %s" % (scan.header.stamp.to_sec(), count, error))

    def _start_new_run(self, generation: int) -> None:
        self._generation = generation
        self._forget_map()
        self._first_stamp, self._beginning = None, self._beginning.again()
        self._transform.set((0.0, 0.0, 0.0))

    def _take(self, scan: LaserScan, odom_from_laser: Transform) -> None:
        self._counted += 1
        account = self._intake.account
        if self._counted % max(1, self._config["throttle_scans"]):
            account.leave_out(THROTTLED)
            return
        began, stamp = time.perf_counter(), scan.header.stamp.to_sec()
        self._first_stamp = stamp if self._first_stamp is None else self._first_stamp
        if self._resumed and not self._is_same_run(stamp):
            account.leave_out(TIME_JUMP)
            return
        if stamp < self._first_stamp + self._options.settle_time:
            account.leave_out(SETTLING)
            return
        mapper = self._begin(scan) if self._mapper is None else self._mapper
        if frame(scan.header.frame_id) != self._laser_frame:
            raise ScanError("its frame is {}; expected {} as in the first one".format(
                frame(scan.header.frame_id), self._laser_frame))
        odom_pose = mapper.laser.sensor_pose(*odom_from_laser)
        if mapper is self._running and len(scan.ranges) == len(mapper.laser.angles) \
                and may_pass(mapper, odom_pose, stamp, self._intake.waiting, self._options.scan_queue):
            self._pass_over()
            return
        reading = mapper.reading(scan.ranges)
        told = self._beginning.connect(mapper, reading, odom_pose, stamp)
        if told:
            rospy.loginfo("%s", told)
        update = mapper.process(reading, odom_pose, stamp, mapper.laser.slope(odom_from_laser[1]))
        self._running = mapper
        self._times.append(1e3 * (time.perf_counter() - began))
        if mapper.beyond:
            rospy.logwarn_throttle(30.0, "the map has reached its size limit; points outside are ignored. The robot is "
                                   "at (%.1f, %.1f)" % tuple(mapper.base_poses(update.pose)[:2]))
        if update.processed and self._mount_check is not None:
            for text in self._mount_check.messages(mapper.calibration()):
                rospy.logwarn("%s", text)
        self._transform.set(mapper.map_from_odom)
        self._poses.publish(mapper, update, scan.header.stamp)
        since = math.inf if self._map_stamp is None else stamp - self._map_stamp
        if update.processed and not 0.0 <= since <= self._config["map_update_interval"]:
            self._map_stamp = stamp
            self._maps.ask(mapper)
        if self._autosave.due() and self._maps.busy.acquire(blocking=False):
            try:
                self._autosave.keep(mapper, self._host())
            finally:
                self._maps.busy.release()

    def _pass_over(self) -> None:
        """Count a scan that is not matched because others wait."""
        count = self._intake.account.leave_out(PASSED_OVER)
        rospy.logwarn_throttle(PASSED_WARNING, "scans arrive faster than they can be matched: %d of %d were passed "
                               "over; none of them was due" % (count, self._intake.arrived))

    def _host(self) -> Dict[str, Any]:
        """Return the values that are stored with a state beside the mapper."""
        return dict(laser_frame=self._laser_frame, map_stamp=self._map_stamp, counted=self._counted)

    def _is_same_run(self, stamp: float) -> bool:
        """Return whether the first scan after a restart continues the autosaved state."""
        loaded, self._resumed = self._beginning.loaded, False
        if loaded is None:
            return True
        last = loaded.mapper.stamps[-1]
        if stamp < last:
            rospy.logwarn("time jumped back from %.3f to %.3f while this node was restarted: starting a new map",
                          last, stamp)
            self._start_new_run(self._generation)
            return False
        self._first_stamp = -math.inf           # settle_time is over
        return True

    def _begin(self, scan: LaserScan) -> Mapper:
        mount = self._intake.mount(self._base, scan)
        if mount is None:
            raise ScanError("the mount of the laser is unknown: " + self._intake.missing(
                self._base, scan.header.frame_id, scan.header.stamp))
        if self._beginning.loaded is None:
            self._config = read_ranges(self._config)
        config = self._config
        laser = LaserModel.from_message(
            scan.angle_min, scan.angle_max, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max,
            mount, config["maxRange"], config["maxUrange"])
        warning = config.score_warning(len(scan.ranges))
        if warning is not None:
            rospy.logwarn("%s", warning)
        self._laser_frame = frame(scan.header.frame_id)
        loaded = self._beginning.loaded
        if loaded is not None:
            self._laser_frame = loaded.host.get("laser_frame") or self._laser_frame
            self._map_stamp, self._counted = loaded.host.get("map_stamp"), loaded.host.get("counted", self._counted)
        self._mount_check = self._mount_check or MountCheck(self._base, self._laser_frame)
        self._mapper = mapper = self._beginning.mapper(config, laser)
        rospy.loginfo("laser %s: %d beams of %.2f degrees, used to %g m; map starts at %.3f", self._laser_frame,
                      len(scan.ranges), abs(scan.angle_increment) * 57.29577951308232, laser.max_urange,
                      scan.header.stamp.to_sec())
        return mapper

    # ---- the end

    def close(self) -> bool:
        """End all threads and write the map if requested. Returns whether this succeeded."""
        self._intake.close()
        self._worker.join()
        rospy.loginfo("%s", self._intake.account.text())
        self._maps.close()
        mapper, name, loaded = self._mapper, self._options.save_on_exit, self._beginning.loaded
        if mapper is None and loaded is not None:
            mapper = loaded.mapper          # no scan was processed with it
        if mapper is None:
            self._autosave.forget()
            if name:
                rospy.logwarn("no map to save as %s: no scan has been processed", name)
            return not name
        try:
            if name and mapper.filter is not None:
                self._finish(mapper)
                grid = mapper.occupancy()
                for path in map_file.save(name, grid.data, grid.resolution, (grid.origin[0], grid.origin[1], 0.0)):
                    rospy.loginfo("wrote %s", path)
        except (OSError, ValueError) as error:
            rospy.logerr("%s", error)
            return False
        finally:
            mapper.close()
        self._autosave.forget()
        return True

    @staticmethod
    def _finish(mapper: Mapper) -> None:
        try:
            mapper.finish()
        except Exception:               # save the map after an internal error
            logging.getLogger("rosout").exception("the last optimisation failed; the map is saved without it")


def _ignoring_os_errors(emit: Callable[[logging.LogRecord], object]) -> Callable[[logging.LogRecord], None]:
    """Return ``emit`` of a log handler that ignores OSError, for a full disk or a closed terminal."""
    def guarded(record: logging.LogRecord) -> None:
        try:
            emit(record)
        except OSError:
            pass                        # the error cannot be logged either
    return guarded


def log_through_rospy() -> None:
    """Send the library's log to the screen and to /rosout; errors of the screen are ignored."""
    log, rosout = logging.getLogger("m2wr_gmapping"), logging.getLogger("rosout")
    for handler in rosout.handlers:
        handler.emit = _ignoring_os_errors(handler.emit)   # type: ignore  # rospy makes the handlers, of its classes
    log.handlers, log.propagate = rosout.handlers, rosout.propagate
    log.setLevel(logging.INFO)


def _prepare() -> Tuple[Tuple[GmappingConfig, NodeOptions, InitialState, StateAutosave, bool], List[str]]:
    """Read parameters and files; returns what a SlamNode takes and warnings, raises ConfigError and others."""
    given = private_parameters()
    config, options, warnings = read_parameters(given)
    config = with_prefix(config, tf_prefix())
    check_frames(config)
    options = replace(options, save_on_exit=from_user(options.save_on_exit),
                      state_folder=from_user(options.state_folder), state_file=from_user(options.state_file),
                      map_file=from_user(options.map_file))
    warnings.extend(save_on_exit_warnings(options.save_on_exit))
    if options.save_on_exit:
        map_file.tidy(options.save_on_exit)
    if options.initial_pose is not None and not options.map_file:
        warnings.append("~initial_pose_x, _y, _a have no effect without ~map_file")
    autosave = StateAutosave(*autosave_location(), period=options.state_save_period)
    kept = autosave.resume(config)
    if kept is not None:
        warnings.append("this node was killed: continuing the map of %.3f, after %d processed scans" % (
            kept.mapper.stamps[-1], kept.mapper.processed))
        beginning, config = InitialState(loaded=kept, runs_on=options.odometry_runs_on), kept.mapper.config
        return (config, options, beginning, autosave, True), warnings
    state_file = options.state_file
    if state_file and not os.path.exists(state_file):
        warnings.append("there is no state %s yet: starting a new map" % state_file)
        state_file = ""
    beginning, config = InitialState.from_files(config, options.map_file, options.initial_pose, state_file,
                                                options.odometry_runs_on)
    warnings.extend("parameter of the state is used: " + text for text in beginning.differing(given))
    return (config, options, beginning, autosave, False), warnings


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("slam_gmapping")
    sys.setswitchinterval(SWITCH_INTERVAL)
    log_through_rospy()
    try:
        prepared, warnings = _prepare()
    except (ConfigError, MapReadingError, state.StateError) as error:
        rospy.logfatal("%s", error)
        if private_parameters().get("respawn") is True:
            rospy.spin()                # a restart would only repeat the error
        return 1
    for warning in warnings:
        rospy.logwarn("%s", warning)
    rospy.loginfo("parameters: %s", ", ".join("%s %s" % item for item in prepared[0].values.items()))
    compile_kernels()
    node = SlamNode(*prepared)
    rospy.loginfo("ready, listening to %s", rospy.resolve_name("scan"))
    rospy.spin()
    return 0 if node.close() else 1
