# SPDX-License-Identifier: BSD-3-Clause
"""The state of the simulation on ``/diagnostics``; nothing is built without a subscriber."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING, Dict, List, Optional, Set, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from m2wr_sim.process_memory import memory_mb
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.ports import RosSimulator

if TYPE_CHECKING:
    from m2wr_lockstep.server.ros.lockstep import Lockstep

_PERIOD = 1.0           # s of wall time
_SHARE = 0.9            # of a rate; lower rates are reported
_MOST_LOGGED = 20       # new contacts that are logged one by one at a time
_ENOUGH = 20            # messages expected before a rate is judged


def _memory() -> List[Tuple[str, str]]:
    """Return ``[(name, MB), ...]`` of this process's memory now and at its peak, as far as the system reports them."""
    figures = ("memory [MB]", memory_mb("VmRSS")), ("peak memory [MB]", memory_mb("VmHWM"))
    return [(name, "%.0f" % size) for name, size in figures if size]


class Diagnostics:
    """Publishes two statuses per second of wall time; :meth:`turn` is called often and usually does nothing.

    Parameters
    ----------
    simulator : RosSimulator
    factor : float
        Requested real-time factor; 0: as fast as possible.
    lockstep : Lockstep, optional
    """

    def __init__(self, simulator: RosSimulator, factor: float, lockstep: Optional[Lockstep] = None) -> None:
        self._simulator, self._factor, self._lockstep = simulator, factor, lockstep
        self._publisher = simulator.ports.advertise("/diagnostics", DiagnosticArray, 10, "")
        self._last = (time.monotonic(), simulator.now_ns, simulator.steps)
        self._run_seconds, self._run_sim_ns = 0.0, 0
        self._reported: Set[Tuple[str, str]]
        self._messages, self._seen, self._reported = simulator.engine.solver_messages, 0, set()
        self._lost, self._waited = 0, 0.0
        self._traffic: Optional[Tuple[int, Dict[str, Tuple[int, int]]]] = None

    def set_factor(self, factor: float) -> None:
        """Compare with another real-time factor from now on."""
        self._factor = factor

    def turn(self) -> None:
        """Publish if a second has passed, and at once when a pair is in contact for the first time."""
        wall = time.monotonic()
        elapsed = wall - self._last[0]
        if not self._report_contacts() and elapsed < _PERIOD:
            return
        simulator = self._simulator
        advanced_ns, steps = simulator.now_ns - self._last[1], simulator.steps - self._last[2]
        self._last = (wall, simulator.now_ns, simulator.steps)
        if not simulator.paused and advanced_ns >= 0:
            self._run_seconds += elapsed
            self._run_sim_ns += advanced_ns
        if not self._publisher.wanted():
            self._traffic = None            # rates are computed between two messages
            return
        elapsed = max(elapsed, 1e-6)
        array = DiagnosticArray(status=[self._simulation(elapsed, max(0, advanced_ns), max(0, steps)), self._topics()])
        array.header.stamp = stamp_of(simulator.now_ns)
        self._publisher.publish(array)

    # ---- the simulation ------------------------------------------------------------------------------------------

    def _simulation(self, elapsed: float, advanced_ns: int, steps: int) -> DiagnosticStatus:
        simulator, factor = self._simulator, advanced_ns * 1e-9 / elapsed
        messages = simulator.engine.solver_messages
        new_messages, self._messages = messages - self._messages, messages
        dropped = simulator.ports.dropped()
        lost = sum(entry.messages for entry in dropped)
        new_lost, self._lost = lost - self._lost, lost
        off = simulator.switched_off()
        mean = self._run_sim_ns * 1e-9 / self._run_seconds if self._run_seconds else 0.0
        values = [("simulated time [s]", "%.3f" % (simulator.now_ns * 1e-9)), ("real-time factor", "%.2f" % factor),
                  ("mean real-time factor", "%.2f" % mean),
                  ("wanted real-time factor", "%g" % self._factor if self._factor else "as fast as possible"),
                  ("step [ms]", "%g" % (simulator.step_ns * 1e-6)), ("steps", str(simulator.steps)),
                  ("steps per second", "%.0f" % (steps / elapsed)), ("solver messages", str(messages)),
                  ("models", str(len(simulator.models))), ("plugins switched off", ", ".join(off) or "none")]
        values += _memory() + self._lockstep_values(elapsed)
        values += [("touches of " + name, str(count)) for name, count in sorted(simulator.contact_counts.items())]
        values += [("dropped on %s for %s" % (entry.topic, entry.peer or "those that have left"), str(entry.messages))
                   for entry in dropped]
        level, message = self._judge(factor, new_messages, new_lost, off)
        return DiagnosticStatus(name="m2wr_sim: simulation", hardware_id="simulation", level=level, message=message,
                                values=[KeyValue(key, value) for key, value in values])

    def _lockstep_values(self, elapsed: float) -> List[Tuple[str, str]]:
        if self._lockstep is None:
            return []
        is_open, ticks, waited, lost, missing = self._lockstep.status()
        new, self._waited = waited - self._waited, waited
        return [("lockstep", "running" if is_open else "waiting"), ("lockstep ticks", str(ticks)),
                ("share of time spent waiting for other nodes", "%.0f %%" % (100.0 * min(1.0, new / elapsed))),
                ("lockstep without", ", ".join(lost) or "none"),
                ("lockstep waits for", "; ".join(missing) or "none")]

    def _judge(self, factor: float, new_messages: int, new_lost: int, off: List[str]) -> Tuple[int, str]:
        if off:
            return DiagnosticStatus.ERROR, "switched off after a fault: %s" % ", ".join(off)
        if self._simulator.paused:
            return DiagnosticStatus.OK, "paused"
        if new_messages > 10:
            return DiagnosticStatus.WARN, "the solver wrote %d messages in the last second" % new_messages
        if new_lost > 0:
            return DiagnosticStatus.WARN, "subscribers read too slowly: %d messages dropped" % new_lost
        if self._lockstep is not None:
            is_open, _, _, _, missing = self._lockstep.status()
            if not is_open:
                return DiagnosticStatus.WARN, "lockstep: simulation waits for %s" % (
                    "; ".join(missing) or "all nodes to be connected")
        if self._factor and factor < _SHARE * self._factor:
            return DiagnosticStatus.WARN, "slower than wanted: %.2f instead of %g" % (factor, self._factor)
        return DiagnosticStatus.OK, "running at %.2f times real time" % factor

    # ---- its topics ----------------------------------------------------------------------------------------------

    def _topics(self) -> DiagnosticStatus:
        """Return the status of the topics: requested and measured rate in simulated time."""
        before, now_ns, traffic = self._traffic, self._simulator.now_ns, self._simulator.ports.traffic()
        self._traffic = (now_ns, traffic)
        seconds = (now_ns - before[0]) * 1e-9 if before else 0.0
        asked, values, slow = self._asked(), [], []
        for topic, (count, listeners) in sorted(traffic.items()):
            sent = count - before[1].get(topic, (count,))[0] if before else 0
            rate = sent / seconds if seconds > 0.0 else None
            wanted = asked.get(topic)
            words = ["not sent" if not listeners else "no rate yet" if rate is None else "%.1f Hz" % rate]
            if wanted:
                words.append("%.4g Hz asked" % wanted)
            values.append((topic, ", ".join(words + ["%d subscribers" % listeners])))
            if wanted and rate is not None and listeners and before and before[1].get(topic, (0, 0))[1]:
                # some plugins count a period from the step at which they ran, up to one step late
                least = _SHARE / (1.0 / wanted + self._simulator.step_ns * 1e-9)
                if wanted * seconds >= _ENOUGH and rate < least:
                    slow.append("%s %.1f instead of %.4g Hz" % (topic, rate, wanted))
        return DiagnosticStatus(
            name="m2wr_sim: topics", hardware_id="simulation",
            level=DiagnosticStatus.WARN if slow else DiagnosticStatus.OK,
            message="below their rates of simulated time: " + ", ".join(slow) if slow else "%d topics" % len(traffic),
            values=[KeyValue(key, value) for key, value in values])

    def _asked(self) -> Dict[str, float]:
        """Return {topic: requested rate [Hz of simulated time]}, without topics that publish every step."""
        rates: Dict[str, float] = {}
        for model in self._simulator.models.values():
            for plugin, context, _ in model.plugins:
                period_ns = plugin.period_ns()
                if period_ns:
                    rate = 1e9 / max(period_ns, self._simulator.step_ns)    # plugins run only at the end of a step
                    rates.update((topic, rate) for topic in context.topics())
        return rates

    # ---- contacts ------------------------------------------------------------------------------------------------

    def _report_contacts(self) -> bool:
        """Log the first contact of each pair; return whether there was one."""
        contacts = self._simulator.contacts
        if len(contacts) < self._seen:       # the simulation was reset
            self._seen, self._reported = 0, set()
        new = 0
        for contact in contacts[self._seen:]:
            pair = (contact.first, contact.second)
            if pair not in self._reported:
                new += 1
                self._reported.add(pair)
                if new > _MOST_LOGGED:
                    continue
                rospy.logwarn("contact of %s and %s at (%.2f, %.2f, %.2f), %.1f mm deep, at %.2f s", *pair,
                              *contact.position, 1000.0 * contact.depth, self._simulator.now_ns * 1e-9)
        if new > _MOST_LOGGED:
            rospy.logwarn("and %d more pairs are in contact for the first time", new - _MOST_LOGGED)
        self._seen = len(contacts)
        return new > 0
