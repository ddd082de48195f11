# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the checks: waiting with a deadline, recording topics, calling the simulation, running programs."""
import glob
import math
import os
import signal
import subprocess
import sys
import threading
import time
import uuid

import roslib.packages
import rospy
import rostest
from geometry_msgs.msg import Pose
from std_srvs.srv import Empty

from gazebo_msgs import srv

MARK = "M2WR_TEST_RUN"  # in the environment of every program a check starts, and of all that such a program starts
PATIENCE = 60.0         # s of wall time; far above what is needed, because machines that test are slow
SERVICES = {
    "get_model_state": srv.GetModelState, "set_model_state": srv.SetModelState,
    "set_model_configuration": srv.SetModelConfiguration, "get_model_properties": srv.GetModelProperties,
    "get_world_properties": srv.GetWorldProperties, "spawn_urdf_model": srv.SpawnModel,
    "spawn_sdf_model": srv.SpawnModel, "delete_model": srv.DeleteModel, "pause_physics": Empty,
    "unpause_physics": Empty, "reset_world": Empty, "reset_simulation": Empty,
    "get_link_state": srv.GetLinkState, "set_link_state": srv.SetLinkState,
    "get_link_properties": srv.GetLinkProperties, "set_link_properties": srv.SetLinkProperties,
    "get_joint_properties": srv.GetJointProperties, "set_joint_properties": srv.SetJointProperties,
    "get_physics_properties": srv.GetPhysicsProperties, "set_physics_properties": srv.SetPhysicsProperties,
    "get_light_properties": srv.GetLightProperties, "set_light_properties": srv.SetLightProperties,
    "delete_light": srv.DeleteLight, "apply_body_wrench": srv.ApplyBodyWrench,
    "apply_joint_effort": srv.ApplyJointEffort, "clear_body_wrenches": srv.BodyRequest,
    "clear_joint_forces": srv.JointRequest,
}


def run_checks(name, cases):
    """Run a TestCase as the test ``name`` of a .test file.

    When a required node dies, roslaunch ends this program as well, and rostest would count the empty result file as
    success.  So the file is removed in this case, which rostest reports as a failure.
    """
    done = threading.Event()
    cases.addClassCleanup(done.set)

    def leave():
        if done.is_set():
            return
        sys.stderr.write("%s: ended by another process before all checks were done\n" % name)
        for argument in sys.argv:
            if argument.startswith("--gtest_output=xml:"):
                os.remove(argument.split(":", 1)[1])
        os._exit(1)     # the cases still wait for events that cannot occur any more

    rospy.on_shutdown(leave)
    rostest.rosrun("m2wr_test", name, cases)


def wait_until(condition, what, patience=PATIENCE):
    """Return the first true value of ``condition()``; AssertionError naming ``what`` after ``patience`` seconds."""
    deadline = time.monotonic() + patience
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError("waited %g s for %s" % (patience, what))
        time.sleep(0.01)


class Recorder:
    """Keeps every message of a topic."""

    def __init__(self, topic, kind):
        self.topic, self.messages = topic, []
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, kind, self._store, tcp_nodelay=True)

    def _store(self, message):
        with self._changed:
            self.messages.append(message)
            self._changed.notify_all()

    def connected(self, count=1):
        """Wait for a number of publishers; returns itself."""
        wait_until(lambda: self._subscriber.get_num_connections() >= count, "%d publishers of %s" % (count, self.topic))
        return self

    def wait(self, condition, what, patience=PATIENCE):
        """Wait until ``condition(messages)`` is true and return its value; not called while there is no message."""
        deadline = time.monotonic() + patience
        with self._changed:
            while True:
                value = self.messages and condition(self.messages)
                if value:
                    return value
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise AssertionError("waited %g s for %s on %s; %d messages came"
                                         % (patience, what, self.topic, len(self.messages)))
                self._changed.wait(left)

    def next(self, count=1):
        """Discard stored messages, wait for ``count`` further ones and return them."""
        self.clear()
        return self.wait(lambda messages: len(messages) >= count and list(messages), "%d more messages" % count)

    def clear(self):
        """Discard stored messages."""
        with self._changed:
            del self.messages[:]

    def close(self):
        """Unsubscribe."""
        self._subscriber.unregister()


class Simulation:
    """The services of the running simulation by name, and frequent uses of them."""

    def call(self, name, *arguments, **fields):
        """Call ``/gazebo/NAME``; waits for the service first."""
        rospy.wait_for_service("/gazebo/" + name, timeout=PATIENCE)
        return rospy.ServiceProxy("/gazebo/" + name, SERVICES[name])(*arguments, **fields)

    def models(self):
        """Names of all models, in load order."""
        return list(self.call("get_world_properties").model_names)

    def time(self):
        """Simulated time [s]."""
        return self.call("get_world_properties").sim_time

    def wait_for_time(self, moment):
        """Wait until simulated time has reached ``moment`` [s]."""
        return wait_until(lambda: self.time() >= moment, "simulated time %.3f s" % moment)

    def run_for(self, seconds):
        """Let ``seconds`` of simulated time pass."""
        self.wait_for_time(self.time() + seconds)

    def wait_for_model(self, name):
        """Wait until a model is in the world."""
        wait_until(lambda: name in self.models(), "model %s" % name)

    def spawn(self, name, xml, pose=(0.0, 0.0, 0.1, 0.0), namespace="/", frame="", kind="urdf"):
        """Spawn a model at ``(x, y, z, yaw)``; returns the response."""
        return self.call("spawn_%s_model" % kind, name, xml, namespace, make_pose(*pose), frame)

    def delete_all(self):
        """Delete every model but the ground."""
        for name in self.models():
            if name != "ground_plane":
                self.call("delete_model", name)


def make_pose(x=0.0, y=0.0, z=0.0, yaw=0.0):
    """Return a geometry_msgs/Pose."""
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = x, y, z
    pose.orientation.z, pose.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return pose


def yaw_of(orientation):
    """Return the heading [rad] of a quaternion message."""
    q = orientation
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def xyz(vector):
    """Return a Point or Vector3 as a tuple."""
    return (vector.x, vector.y, vector.z)


def seconds_of(messages):
    """Return the stamps of messages [s], rounded to the nanosecond."""
    return [round(message.header.stamp.to_nsec() * 1e-9, 9) for message in messages]


def data_path(*parts):
    """Return the path of a file in this package's data folder."""
    return os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "data", *parts)


def data_text(*parts):
    """Return the text of a file in this package's data folder."""
    with open(data_path(*parts), encoding="utf-8") as stream:
        return stream.read()


def program(package, name):
    """Return the path of an executable of a package."""
    return roslib.packages.find_node(package, name)[0]


def marked_environment(more=None):
    """Return an environment with a new mark, and the mark; Python programs in it do not buffer their output."""
    mark = uuid.uuid4().hex
    return dict(os.environ, **dict({"PYTHONUNBUFFERED": "1"}, **dict(more or {}, **{MARK: mark}))), mark


def marked(mark):
    """Return ``{process id: command line}`` of all living processes that have inherited ``mark``."""
    found = {}
    for folder in glob.glob("/proc/[0-9]*"):
        try:
            with open(folder + "/environ", "rb") as stream:
                inherited = ("%s=%s" % (MARK, mark)).encode() in stream.read().split(b"\0")
            with open(folder + "/cmdline", "rb") as stream:
                command = stream.read().replace(b"\0", b" ").decode(errors="replace")
        except OSError:         # ended meanwhile
            continue
        if inherited and command:       # a zombie has no command line
            found[int(os.path.basename(folder))] = command
    return found


def end_marked(mark):
    """Kill what is left of a run."""
    for pid in marked(mark):
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:      # ended meanwhile
            continue


def run_program(arguments, text=None, environment=None, patience=PATIENCE):
    """Run a program to its end; returns the completed process with ``stdout`` and ``stderr`` as text."""
    environment, mark = marked_environment(environment)
    try:
        return subprocess.run(arguments, input=text, stdin=None if text is not None else subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=patience,
                              env=environment)
    except subprocess.TimeoutExpired as error:
        raise AssertionError("%s did not end within %g s; its output:\n%s\n%s"
                             % (" ".join(arguments), patience, error.stdout, error.stderr)) from error
    finally:
        end_marked(mark)


class Running:
    """A program that runs beside the check; its output is kept.

    Use it as a context manager: the program and all processes it has started are always ended.
    """

    def __init__(self, arguments, environment=None):
        self.arguments, self.text = arguments, ""
        environment, self.mark = marked_environment(environment)
        self._changed = threading.Condition()
        self.process = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, universal_newlines=True, start_new_session=True,
                                        env=environment)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self._changed:
                self.text += line

    def wait_for_text(self, words):
        """Wait until the program has printed ``words``."""
        wait_until(lambda: words in self.text or self.process.poll() is not None,
                   '"%s" from %s' % (words, self.arguments))
        if words not in self.text:      # the last lines may not have been read yet
            self._reader.join(PATIENCE)
        if words not in self.text:
            raise AssertionError('%s ended without printing "%s"; its output:\n%s' % (self.arguments, words, self.text))

    def end(self, number, patience=PATIENCE):
        """Send a signal and wait for the end; returns ``(exit code, seconds it took)``."""
        started = time.monotonic()
        self.process.send_signal(number)
        return self.wait(patience), time.monotonic() - started

    def wait(self, patience=PATIENCE):
        """Wait for the end; returns the exit code."""
        try:
            self.process.wait(patience)
        except subprocess.TimeoutExpired:
            raise AssertionError("%s did not end within %g s; its output:\n%s" % (
                self.arguments, patience, self.text)) from None
        self._reader.join(PATIENCE)
        return self.process.returncode

    def __enter__(self):
        return self

    def __exit__(self, *_):
        end_marked(self.mark)
        self.process.wait()
        self._reader.join(PATIENCE)
        self.process.stdout.close()
