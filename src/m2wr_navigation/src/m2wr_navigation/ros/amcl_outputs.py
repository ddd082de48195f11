# SPDX-License-Identifier: BSD-3-Clause
"""What ``amcl`` publishes: pose, particles, transform, diagnostics; and the pose it stores as a parameter."""
from __future__ import annotations

import math
import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Deque, Dict, Mapping, Optional

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, TransformStamped
from tf2_msgs.msg import TFMessage

from m2wr_maps.ros.message_conversion import covariance36, pose_message, poses_message
from m2wr_navigation.localization.confidence import doubt

if TYPE_CHECKING:
    import genpy

    from m2wr_navigation.localization.localizer import Localizer, Outcome
    from m2wr_navigation.localization.particle_filter import Cluster
    from m2wr_node.array_types import FloatArray

DIAGNOSTICS_PERIOD = 1.0    # [s], wall
SILENCE = 15.0              # wall time without a scan after which a warning is due [s], amcl's
DOUBT = 30.0                # wall time between two warnings about it [s]
TIMES_KEPT = 200


class Outputs:
    """Publishers of the node, and a thread for diagnostics and stored poses.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of ``amcl_parameters``.

    Attributes
    ----------
    values : mapping of str to object
        The present ones.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values = values
        self._map, self._odom = values["global_frame_id"], values["odom_frame_id"]
        self._pose = rospy.Publisher("amcl_pose", PoseWithCovarianceStamped, queue_size=2, latch=True)
        self._cloud = rospy.Publisher("particlecloud", PoseArray, queue_size=2, latch=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self._last: Optional[Cluster] = None
        self._present: Optional[FloatArray] = None      # pose at the newest scan
        self._stored: Optional[FloatArray] = None
        self._times: Deque[float] = deque(maxlen=TIMES_KEPT)        # of the last scans [ms], wall
        self._count = self._particles = 0
        self._share, self._doubt = math.nan, ""
        self._errors: FloatArray = np.zeros(3)          # of odometry
        self._saving = threading.Lock()
        threading.Thread(target=self._work, name="diagnostics", daemon=True).start()

    def forget(self) -> None:
        """Do not store the poses of before; the robot starts again."""
        self._last = self._present = None

    def publish(self, outcome: Outcome, localizer: Localizer, stamp: genpy.Time, milliseconds: float) -> None:
        """Publish what a scan has led to.

        Parameters
        ----------
        outcome : Outcome
        localizer : Localizer
        stamp : genpy.Time
            Of the scan.
        milliseconds : float
            Wall time that it took.
        """
        self._count, self._particles = self._count + 1, len(localizer.filter.poses)
        self._times.append(milliseconds)
        if outcome.map_from_odom is not None and self.values["tf_broadcast"]:
            self._send_transform(outcome.map_from_odom, stamp)
        if outcome.updated:
            self._cloud.publish(poses_message(localizer.filter.poses, self._map, stamp))
        if outcome.injected:
            rospy.loginfo_throttle(5.0, "the scans fit worse than before: %d of %d particles are random poses" % (
                outcome.injected, self._particles))
        self._share = outcome.share
        self._doubt = doubt(outcome.share, outcome.weight) if outcome.map_from_odom is not None else ""
        if self._doubt:
            rospy.logwarn_throttle(DOUBT, self._doubt)
        if outcome.estimate is not None:
            self._send_pose(outcome.estimate, stamp)
        self._present = localizer.pose
        self._errors = localizer.calibration.errors

    def _send_pose(self, estimate: Cluster, stamp: genpy.Time) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = self._map, stamp
        message.pose.pose = pose_message(estimate.pose)
        message.pose.covariance = covariance36(estimate.covariance)
        self._last = estimate
        self._pose.publish(message)

    def _send_transform(self, map_from_odom: FloatArray, stamp: genpy.Time) -> None:
        message = TransformStamped(child_frame_id=self._odom)
        message.header.frame_id = self._map
        message.header.stamp = stamp + rospy.Duration.from_sec(self.values["transform_tolerance"])
        placed = pose_message(map_from_odom)
        message.transform.rotation = placed.orientation
        message.transform.translation.x, message.transform.translation.y = placed.position.x, placed.position.y
        self._tf.publish(TFMessage([message]))

    # ---- the thread

    def save_pose(self) -> None:
        """Store the newest pose as the parameters of the next start."""
        with self._saving:
            estimate, pose = self._last, self._present
            if estimate is None or pose is None or pose is self._stored:
                return
            spread = np.diag(estimate.covariance)
            numbers: Dict[str, float] = dict(zip(
                ("initial_pose_x", "initial_pose_y", "initial_pose_a", "initial_cov_xx", "initial_cov_yy",
                 "initial_cov_aa"), [float(value) for value in (*pose, *spread)]))
            try:
                for name, value in numbers.items():
                    rospy.set_param("~" + name, value)
            except (OSError, rospy.ROSException) as error:
                if not rospy.core.is_shutdown_requested():      # at the end the master may be gone
                    rospy.logwarn_throttle(60.0, "the pose was not stored as ~initial_pose_*: %s" % error)
                return
            self._stored = pose

    def _work(self) -> None:
        seen, quiet, unsaved = 0, 0.0, 0.0
        while not rospy.is_shutdown():
            rate = self.values["save_pose_rate"]
            unsaved += DIAGNOSTICS_PERIOD
            if rate > 0.0 and unsaved >= 1.0 / rate:
                unsaved = 0.0
                self.save_pose()
            quiet = quiet + DIAGNOSTICS_PERIOD if seen == self._count else 0.0
            seen = self._count
            if quiet >= SILENCE and seen:
                quiet = 0.0
                rospy.logwarn("no usable scan on %s for %.0f s: the pose and its transform stay as they are",
                              rospy.resolve_name("scan"), SILENCE)
            try:
                self._diagnostics.publish(self._message())
            except rospy.ROSException:
                return
            rospy.rostime.wallsleep(DIAGNOSTICS_PERIOD)

    def _message(self) -> DiagnosticArray:
        estimate = self._last
        status = DiagnosticStatus(name="%s: Standard deviation" % rospy.get_name().lstrip("/"), hardware_id="None",
                                  level=DiagnosticStatus.OK, message="OK")
        values = [("scans", self._count), ("particles", self._particles), ("beams that fit", "%.2f" % self._share)]
        values += [("odometry's distances are corrected by [%]", "%.2f" % (100.0 * self._errors[0])),
                   ("odometry's turns are corrected by [%]", "%.2f" % (100.0 * self._errors[1])),
                   ("a straight line of odometry turns by [rad/m]", "%.4f" % self._errors[2])]
        if self._times:
            values.append(("mean time of a scan [ms]", "%.2f" % np.mean(list(self._times))))
        if estimate is None:
            status.message = "no pose yet"
        else:
            spread = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0))
            for name, deviation in zip(("x", "y", "yaw"), spread):
                limit = self.values["std_warn_level_" + name]
                values += [("std_" + name, "%.4f" % deviation), ("std_warn_level_" + name, limit)]
                if deviation > limit:
                    status.level, status.message = DiagnosticStatus.WARN, "Too large"
        if self._doubt:
            status.level, status.message = DiagnosticStatus.WARN, self._doubt
        status.values = [KeyValue(key, str(value)) for key, value in values]
        message = DiagnosticArray(status=[status])
        message.header.stamp = rospy.Time.now()
        return message
