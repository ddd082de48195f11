"""What the simulation says about itself on ``/diagnostics``."""
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from m2wr_sim.ros.convert import stamp_of

_PERIOD = 1.0       # s of wall time


class Diagnostics:
    """Publishes one status a second of wall time; :meth:`turn` is called often and mostly does nothing."""

    def __init__(self, simulator, factor):
        self._simulator, self._factor = simulator, factor
        self._publisher = simulator.ports.advertise("/diagnostics", DiagnosticArray, 10, "")
        self._last = (time.monotonic(), simulator.now_ns)
        self._run_seconds = self._run_sim_ns = 0
        self._messages, self._seen, self._reported = simulator.engine.solver_messages, 0, set()
        self._lost = 0

    def set_factor(self, factor):
        """Judge by another real-time factor from now on."""
        self._factor = factor

    def turn(self):
        """Publish if a second has passed, and at once when something has been touched for the first time."""
        wall = time.monotonic()
        elapsed = wall - self._last[0]
        if not self._report_touches() and elapsed < _PERIOD:
            return
        advanced_ns = self._simulator.now_ns - self._last[1]
        self._last = (wall, self._simulator.now_ns)
        if not self._simulator.paused and advanced_ns >= 0:
            self._run_seconds += elapsed
            self._run_sim_ns += advanced_ns
        self._publish(max(0.0, advanced_ns * 1e-9 / max(elapsed, 1e-6)))

    def _publish(self, factor):
        simulator = self._simulator
        messages = simulator.engine.solver_messages
        new_messages, self._messages = messages - self._messages, messages
        dropped = simulator.ports.dropped()
        lost = sum(entry.count for entry in dropped)
        new_lost, self._lost = lost - self._lost, lost
        status = DiagnosticStatus(name="m2wr_sim: simulation", hardware_id="simulation")
        status.level, status.message = self._judge(factor, new_messages, new_lost)
        mean = self._run_sim_ns * 1e-9 / self._run_seconds if self._run_seconds else 0.0
        values = [("simulated time [s]", "%.3f" % (simulator.now_ns * 1e-9)), ("real-time factor", "%.2f" % factor),
                  ("mean real-time factor", "%.2f" % mean),
                  ("wanted real-time factor", "%g" % self._factor if self._factor else "as fast as possible"),
                  ("step [ms]", "%g" % (simulator.step_ns * 1e-6)), ("solver messages", str(messages)),
                  ("models", str(len(simulator.models)))]
        values += [("touches of " + name, str(count)) for name, count in sorted(simulator.touch_counts.items())]
        values += [("dropped on %s for %s" % (entry.topic, entry.peer or "those that have left"), str(entry.count))
                   for entry in dropped]
        status.values = [KeyValue(key, value) for key, value in values]
        array = DiagnosticArray(status=[status])
        array.header.stamp = stamp_of(simulator.now_ns)
        self._publisher.publish(array)

    def _judge(self, factor, new_messages, new_lost):
        if self._simulator.paused:
            return DiagnosticStatus.OK, "paused"
        if new_messages > 10:
            return DiagnosticStatus.WARN, "the solver complains: %d messages in the last second" % new_messages
        if new_lost > 0:
            return DiagnosticStatus.WARN, "subscribers read too slowly: %d messages dropped" % new_lost
        if self._factor and factor < 0.9 * self._factor:
            return DiagnosticStatus.WARN, "slower than wanted: %.2f instead of %g" % (factor, self._factor)
        return DiagnosticStatus.OK, "running at %.2f times real time" % factor

    def _report_touches(self):
        """Log the first touch of each pair, so that a bump does not go unseen; return whether there was one."""
        touches = self._simulator.touches
        if len(touches) < self._seen:       # the simulation was reset
            self._seen, self._reported = 0, set()
        new = False
        for touch in touches[self._seen:]:
            pair = (touch.first, touch.second)
            if pair not in self._reported:
                new = True
                self._reported.add(pair)
                rospy.logwarn("%s touches %s at (%.2f, %.2f, %.2f), %.1f mm deep, at %.2f s", touch.first, touch.second,
                              *touch.position, 1000.0 * touch.depth, self._simulator.now_ns * 1e-9)
        self._seen = len(touches)
        return new
