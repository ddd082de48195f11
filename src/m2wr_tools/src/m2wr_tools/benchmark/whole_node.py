# SPDX-License-Identifier: BSD-3-Clause
"""Measures the whole simulation node: a master of its own, the node, and one subscribing process or none."""
from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from typing import IO, TYPE_CHECKING, Any, Callable, Dict, List, NamedTuple, Optional

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Pose, Twist
from rosmaster.master import Master

from gazebo_msgs.srv import GetModelState, GetWorldProperties, SpawnModel
from m2wr_sim.errors import SimError
from m2wr_sim.process_memory import memory_mb
from m2wr_tools.benchmark import reference

if TYPE_CHECKING:
    from m2wr_tools.benchmark.in_process import Case

_PATIENCE = 60.0            # s to wait for an action of the node
_NODE = "import sys; from m2wr_sim.ros.node import main; sys.exit(main())"
_TICKS = os.sysconf("SC_CLK_TCK")
_WARM_CALLS = 100           # before the first that is timed
_POLL = 0.25                # s between two looks at the simulated time
_SOAK_POLL = 0.05           # s; at full speed a minute is over in about one


class _Lines:
    """The lines that a process writes, read in a thread so that waiting for one has a time limit."""

    def __init__(self, stream: IO[str]) -> None:
        self._lines: queue.Queue[Optional[List[str]]] = queue.Queue()
        self._thread = threading.Thread(target=self._read, args=(stream,), daemon=True)
        self._thread.start()

    def _read(self, stream: IO[str]) -> None:
        for line in stream:
            self._lines.put(line.split(None, 1))
        self._lines.put(None)

    def wait_for(self, word: str, what: str) -> str:
        """Return the rest of the next line that begins with a word; others are skipped.

        Parameters
        ----------
        word : str
            First word of the line.
        what : str
            What is waited for, for the message.

        Raises
        ------
        SimError
            After a time limit, or if the process has ended.
        """
        deadline = time.monotonic() + _PATIENCE
        while True:
            try:
                found = self._lines.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                raise SimError("waited %g s for %s" % (_PATIENCE, what)) from None
            if found is None:
                raise SimError("the subscribing process ended before %s" % what)
            if found and found[0] == word:
                return found[1].strip() if len(found) > 1 else ""


class _Listener:
    """The process that subscribes to topics and counts their messages."""

    def __init__(self, topics: List[str]) -> None:
        self.process = subprocess.Popen([sys.executable, "-m", "m2wr_tools.benchmark.client"] + topics,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, universal_newlines=True)
        assert self.process.stdin is not None and self.process.stdout is not None       # PIPE
        self._input, self._lines = self.process.stdin, _Lines(self.process.stdout)

    def wait_until_subscribed(self) -> None:
        """Wait for the subscriptions; SimError if they take too long."""
        self._lines.wait_for("ready", "its subscriptions")

    def first_scan(self) -> float:
        """Wait for the first scan of any robot; return its monotonic time [s]."""
        while True:
            topic, when = self._lines.wait_for("first", "the first scan").split()
            if topic.endswith("/scan"):
                return float(when)

    def counts(self) -> Dict[str, List[int]]:
        """Return number and size [bytes] of the messages received so far, by topic."""
        self._input.write("\n")
        self._input.flush()
        found: Dict[str, List[int]] = json.loads(self._lines.wait_for("counts", "its counts"))
        return found


class _Sample(NamedTuple):
    """Simulated, processor and wall time [s], and the counts of the listener."""

    simulated: float
    processor: float
    wall: float
    counts: Dict[str, List[int]]


def _processor_seconds(pid: int) -> float:
    with open("/proc/%d/stat" % pid) as stream:
        fields = stream.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


class WholeNode:
    """A running node with robots in it; a context manager.

    Parameters
    ----------
    world : str
        Path of the world file.
    case : in_process.Case
        Robots, step, beams and engine; its world is not used.
    clients : int
        0: no subscriber; 1: one process listens to every topic of the robots, to /clock and to /tf.
    factor : float
        Requested real-time factor; 0: as fast as possible.
    port : int
        For the master.
    """

    def __init__(self, world: str, case: Case, clients: int, factor: float, port: int) -> None:
        self._case, self._clients, self._port = case, clients, port
        self._folder = tempfile.TemporaryDirectory(prefix="m2wr_sim_benchmark_")
        self._log_path = os.path.join(self._folder.name, "node.log")
        self._arguments = ["__name:=gazebo", "_world:=" + world, "_step:=%r" % case.step,
                           "_engine:=" + case.engine, "_real_time_factor:=%r" % factor]
        self._master: Optional[Master] = None
        self._node: Optional[subprocess.Popen[bytes]] = None
        self._listener: Optional[_Listener] = None
        self._publishers: List[rospy.Publisher] = []
        self.startup: Optional[float] = None    # from the start of the process to the first scan [s]

    def __enter__(self) -> WholeNode:
        try:
            self._start()
        except SimError as error:
            said = self._log()
            self.close()
            raise SimError("%s; last output of the node: %s" % (error, said)) from error
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> None:
        os.environ["ROS_MASTER_URI"] = "http://127.0.0.1:%d" % self._port
        os.environ["ROS_HOSTNAME"] = "127.0.0.1"
        os.environ.pop("ROS_IP", None)
        os.environ["ROS_LOG_DIR"] = self._folder.name
        self._master = Master(port=self._port)
        self._master.start()
        rospy.init_node("benchmark", disable_rostime=True, disable_signals=True, log_level=rospy.ERROR)
        if self._clients:
            topics = ["/clock", "/tf"] + ["/robot%d/%s" % (index, name) for index in range(self._case.robots)
                                          for name in ("scan", "odom", "joint_states")]
            self._listener = _Listener(topics)
            self._listener.wait_until_subscribed()
        with open(self._log_path, "w") as log:
            began = time.monotonic()
            self._node = subprocess.Popen([sys.executable, "-c", _NODE] + self._arguments, stdout=log, stderr=log)
        self._spawn()
        if self._listener is not None:
            self.startup = self._listener.first_scan() - began

    def _service(self, name: str, kind: Any) -> Any:
        deadline = time.monotonic() + _PATIENCE
        while True:
            try:
                rospy.wait_for_service(name, timeout=0.5)
                return rospy.ServiceProxy(name, kind, persistent=True)
            except rospy.ROSException:
                self._check()
                if time.monotonic() > deadline:
                    raise SimError("waited %g s for the service %s" % (_PATIENCE, name)) from None

    def _spawn(self) -> None:
        spawn = self._service("/gazebo/spawn_sdf_model", SpawnModel)
        text = reference.robot_sdf(self._case.beams)
        command = Twist()
        command.linear.x, command.angular.z = reference.LINEAR, reference.ANGULAR
        for index, place in enumerate(reference.robot_places(self._case.robots)):
            name, pose = "robot%d" % index, Pose()
            pose.position.x, pose.position.y, pose.position.z = place
            answer = spawn(name, text, name, pose, "")
            if not answer.success:
                raise SimError("%s was not spawned: %s" % (name, answer.status_message))
            publisher = rospy.Publisher("/%s/cmd_vel" % name, Twist, queue_size=1, latch=True)
            publisher.publish(command)
            self._publishers.append(publisher)
        self._world_properties = self._service("/gazebo/get_world_properties", GetWorldProperties)

    def _check(self) -> int:
        """Return the process id of the node; SimError if it does not run."""
        if self._node is None:
            raise SimError("the node has not been started")
        if self._node.poll() is not None:
            raise SimError("the node ended with code %d" % self._node.returncode)
        return self._node.pid

    def _log(self) -> str:
        """Return the last lines of the node."""
        if not os.path.exists(self._log_path):
            return "nothing"
        with open(self._log_path) as stream:
            return " | ".join(line.strip() for line in stream.readlines()[-5:]) or "nothing"

    def _sample(self) -> _Sample:
        """Return the present times and counts."""
        pid = self._check()
        return _Sample(self._world_properties().sim_time, _processor_seconds(pid), time.monotonic(),
                       {} if self._listener is None else self._listener.counts())

    def measure(self, duration: float, progress: Callable[[float], object] = lambda share: None) -> Dict[str, Any]:
        """Run for some simulated time and return figures as :func:`in_process.measure` does.

        Instead of its parts: ``startup_s`` from the start of the process to the first scan (with a subscriber),
        ``messages_per_s`` of simulated time, ``delivered``: messages received in this time, ``load``: processor time
        per wall time; ``memory_mb`` is the node's peak, ``growth_mb`` its growth.

        Parameters
        ----------
        duration : float
            Simulated time [s].
        progress : callable
            Called with the completed share, 0 to 1.

        Returns
        -------
        dict
            The figures by name.
        """
        pid, settled = self._check(), self._sample().simulated + 1.0
        while self._world_properties().sim_time < settled:
            self._check()
            time.sleep(_POLL)
        memory, start = memory_mb("VmRSS", pid), self._sample()
        while True:
            time.sleep(_POLL)
            self._check()
            done = (self._world_properties().sim_time - start.simulated) / duration
            progress(min(1.0, done))
            if done >= 1.0:
                break
        end = self._sample()
        seconds, processor, wall = (end.simulated - start.simulated, end.processor - start.processor,
                                    end.wall - start.wall)
        received = {topic: end.counts[topic][0] - start.counts[topic][0] for topic in end.counts}
        return {"factor": seconds / processor, "wall_factor": seconds / wall, "load": processor / wall,
                "startup_s": self.startup, "delivered": sum(received.values()), "received": received,
                "messages_per_s": sum(received.values()) / seconds,
                "growth_mb": memory_mb("VmRSS", pid) - memory,
                "memory_mb": memory_mb("VmHWM", pid), "messages": self._solver_messages()}

    def soak(self, minutes: int, progress: Callable[[float], object] = lambda share: None) -> Dict[str, Any]:
        """Run for some simulated minutes and record the node's memory after each.

        Parameters
        ----------
        minutes : int
            Simulated time [min].
        progress : callable
            Called with the completed share, 0 to 1.

        Returns
        -------
        dict
            ``memory_by_minute_mb``: resident memory at the start and after each minute; ``late_growth_mb``: how far it
            rose above what it was after the first minute, at most.
        """
        begun = self._world_properties().sim_time
        memory: List[float] = []
        while True:
            pid = self._check()
            passed = (self._world_properties().sim_time - begun) / 60.0
            while len(memory) <= min(passed, minutes):
                memory.append(memory_mb("VmRSS", pid))
            progress(min(1.0, passed / minutes))
            if len(memory) > minutes:
                return {"memory_by_minute_mb": memory, "late_growth_mb": max(memory[1:]) - memory[1],
                        "memory_mb": memory_mb("VmHWM", pid), "startup_s": self.startup}
            time.sleep(_SOAK_POLL)

    def call_times(self, count: int) -> Dict[str, Any]:
        """Call ``/gazebo/get_model_state`` one time after another over one connection, and return how long it takes.

        Parameters
        ----------
        count : int
            Number of calls.

        Returns
        -------
        dict
            Wall times [ms]: ``call_median_ms``, ``call_p99_ms``, ``call_longest_ms``; ``calls``: their number.
        """
        call, times = self._service("/gazebo/get_model_state", GetModelState), np.empty(count)
        for index in range(-_WARM_CALLS, count):
            begin = time.monotonic()
            answer = call("robot0", "")
            if index >= 0:
                times[index] = 1e3 * (time.monotonic() - begin)
            if not answer.success:
                raise SimError("/gazebo/get_model_state: %s" % answer.status_message)
        median, late, longest = np.percentile(times, (50.0, 99.0, 100.0)).tolist()
        return {"call_median_ms": median, "call_p99_ms": late, "call_longest_ms": longest, "calls": count}

    def _solver_messages(self) -> int:
        status = rospy.wait_for_message("/diagnostics", DiagnosticArray, timeout=_PATIENCE).status[0]
        return int({value.key: value.value for value in status.values}["solver messages"])

    def close(self) -> None:
        """End the node, the listener and the master."""
        for process in (None if self._listener is None else self._listener.process, self._node):
            if process is not None and process.poll() is None:
                process.terminate()
                try:
                    process.wait(10.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        if rospy.core.is_initialized():
            rospy.signal_shutdown("measured")
        if self._master is not None:
            self._master.stop()
        self._folder.cleanup()
