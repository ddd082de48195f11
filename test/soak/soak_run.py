# SPDX-License-Identifier: BSD-3-Clause
"""The command ``soak``: simulated hours of mapping, spawning, resetting and service calls; growth of the processes."""
import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import xmlrpc.client
from collections import OrderedDict

import rosgraph
import rospy

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.abspath(os.path.join(HERE, "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "nodes"))
import slopes  # noqa: E402
from watch import Clock, Sample, Stamps, look_at  # noqa: E402
from wire import Listener  # noqa: E402
from work import Task, Work, call  # noqa: E402

DAY = 24.0                                                  # h, for which the counts below are
COUNTS = dict(cycles=5000, resets=2000, shifts=96, ask=10000, push=1000, move=500, pause=500, map=200, reconnect=1000)
MOST_MEMORY, MOST_OTHER = 0.2, 0.05                         # MB, and descriptors or threads, an hour
PATIENCE = 120.0                                            # s of wall time without a clock
SAMPLES = 1200                                              # over the run
LISTENED = (("/clock", "/gazebo"), ("/scan", "/gazebo"), ("/odom", "/gazebo"), ("/tf", "/gazebo"),
            ("/joint_states", "/gazebo"), ("/gazebo/model_states", "/gazebo"), ("/gazebo/link_states", "/gazebo"),
            ("/tf", "/slam_gmapping"), ("/map", "/slam_gmapping"), ("/cmd_vel", "/wander"))
WATCHED = OrderedDict((("simulator", "/gazebo"), ("mapper", "/slam_gmapping")))
# topic: the longest step of its stamps [s], their offset; a reset of the world restarts the period of a drive
STAMPED = {"/clock": (0.1, 0), "/scan": (0.4, 4), "/odom": (0.41, 4)}


class SoakError(Exception):
    """The run cannot continue; names what is missing or has ended."""


def free_port():
    """Return a free port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, what, seconds=PATIENCE):
    """Return the first true value of ``condition()``; SoakError after ``seconds``."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            value = condition()
        except (OSError, rosgraph.MasterException, rospy.ServiceException, rospy.ROSException):
            value = None
        if value:
            return value
        time.sleep(0.1)
    raise SoakError("waited %g s for %s" % (seconds, what))


class Nodes:
    """The nodes of soak.launch on a master of their own; a context manager."""

    def __init__(self, port, factor, folder):
        self.uri = "http://127.0.0.1:%d" % port
        os.environ.update(ROS_MASTER_URI=self.uri, ROS_HOSTNAME="127.0.0.1", ROS_LOG_DIR=folder, ROS_HOME=folder)
        os.environ.pop("ROS_IP", None)
        self.log = os.path.join(folder, "soak.log")
        self._command = ["roslaunch", "-p", str(port), os.path.join(HERE, "soak.launch"),
                         "real_time_factor:=%g" % factor]
        self._process = None

    def __enter__(self):
        with open(self.log, "w") as log:
            self._process = subprocess.Popen(self._command, stdout=log, stderr=log, start_new_session=True)
        return self

    def __exit__(self, *_):
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(30.0)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def alive(self):
        """Return whether roslaunch, and with it its required nodes, still runs."""
        return self._process.poll() is None

    def pid(self, name):
        """Return the process id of a node."""
        uri = rosgraph.Master("/soak").lookupNode(name)
        return xmlrpc.client.ServerProxy(uri).getPid("/soak")[2]


class Run:
    """One soak run.

    Parameters
    ----------
    hours : float
        Simulated.
    nodes : Nodes
    """

    def __init__(self, hours, nodes):
        self._seconds, self._nodes = 3600.0 * hours, nodes
        share = hours / DAY
        self._count = {name: max(2, int(round(number * share))) for name, number in COUNTS.items()}
        self.shift_seconds = self._seconds / self._count["shifts"]
        self.clock, self._stopping = Clock(), threading.Event()
        self.stamps = {topic: Stamps(period) if not offset else Stamps(period, offset)
                       for topic, (period, offset) in STAMPED.items()}
        self.samples = OrderedDict((name, []) for name in WATCHED)
        self._listeners, self.tasks, self._began = [], [], None
        self.wall = 0.0

    def _listen(self):
        for number, (topic, publisher) in enumerate(LISTENED):
            takes = [self.clock.take] if topic == "/clock" else []
            if topic in self.stamps:
                takes.append(self.stamps[topic].take)
            listener = Listener(self._nodes.uri, topic, publisher,
                                lambda data, takes=takes: [take(data) for take in takes], "/soak_client%d" % number)
            listener.start()
            self._listeners.append(listener)

    def _reconnect(self, turn):
        others = [listener for listener in self._listeners if listener.name not in self.stamps]
        others[turn % len(others)].hang_up()

    def _start_tasks(self):
        with open(os.path.join(HERE, "robot.urdf"), encoding="utf-8") as stream:
            work = Work(stream.read())
        count = self._count
        acts = (("spawn and delete", work.spawn_and_delete, count["cycles"]),
                ("reset_world", work.reset_world, count["resets"] - count["shifts"]), ("ask", work.ask, count["ask"]),
                ("push", work.push, count["push"]), ("move", work.move, count["move"]),
                ("pause", work.pause, count["pause"]), ("map", work.get_map, count["map"]),
                ("reconnect", self._reconnect, count["reconnect"]))
        self.tasks = [Task(name, act, number, self._seconds, self.clock, self._stopping) for name, act, number in acts]
        for task in self.tasks:
            task.start()

    def go(self, tell, on_progress):
        """Run; progress is reported by ``tell(text)`` and ``on_progress()``.

        Raises
        ------
        SoakError
            If a node ends or the clock stops.
        """
        wait_for(lambda: rosgraph.Master("/soak").lookupService("/gazebo/get_world_properties"), "the simulation")
        wait_for(lambda: "wanderer" in call("get_world_properties").model_names, "the robot to be spawned")
        pids = {name: wait_for(lambda node=node: self._nodes.pid(node), node) for name, node in WATCHED.items()}
        wait_for(lambda: rosgraph.Master("/soak").lookupNode("/wander"), "/wander")
        wait_for(Work.has_map, "the first map")
        self._began = time.monotonic()
        self._listen()
        wait_for(lambda: self.clock.total > 2.0, "the clock")
        self._start_tasks()
        try:
            self._watch(pids, tell, on_progress)
        finally:
            self._stopping.set()
            for listener in self._listeners:
                listener.close()
            for task in self.tasks:
                task.join(10.0)
            self.wall = time.monotonic() - self._began

    def _watch(self, pids, tell, on_progress):
        interval, due, told = self._seconds / SAMPLES, 0.0, 0
        moved, at = time.monotonic(), -1.0
        while self.clock.total < self._seconds or any(task.is_alive() for task in self.tasks):
            time.sleep(0.02)
            if not self._nodes.alive():
                raise SoakError("a node has ended; see %s" % self._nodes.log)
            clock = self.clock
            if clock.total != at:
                moved, at = time.monotonic(), clock.total
            elif time.monotonic() - moved > PATIENCE:
                raise SoakError("the clock stopped at %.3f s for %g s" % (clock.now, PATIENCE))
            if clock.total >= due:
                due = clock.total + interval
                for name, pid in pids.items():
                    try:
                        seen = look_at(pid)
                    except ProcessLookupError:
                        raise SoakError("the %s has ended; see %s" % (name, self._nodes.log)) from None
                    self.samples[name].append(Sample(clock.total / 3600.0, clock.shift, clock.now, *seen))
            if clock.now >= self.shift_seconds and clock.total < self._seconds - 1.0:
                shift = clock.shift
                call("reset_simulation")
                wait_for(lambda: self.clock.shift > shift, "the clock to go back")
            share = int(20.0 * clock.total / self._seconds)
            if share > told:
                told = share
                self.wall = time.monotonic() - self._began
                tell("%3d %%: %.2f simulated hours in %.0f s, %s" % (
                    5 * share, clock.total / 3600.0, self.wall, ", ".join(
                        "%s %.1f MB" % (name, seen[-1].memory) for name, seen in self.samples.items())))
                on_progress()

    def failures(self, bounds):
        """Return the violated limits as sentences, and texts for the figure by (process, quantity)."""
        found, told = [], {}
        for task in self.tasks:
            if task.done < task.count or task.failed:
                found.append("%s: %d of %d, %d failed: %s" % (
                    task.name, task.done, task.count, task.failed, "; ".join(task.failures)))
        for topic, stamps in self.stamps.items():
            if not stamps.count or stamps.repeats or stamps.beginnings > self.clock.shift:
                found.append("%s: %d messages, %d stamps twice, %d went back with %d resets of time" % (
                    topic, stamps.count, stamps.repeats, stamps.beginnings, self.clock.shift))
            if stamps.gaps:
                found.append("%s: %d gaps, the longest %.3f s" % (topic, stamps.gaps, stamps.widest))
        found += [listener.fault for listener in self._listeners if listener.fault]
        for process, samples in self.samples.items():
            for name, most in (("memory", MOST_MEMORY), ("descriptors", MOST_OTHER), ("threads", MOST_OTHER)):
                try:
                    slope, low, high = slopes.slope(*slopes.levels(samples, name, self.shift_seconds))
                except ValueError as error:
                    if bounds:
                        found.append("%s, %s: %s" % (process, name, error))
                    continue
                told[process, name] = "%+.3f an hour (%+.3f to %+.3f)" % (slope, low, high)
                if bounds and slope > most:
                    found.append("%s: %s grows by %.3f an hour; expected at most %g" % (process, name, slope, most))
        return found, told

    def write(self, folder, told):
        """Write the figure and the numbers; returns the path of the figure."""
        from figure import draw
        os.makedirs(folder, exist_ok=True)
        done = {task.name: task.done for task in self.tasks}
        title = "%.1f simulated hours in %.0f min: %d spawned and deleted, %d resets, %d clients" % (
            self.clock.total / 3600.0, self.wall / 60.0, done["spawn and delete"],
            done["reset_world"] + self.clock.shift, len(LISTENED))
        path = os.path.join(folder, "soak.png")
        draw(path, title, self.samples, self.shift_seconds, told)
        with open(os.path.join(folder, "soak.json"), "w") as stream:
            json.dump({"title": title, "done": done, "shifts": self.clock.shift, "slopes": {
                "%s %s" % key: value for key, value in told.items()},
                "stamps": {topic: vars(stamps) for topic, stamps in self.stamps.items()},
                "samples": self.samples}, stream)
        return path


def main(argv=None):
    """Entry point; returns 0 if all limits were kept."""
    parser = argparse.ArgumentParser(prog="soak", description="Run simulation and mapper for a long time; what grows?",
                                     formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0, metavar="H", help="simulated; all counts are proportional")
    parser.add_argument("--factor", type=float, default=0.0, metavar="F", help="real-time factor; 0: full speed")
    parser.add_argument("--out", default=os.path.join(ROOT, "demo_output"), metavar="DIR", help="for the figure")
    parser.add_argument("--no-bounds", action="store_true", help="slopes are printed but not checked, for short runs")
    arguments = parser.parse_args(argv)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)           # the nodes are ended as well

    def tell(text):
        print(text)
        sys.stdout.flush()

    with tempfile.TemporaryDirectory(prefix="m2wr_soak_") as folder:
        with Nodes(free_port(), arguments.factor, folder) as nodes:
            run = Run(arguments.hours, nodes)
            try:
                wait_for(lambda: rosgraph.Master("/soak").getPid(), "the master")
                rospy.init_node("soak", disable_rostime=True, disable_signals=True, log_level=rospy.ERROR)
                run.go(tell, lambda: run.write(arguments.out, run.failures(False)[1]))
            except KeyboardInterrupt:
                tell("soak: interrupted; results until now:")
            except SoakError as error:
                with open(nodes.log) as stream:
                    tell(stream.read()[-3000:])
                tell("soak: %s" % error)
                return 1
        found, told = run.failures(not arguments.no_bounds)
        tell("figure: %s" % os.path.relpath(run.write(arguments.out, told)))
    for (process, name), text in told.items():
        tell("%s, %s: %s" % (process, name, text))
    for topic, stamps in run.stamps.items():
        tell("%s: %d stamps, the longest step %.3f s, %d resets of time" % (
            topic, stamps.count, stamps.widest, stamps.beginnings))
    for sentence in found:
        tell("FAILED: " + sentence)
    return 1 if found else 0
