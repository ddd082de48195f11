# SPDX-License-Identifier: BSD-3-Clause
"""The simulation node as a whole: a master of its own, the node, and one listening process or none."""
import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Pose, Twist
from rosmaster.master import Master

from gazebo_msgs.srv import GetWorldProperties, SpawnModel
from m2wr_sim.errors import SimError
from m2wr_sim.process_memory import memory_mb
from m2wr_tools.benchmark import reference

_PATIENCE = 60.0            # s to wait for anything the node is to do
_NODE = "import sys; from m2wr_sim.ros.node import main; sys.exit(main())"
_TICKS = os.sysconf("SC_CLK_TCK")
_POLL = 0.25                # s between two looks at the simulated time
_SOAK_POLL = 0.05           # s; at full speed a minute is over in about one


class _Lines:
    """The lines a process writes, read in a thread so that waiting for one can have an end."""

    def __init__(self, stream):
        self._lines = queue.Queue()
        self._thread = threading.Thread(target=self._read, args=(stream,), daemon=True)
        self._thread.start()

    def _read(self, stream):
        for line in stream:
            self._lines.put(line.split(None, 1))
        self._lines.put(None)

    def wait_for(self, word, what):
        """Return the rest of the next line that begins with ``word``; others are passed over."""
        deadline = time.monotonic() + _PATIENCE
        while True:
            try:
                found = self._lines.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                raise SimError("waited %g s for %s" % (_PATIENCE, what)) from None
            if found is None:
                raise SimError("the listening process ended while %s was waited for" % what)
            if found and found[0] == word:
                return found[1].strip() if len(found) > 1 else ""


def _processor_seconds(pid):
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
        Real-time factor asked for; 0: as fast as it can.
    port : int
        For the master.
    """

    def __init__(self, world, case, clients, factor, port):
        self._case, self._clients, self._port = case, clients, port
        self._folder = tempfile.TemporaryDirectory(prefix="m2wr_sim_benchmark_")
        self._log_path = os.path.join(self._folder.name, "node.log")
        self._arguments = ["__name:=gazebo", "_world:=" + world, "_step:=%r" % case.step,
                           "_engine:=" + case.engine, "_real_time_factor:=%r" % factor]
        self._master = self._node = self._client = self._lines = None
        self._publishers, self.startup = [], None

    def __enter__(self):
        try:
            self._start()
        except SimError as error:
            said = self._log()
            self.close()
            raise SimError("%s; the node said last: %s" % (error, said)) from error
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_):
        self.close()

    def _start(self):
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
            self._client = subprocess.Popen([sys.executable, "-m", "m2wr_tools.benchmark.client"] + topics,
                                            stdin=subprocess.PIPE, stdout=subprocess.PIPE, universal_newlines=True)
            self._lines = _Lines(self._client.stdout)
            self._lines.wait_for("ready", "its subscriptions")
        with open(self._log_path, "w") as log:
            began = time.monotonic()
            self._node = subprocess.Popen([sys.executable, "-c", _NODE] + self._arguments, stdout=log, stderr=log)
        self._spawn()
        if self._clients:
            topic, when = "", ""
            while not topic.endswith("/scan"):
                topic, when = self._lines.wait_for("first", "the first scan").split()
            self.startup = float(when) - began

    def _service(self, name, kind):
        deadline = time.monotonic() + _PATIENCE
        while True:
            try:
                rospy.wait_for_service(name, timeout=0.5)
                return rospy.ServiceProxy(name, kind, persistent=True)
            except rospy.ROSException:
                self._check()
                if time.monotonic() > deadline:
                    raise SimError("waited %g s for the service %s" % (_PATIENCE, name)) from None

    def _spawn(self):
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

    def _check(self):
        if self._node.poll() is not None:
            raise SimError("the node ended with code %d" % self._node.returncode)

    def _log(self):
        """Return the last lines of the node."""
        if not os.path.exists(self._log_path):
            return "nothing"
        with open(self._log_path) as stream:
            return " | ".join(line.strip() for line in stream.readlines()[-5:]) or "nothing"

    def _counts(self):
        if self._client is None:
            return {}
        self._client.stdin.write("\n")
        self._client.stdin.flush()
        return json.loads(self._lines.wait_for("counts", "its counts"))

    def _sample(self):
        """Return simulated, processor and wall seconds, and what has been received, now."""
        self._check()
        return (self._world_properties().sim_time, _processor_seconds(self._node.pid), time.monotonic(), self._counts())

    def measure(self, duration, progress=lambda share: None):
        """Let ``duration`` simulated seconds pass and return figures as :func:`in_process.measure` does.

        In place of its parts: ``startup_s`` from the start of the process to the first scan (with a listener),
        ``messages_per_s`` of simulated time, ``delivered``: messages received in the span, ``load``: processor time
        per wall time; ``memory_mb`` is the node's peak, ``growth_mb`` what it grew by in the span.
        """
        settled = self._sample()[0] + 1.0
        while self._world_properties().sim_time < settled:
            self._check()
            time.sleep(_POLL)
        memory, start = memory_mb("VmRSS", self._node.pid), self._sample()
        while True:
            time.sleep(_POLL)
            self._check()
            done = (self._world_properties().sim_time - start[0]) / duration
            progress(min(1.0, done))
            if done >= 1.0:
                break
        end = self._sample()
        seconds, processor, wall = (end[index] - start[index] for index in range(3))
        received = {topic: end[3][topic][0] - start[3][topic][0] for topic in end[3]}
        return {"factor": seconds / processor, "wall_factor": seconds / wall, "load": processor / wall,
                "startup_s": self.startup, "delivered": sum(received.values()), "received": received,
                "messages_per_s": sum(received.values()) / seconds,
                "growth_mb": memory_mb("VmRSS", self._node.pid) - memory,
                "memory_mb": memory_mb("VmHWM", self._node.pid), "messages": self._solver_messages()}

    def soak(self, minutes, progress=lambda share: None):
        """Let so many simulated minutes pass and look at the node's memory after each.

        Returns
        -------
        dict
            ``memory_by_minute_mb``: resident memory at the start and after each minute; ``late_growth_mb``: how far it
            rose above what it was after the first minute, at most.
        """
        begun, memory = self._world_properties().sim_time, []
        while True:
            self._check()
            passed = (self._world_properties().sim_time - begun) / 60.0
            while len(memory) <= min(passed, minutes):
                memory.append(memory_mb("VmRSS", self._node.pid))
            progress(min(1.0, passed / minutes))
            if len(memory) > minutes:
                return {"memory_by_minute_mb": memory, "late_growth_mb": max(memory[1:]) - memory[1],
                        "memory_mb": memory_mb("VmHWM", self._node.pid), "startup_s": self.startup}
            time.sleep(_SOAK_POLL)

    def _solver_messages(self):
        status = rospy.wait_for_message("/diagnostics", DiagnosticArray, timeout=_PATIENCE).status[0]
        return int({value.key: value.value for value in status.values}["solver messages"])

    def close(self):
        """End the node, the listener and the master."""
        for process in (self._client, self._node):
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
