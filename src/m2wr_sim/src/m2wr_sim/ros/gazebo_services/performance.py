# SPDX-License-Identifier: BSD-3-Clause
"""``~performance_metrics``: rates of the simulation and its ray sensors, published while there is a subscriber."""
import time
from typing import Callable, Dict, Tuple

from gazebo_msgs.msg import PerformanceMetrics, SensorPerformanceMetric
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.runtime.simulator import Simulator

_PERIOD = 0.2           # s of wall time: 5 Hz, as in Gazebo
_NOT_A_CAMERA = -1.0


class Performance:
    """Publishes rates since the last message; :meth:`turn` is called often and usually does nothing."""

    def __init__(self, simulator: Simulator, clock: Callable[[], float] = time.monotonic) -> None:
        self._simulator, self._clock = simulator, clock
        self._port = simulator.ports.advertise("~performance_metrics", PerformanceMetrics, 10, "")
        self._last = self._snapshot()

    def _snapshot(self) -> Tuple[float, int, Dict[Tuple[str, str], int]]:
        counts: Dict[Tuple[str, str], int] = {}
        for model in self._simulator.models.values():
            for _, context, _ in model.plugins:
                if context.sensor is not None and context.sensor.ray is not None:
                    counts[model.name, context.sensor.name] = context.measurements
        return self._clock(), self._simulator.now_ns, counts

    def turn(self) -> None:
        """Publish if the period has passed and there is a subscriber."""
        if self._clock() - self._last[0] < _PERIOD:
            return
        before, self._last = self._last, self._snapshot()
        if not self._port.wanted():
            return
        wall, now_ns, counts = self._last
        elapsed, simulated = wall - before[0], (now_ns - before[1]) * 1e-9
        message = PerformanceMetrics(real_time_factor=max(0.0, simulated / elapsed))
        message.header.stamp = stamp_of(now_ns)
        for (model, sensor), count in counts.items():
            made = count - before[2].get((model, sensor), count)
            message.sensors.append(SensorPerformanceMetric(
                name=sensor, sim_update_rate=made / simulated if simulated > 0.0 else 0.0,
                real_update_rate=made / elapsed, fps=_NOT_A_CAMERA))
        self._port.publish(message)
