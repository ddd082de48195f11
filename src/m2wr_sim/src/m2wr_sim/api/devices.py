# SPDX-License-Identifier: BSD-3-Clause
"""A robot's drive and lasers without messages: the plugins' own timing and arithmetic, records instead of topics."""
import logging
from contextlib import contextmanager

from m2wr_sim.api.records import Odometry, Scan
from m2wr_sim.plugins.diff_drive import DiffDrive
from m2wr_sim.plugins.laser import Laser
from m2wr_sim.runtime.ports import Ports
from m2wr_sim.runtime.simulator import Simulator

#: When a robot senses: at the rates of its description, at the end of each step, or (lasers) not at all.
SENSING = ("due", "now", "off")


class DirectDrive(DiffDrive):
    """The differential drive; :meth:`command` in, ``odometry`` out."""

    def configure(self, spec, ctx):
        self.odometry, self.callbacks = None, []
        super().configure(spec, ctx)

    def measure_now(self, now_ns):
        """Take the odometry of this instant, between the ticks."""
        self.odometry = Odometry(now_ns / 1e9, *self._values())
        return self.odometry

    def _values(self):
        position, orientation, twist = self.measure()
        return (position, orientation) + twist

    def _send_odometry(self, stamp):
        self.odometry = Odometry(stamp / 1e9, *self._values())
        for callback in self.callbacks:
            callback(self.odometry)

    def reset(self, now_ns, rewound):
        """Unlike Gazebo's, the motors forget their speed too: after a reset all is as at the start."""
        super().reset(now_ns, rewound)
        self.odometry = None
        if rewound:
            self._instructed = (0.0, 0.0)
            for joint in (self._left, self._right):
                self._physics.set_joint_motor(joint, 0.0, self._torque)


class DirectLaser(Laser):
    """A laser that always measures when it is due, as if its topic had a subscriber.

    Attributes
    ----------
    scan : Scan or None
        The newest.
    enabled : bool
        Whether it measures by itself.
    """

    def configure(self, spec, ctx):
        self.scan, self.enabled, self.callbacks = None, True, []
        super().configure(spec, ctx)

    @property
    def name(self):
        """The sensor's name in the robot description."""
        return self._ctx.sensor.name

    @property
    def angles(self):
        """Direction of each beam of a row in the laser's frame [rad]."""
        return self._laser.angles

    @property
    def count(self):
        """Number of readings in a scan, all rows together."""
        return self._laser.count * self._laser.vertical_count

    @property
    def range_max(self):
        """Longest range [m]."""
        return self._laser.range_max

    def wanted(self):
        return self.enabled

    def after_step(self, now_ns):
        if self.awake and self._schedule.due(now_ns):
            self.measure_now(now_ns)
            for callback in self.callbacks:
                callback(self.scan)

    def measure_now(self, now_ns):
        """Take a scan at this instant; it uses up noise like any other."""
        laser = self._laser
        ranges, intensities = self.measure()
        self.scan = Scan(now_ns / 1e9, ranges.copy(), intensities.copy(), laser.angles, laser.angle_min,
                         laser.angle_max, laser.angle_increment, laser.range_min, laser.range_max)
        return self.scan

    def reset(self, now_ns, rewound):
        self.scan = None
        if rewound:
            self._schedule.restart()
            self._make_laser()          # a new one: the bias of the noise depends on the seed, too


_DIRECT = {DiffDrive: DirectDrive, Laser: DirectLaser}


class DirectSimulator(Simulator):
    """The simulator with the devices above in place of the plugins that speak in messages."""

    @staticmethod
    def plugin_class(filename):
        found = Simulator.plugin_class(filename)
        return _DIRECT.get(found, found)

    def devices(self, name, kind):
        """Return the devices of one kind that a model has, in the order of its description."""
        return [plugin for plugin, _, _ in self.models[name].plugins if isinstance(plugin, kind)]


class _SilentPort:
    """A topic without subscriber."""

    @staticmethod
    def publish(message):
        """Drop the message."""

    @staticmethod
    def wanted():
        """Return False: there is no subscriber, so plugins need not measure."""
        return False

    @staticmethod
    def close():
        """Nothing was opened."""


class SilentPorts(Ports):
    """No topics, transforms or clock at all, for plugins other than the devices above."""

    def advertise(self, topic, message_class, queue_size, namespace):
        return _SilentPort()

    def subscribe(self, topic, message_class, callback, namespace):
        return _SilentPort()

    def serve(self, name, service_class, handler, namespace):
        return _SilentPort()

    def deliver(self):
        pass

    def transform(self, stamp, parent, child, position, orientation):
        pass

    def moment(self, now_ns):
        return now_ns

    def frame(self, name, namespace):
        return name.lstrip("/")

    def clock(self, now_ns):
        pass


@contextmanager
def said_once(quiet):
    """Keep warnings of the simulator back inside the block if ``quiet``: they were said for the same record before."""
    logger = logging.getLogger("m2wr_sim")
    level = logger.level
    if quiet:
        logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
