# SPDX-License-Identifier: BSD-3-Clause
"""``amcl``: scans, transforms and a map in; the robot's pose and the transform of map to odometry out."""
from __future__ import annotations

import logging
import math
import threading
import time
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.srv import SetMap, SetMapResponse
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty, EmptyResponse
from tf2_msgs.msg import TFMessage

from m2wr_maps.ros.message_conversion import ArrayGrid
from m2wr_maps.ros.missing_inputs import warn_about_missing_inputs
from m2wr_maps.ros.scan_input import Intake, Wording
from m2wr_maps.se2 import between, compose
from m2wr_navigation.localization.amcl_parameters import PARAMETERS, checked
from m2wr_navigation.localization.beams import Beams, ScanError, ScanGeometry
from m2wr_navigation.localization.kernel_tour import compile_localization_kernels
from m2wr_navigation.localization.localization_map import LocalizationMap, MapError
from m2wr_navigation.localization.localizer import Localizer
from m2wr_navigation.parameters import read, unknown
from m2wr_navigation.ros.amcl_messages import map_of_message, planar, pose_of_message
from m2wr_navigation.ros.amcl_outputs import Outputs
from m2wr_navigation.ros.reconfigure import serve
from m2wr_navigation.ros.static_map import fetch_map
from m2wr_node.ros.shutdown import at_shutdown, until_shutdown
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    import genpy

    from m2wr_maps.transforms import Transform
    from m2wr_node.array_types import FloatArray

SCAN_QUEUE = 100            # scans that may wait for transforms, amcl's
WORDING = Wording("odom_frame_id", "base_frame_id", "set ~tf_broadcast to false",
                  "the robot is taken to be at its initial pose again")
INITIAL = ("initial_pose_x", "initial_pose_y", "initial_pose_a")
INITIAL_COVARIANCE = ("initial_cov_xx", "initial_cov_yy", "initial_cov_aa")


class AmclNode:
    """ROS interface of the localizer: one worker thread runs it, callbacks only change it between two scans.

    Parameters
    ----------
    values : dict of str to object
        Parameters of ``amcl_parameters``.
    """

    def __init__(self, values: Dict[str, Any]) -> None:
        self._values = values
        self._odom, self._base, self._map = (values[name] for name in (
            "odom_frame_id", "base_frame_id", "global_frame_id"))
        self._lock = threading.RLock()              # of the localizer
        self._localizer: Optional[Localizer] = None
        self._initial = self._initial_pose(values)
        self._moved_pose: Optional[Tuple[FloatArray, FloatArray]] = None    # an initialpose that came before the map
        self._generation = 0
        self._refused: Dict[str, int] = {}
        self._outputs = Outputs(values)
        self._intake = Intake(self._odom, SCAN_QUEUE, WORDING, self._map, lambda: bool(self._values["tf_broadcast"]))
        intake = self._intake
        rospy.Subscriber("/tf_static", TFMessage, lambda message: intake.on_transforms(message, True), queue_size=100)
        rospy.Subscriber("/tf", TFMessage, intake.on_transforms, queue_size=1000, tcp_nodelay=True)
        self._scans = rospy.Subscriber("scan", LaserScan, intake.on_scan, queue_size=SCAN_QUEUE, buff_size=2**22,
                                       tcp_nodelay=True)
        rospy.Subscriber("initialpose", PoseWithCovarianceStamped, self._on_initial_pose, queue_size=2)
        self._services = [rospy.Service("global_localization", Empty, self._anywhere),
                          rospy.Service("request_nomotion_update", Empty, self._force_update),
                          rospy.Service("set_map", SetMap, self._set_map)]
        self._reconfigure = serve("~", PARAMETERS, dict(values), self._take_values)
        threading.Thread(target=self._work, name="filter", daemon=True).start()
        threading.Thread(target=warn_about_missing_inputs, args=(intake, self._scans.resolved_name), name="watch",
                         daemon=True).start()
        at_shutdown(self._close)

    def _close(self) -> None:
        self._intake.close()
        self._outputs.save_pose()

    # ---- maps

    @staticmethod
    def _initial_pose(values: Dict[str, Any]) -> Tuple[FloatArray, FloatArray]:
        return (np.array([values[name] for name in INITIAL]),
                np.diag([values[name] for name in INITIAL_COVARIANCE]))

    def _on_map(self, message: ArrayGrid) -> None:
        """Take a map of the topic; the pose starts again from the parameters, which hold the last one."""
        with self._lock:
            if self._localizer is not None and self._values["first_map_only"]:
                return
            if self._localizer is not None:
                stored = {name: rospy.get_param("~" + name, self._values[name])
                          for name in INITIAL + INITIAL_COVARIANCE}
                self._values.update(read(PARAMETERS, {**self._values, **stored}, rospy.get_name())[0])
        try:
            self._use_map(map_of_message(message), message.header.frame_id, None)
        except MapError as error:
            rospy.logerr("the map on %s is refused: %s", rospy.resolve_name("map"), error)

    def _use_map(self, grid: LocalizationMap, frame: str, start: Optional[Tuple[FloatArray, FloatArray]]) -> None:
        """Localize on another map.

        Parameters
        ----------
        grid : LocalizationMap
        frame : str
            In the map's header.
        start : (mean, covariance) or None
            None: the parameters.
        """
        if frame.lstrip("/") != self._map:
            rospy.logwarn("the map's frame is %r, the parameter ~global_frame_id is %r: the map is used as if it were "
                          "in the second", frame, self._map)
        if self._values["laser_model_type"] != "beam":
            grid.fields(self._values["laser_likelihood_max_dist"])      # takes time: before the lock
        with self._lock:
            mean, covariance = start or self._moved_pose or self._initial_pose(self._values)
            if self._localizer is None:
                self._localizer = Localizer(grid, self._values, np.random.default_rng(self._values["seed"]))
            else:
                self._localizer.set_map(grid)
            self._outputs.forget()
            self._localizer.start_at(mean, covariance, start is not None and self._values["force_update_after_set_map"])
        rospy.loginfo("localizing on a map of %d x %d cells of %g m, %d of them free; start at (%.2f, %.2f), %.0f "
                      "degrees", grid.cells.shape[1], grid.cells.shape[0], grid.resolution, len(grid.free), mean[0],
                      mean[1], math.degrees(mean[2]))

    def _set_map(self, request: Any) -> SetMapResponse:
        try:
            pose, covariance = pose_of_message(request.initial_pose.pose)
            self._use_map(map_of_message(request.map), request.map.header.frame_id, (pose, covariance))
        except (MapError, ValueError) as error:
            rospy.logerr("set_map is refused: %s", error)
            return SetMapResponse(False)
        return SetMapResponse(True)

    # ---- requests

    def _anywhere(self, _: object) -> EmptyResponse:
        with self._lock:
            if self._localizer is None:
                raise rospy.ServiceException("there is no map yet")
            self._localizer.start_anywhere()
        rospy.loginfo("looking for the robot in the whole map: %d particles", self._values["max_particles"])
        return EmptyResponse()

    def _force_update(self, _: object) -> EmptyResponse:
        with self._lock:
            if self._localizer is None:
                raise rospy.ServiceException("there is no map yet")
            self._localizer.force_update()
        return EmptyResponse()

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            pose, covariance = pose_of_message(message.pose)
            pose = self._on_the_map(message.header.frame_id.lstrip("/"), pose)
            pose = self._since(pose, message.header.stamp)
        except ValueError as error:
            rospy.logwarn("the pose on %s is ignored: %s", rospy.resolve_name("initialpose"), error)
            return
        with self._lock:
            rospy.loginfo("initial pose: (%.3f, %.3f), %.1f degrees", pose[0], pose[1], math.degrees(pose[2]))
            if self._localizer is None:
                self._moved_pose = pose, covariance
                return
            self._localizer.start_at(pose, covariance, self._values["force_update_after_initialpose"])

    def _on_the_map(self, frame: str, pose: FloatArray) -> FloatArray:
        """Return a pose of a message in the map's frame; raises ValueError if its frame cannot be used."""
        if not frame:
            rospy.logwarn("the pose on %s has no frame: taken to be in %s", rospy.resolve_name("initialpose"),
                          self._map)
        if frame in ("", self._map):
            return pose
        with self._lock:
            place = self._localizer.map_from_odom if self._localizer is not None else None
        if place is not None and frame == self._odom:
            return compose(place, pose)
        raise ValueError("its frame is {!r}; expected {!r}, or {!r} when the robot is localized".format(
            frame, self._map, self._odom))

    def _since(self, pose: FloatArray, stamp: genpy.Time) -> FloatArray:
        """Return a pose after the motion that odometry has measured since ``stamp``."""
        before = self._intake.in_odometry(self._base, stamp) if stamp else None
        now = self._intake.in_odometry(self._base, rospy.Time(0))
        if before is None or now is None:
            return pose
        return compose(pose, between(planar(*before), planar(*now)))

    def _take_values(self, values: Dict[str, Any]) -> None:
        with self._lock:
            for warning in checked(values):
                rospy.logwarn("%s", warning)
            self._values = values
            self._outputs.values = values
            if self._localizer is not None:
                self._localizer.configure(values)

    # ---- the worker

    def _work(self) -> None:
        try:
            if self._values["use_map_topic"]:
                rospy.Subscriber("map", ArrayGrid, self._on_map, queue_size=1)
                rospy.loginfo("waiting for the map on %s", rospy.resolve_name("map"))
            else:
                grid, frame = fetch_map()
                self._use_map(grid, frame, None)
        except rospy.ROSInterruptException:
            return
        while True:
            taken = self._intake.next()
            if taken is None:
                return
            scan, _, generation = taken
            try:
                with self._lock, until_shutdown():
                    self._take(scan, generation)
            except (ScanError, ValueError) as error:
                self._refuse(scan, str(error))
            except Exception as error:      # keep the pose after an internal error
                logging.getLogger("rosout").exception("scan at %.3f failed", scan.header.stamp.to_sec())
                self._refuse(scan, str(error))

    def _refuse(self, scan: LaserScan, why: str) -> None:
        self._refused[why[:80]] = count = self._refused.get(why[:80], 0) + 1
        if len(self._refused) > 100:
            self._refused.clear()
        if count == 1 or not count % 1000:
            rospy.logwarn("scan at %.3f of %s refused: %s (%d such scans)", scan.header.stamp.to_sec(),
                          scan.header.frame_id, why, count)

    def _take(self, scan: LaserScan, generation: int) -> None:
        if self._localizer is None:
            return
        localizer = self._localizer
        if generation != self._generation:
            self._generation = generation
            localizer.start_at(*self._initial)
            self._outputs.forget()
        mount = self._intake.mount(self._base, scan)
        base = self._intake.in_odometry(self._base, scan.header.stamp)
        if mount is None or base is None:
            missing = (self._base, scan.header.frame_id) if mount is None else (self._odom, self._base)
            raise ScanError("it lacks " + self._intake.missing(missing[0], missing[1], scan.header.stamp))
        began = time.perf_counter()
        beams = self._beams(scan, mount)
        outcome = localizer.process(scan.header.frame_id.lstrip("/"), beams, planar(*base))
        self._outputs.publish(outcome, localizer, scan.header.stamp, 1e3 * (time.perf_counter() - began))

    def _beams(self, scan: LaserScan, mount: Transform) -> Beams:
        return Beams.from_scan(scan.ranges, ScanGeometry(
            scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max), mount,
            self._values["laser_min_range"], self._values["laser_max_range"])


def read_parameters() -> Tuple[Dict[str, Any], List[str]]:
    """Return the node's parameters, and warnings about those that are not used as they are."""
    given = dict(rospy.get_param("~", {}) or {})
    values, warnings = read(PARAMETERS, given, rospy.get_name())
    warnings += checked(values)
    warnings += unknown(given, PARAMETERS, rospy.get_name())
    if "corrected" not in values["odom_model_type"]:
        warnings.append("odom_model_type {0}: its alphas give deviations, as in the original; {0}-corrected takes them "
                        "for variances, as the formula's source does, and needs smaller ones".format(
                            values["odom_model_type"]))
    return values, warnings


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("amcl")
    values, warnings = read_parameters()
    for warning in warnings:
        rospy.logwarn("%s", warning)
    compile_localization_kernels()
    node = AmclNode(values)
    rospy.loginfo("ready, listening to %s", rospy.resolve_name("scan"))
    rospy.spin()
    del node
    return 0
