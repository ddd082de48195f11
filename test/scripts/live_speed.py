#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Measure what pages of the live view get, and what they cost; on an idle machine, about three minutes.

    live_speed.py [pages] [keys] [lockstep] [obstacles]     (none of them: all)

pages      ten robots at real-time factor 1: processor time of simulation and live view, updates a second that pages get
keys       from a page's message, and from a key in Chromium, to a wheel that moves
lockstep   processor time of the simulation for a whole run of Bug 2 at full speed, on a core of its own
obstacles  from the address to a picture of 1000 obstacles in a headless Chromium without a GPU
"""
import argparse
import contextlib
import json
import os
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import xmlrpc.client

# run as a file of a test package that is not installed: the modules of the tests are not on the path
sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "nodes"))
PARTS = ("pages", "keys", "lockstep", "obstacles")
WINDOW = 10.0               # s for which updates and processor time are counted
SETTLE = 6.0                # s before it, in which robots and pages start
KEYS = 40                   # times that a key is pressed
PHASE = 0.1                 # s between two updates of the drive, in which a key is pressed at any time
ROUNDS = 4                  # of the runs in lockstep
OBSTACLES, SIDE = 1000, 32  # how many, and along a side of their field
#: What is measured: words of roslaunch.
ROBOTS = ("robots.launch", "robots:=10", "controller:=wander", "world:=world01", "gui:=false")
BUG2 = ("bug2.launch", "gui:=false", "real_time_factor:=0", "exit_on_goal:=true")
BOX = """<model name="box%d"><static>1</static><pose>%.2f %.2f 0.3 0 0 0</pose><link name="link"><collision name="c">
<geometry><box><size>0.3 0.3 0.6</size></box></geometry></collision><visual name="v"><geometry><box>
<size>0.3 0.3 0.6</size></box></geometry><material><diffuse>0 0.8 0 1</diffuse></material></visual></link></model>"""


# ---- pages that do not draw ------------------------------------------------------------------------------------------

def receive(address, seconds, times):
    """Receive as a page for a time; note when the robots moved, and the bytes."""
    import msgspec
    import viser
    import zstandard
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    camera = {"type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 5], "fov": 1.0, "near": 0.1,
              "far": 100.0, "image_height": 700, "image_width": 900, "look_at": [0, 0, 0], "up_direction": [0, 0, 1]}
    with connect(address.replace("http", "ws"), subprotocols=["viser-v" + viser.__version__], max_size=None) as page:
        page.send(msgspec.msgpack.encode(camera))
        begin = time.monotonic() + 2.0
        while time.monotonic() < begin + seconds:
            try:
                data = page.recv()
            except ConnectionClosed:        # the run has ended
                return
            now = time.monotonic()
            size = int.from_bytes(data[8:16], "little")
            text = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16:16 + size]))
            moved = any(message["type"] == "SceneNodeUpdateMessage" and message["name"].startswith("/robots")
                        for message in text["messages"])
            if now >= begin:
                times.append((now, moved, len(data)))


def receive_all(address, count, seconds):
    """Print what ``count`` pages of this process got, as JSON."""
    notes = [[] for _ in range(count)]
    threads = [threading.Thread(target=receive, args=(address, seconds, note)) for note in notes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    rates, gaps, sizes = [], [], []
    for note in notes:
        moved = [when for when, has_moved, _ in note if has_moved]
        rates.append(len(moved) / seconds)
        gaps += [after - before for before, after in zip(moved, moved[1:])]
        sizes.append(sum(size for _, _, size in note) / seconds / 1e3)
    print(json.dumps({"rates": rates, "median gap": statistics.median(gaps), "kB/s": statistics.median(sizes),
                      "95 % of gaps": sorted(gaps)[int(0.95 * len(gaps))]}))


def pages_of(address, count):
    """Return a process with ``count`` pages."""
    return subprocess.Popen([sys.executable, os.path.abspath(__file__), "--receive", address, str(count)],
                            stdout=subprocess.PIPE, universal_newlines=True)


# ---- processes -------------------------------------------------------------------------------------------------------

def pid_of(node):
    """Return the process of a node as soon as it is there."""
    import rosgraph

    from sim_probe import wait_until

    def ask():
        try:
            return xmlrpc.client.ServerProxy(rosgraph.Master("/speed").lookupNode(node)).getPid("/speed")[2]
        except (rosgraph.MasterException, OSError):
            return None
    return wait_until(ask, "node " + node)


def processor_seconds(pid):
    """Return the processor time of a process [s], or None if it has ended."""
    try:
        with open("/proc/%d/stat" % pid, encoding="ascii") as stream:
            fields = stream.read().rsplit(")", 1)[1].split()
    except OSError:
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def launched(*words):
    """Start a launch file of m2wr_sim; returns the program, to be used as a context manager."""
    from sim_probe import Running
    return Running(["roslaunch", "m2wr_sim"] + list(words))


def live_beside():
    """Start the live view beside a simulation; returns the program."""
    from live_pages import live
    return live("__name:=live")


def load():
    """Return the load of the machine as text."""
    return "load %.1f" % os.getloadavg()[0]


# ---- parts -----------------------------------------------------------------------------------------------------------

def measure_pages():
    """Print a row for the simulation alone, with the live view, one page, ten pages, and alone again."""
    from live_pages import address_of
    from sim_probe import Simulation
    with launched(*ROBOTS):
        simulation, sim = Simulation(), pid_of("/gazebo")
        simulation.wait_for_model("robot10")

        def row(name, node=None, address=None, count=0):
            time.sleep(SETTLE)
            pages = pages_of(address, count) if count else None
            time.sleep(3.0 if count else 0.0)
            began, simulated, first = time.monotonic(), simulation.time(), processor_seconds(sim)
            other = processor_seconds(node) if node else None
            time.sleep(WINDOW - 2.0)
            spent, wall = processor_seconds(sim) - first, time.monotonic() - began
            text = "%-12s simulation %4.1f %% of a core, real-time factor %.3f" % (
                name, 100.0 * spent / wall, (simulation.time() - simulated) / wall)
            if node:
                text += ", live view %4.1f %%" % (100.0 * (processor_seconds(node) - other) / wall)
            if pages:
                found = json.loads(pages.communicate()[0])
                text += ", updates a second %.1f to %.1f, gaps median %.1f ms, 95 %% %.1f ms, %.0f kB/s a page" % (
                    min(found["rates"]), max(found["rates"]), 1e3 * found["median gap"], 1e3 * found["95 % of gaps"],
                    found["kB/s"])
            print(text + ", " + load(), flush=True)

        row("alone")
        with live_beside() as running:
            address, node = address_of(running), pid_of("/live")
            for count in (0, 1, 10):
                row("%d page%s" % (count, "" if count == 1 else "s"), node, address, count)
        row("alone")


def spins(message, wheels):
    """Return whether one of the links with these numbers rotates."""
    return any(abs(getattr(message.twist[wheel].angular, axis)) > 0.05 for wheel in wheels for axis in "xyz")


def measure_keys():
    """Print from a page's message to a wheel that moves and to odometry that says so, and from a key in Chromium."""
    import rospkg
    from nav_msgs.msg import Odometry
    from websockets.sync.client import connect

    from gazebo_msgs.msg import LinkStates
    from live_browser import Page
    from live_pages import address_of
    from sim_probe import Recorder, wait_until
    robot = os.path.join(rospkg.RosPack().get_path("m2wr_description"), "urdf", "m2wr.xacro")
    with launched("sim.launch", "world:=empty", "model:=" + robot, "gui:=false", "live:=true") as running:
        links, odometry = Recorder("/gazebo/link_states", LinkStates), Recorder("/odom", Odometry)
        names = links.wait(lambda messages: "wheel" in str(messages[-1].name) and messages[-1], "wheels").name
        wheels = [number for number, name in enumerate(names) if "wheel" in name]
        odometry.wait(lambda messages: messages[-1], "odometry")

        def row(name, press):
            wheel, odom, phases = [], [], random.Random(1)
            for _ in range(KEYS):
                wait_until(lambda: not spins(links.messages[-1], wheels)
                           and abs(odometry.messages[-1].twist.twist.linear.x) < 0.01, "a robot at rest")
                time.sleep(phases.uniform(0.0, PHASE))
                links.clear()
                odometry.clear()
                began = time.monotonic()
                press(True)
                links.wait(lambda messages: spins(messages[-1], wheels), "a wheel that moves")
                wheel.append(time.monotonic() - began)
                odometry.wait(lambda messages: messages[-1].twist.twist.linear.x > 0.01, "odometry that moves")
                odom.append(time.monotonic() - began)
                press(False)
                links.next()
                odometry.next()
            print("from %s to a moving wheel: median %.0f ms, longest %.0f; to odometry: %.0f, %.0f; of %d, %s" % (
                name, 1e3 * statistics.median(wheel), 1e3 * max(wheel), 1e3 * statistics.median(odom), 1e3 * max(odom),
                KEYS, load()), flush=True)

        address = address_of(running)
        with connect(address.replace("http", "ws") + "m2wr") as page:
            wait_until(lambda: json.loads(page.recv()).get("drive"), "a topic to drive on")
            row("a page's message", lambda pressed: page.send(json.dumps(
                {"topic": "/cmd_vel", "forward": int(pressed), "left": 0})))
        with Page(address) as browser:
            wait_until(browser.joystick, "the joystick")
            time.sleep(SETTLE)
            row("a key in Chromium", lambda pressed: browser.press("ArrowUp", pressed))


def run_alone_on(core, pid):
    """Let all threads of a process, and those that they start, run on one core."""
    for thread in os.listdir("/proc/%d/task" % pid):
        with contextlib.suppress(ProcessLookupError):       # it has ended meanwhile
            os.sched_setaffinity(int(thread), {core})


def run_of_bug2(pages, words=()):
    """Run Bug 2 in lockstep; return the processor time of the simulation [s], which has a core of its own."""
    from live_pages import address_of
    first, *others = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, others or {first})          # this program, and all that it starts
    try:
        with launched(*BUG2 + words) as run:
            sim, used, many = pid_of("/gazebo"), 0.0, None
            run_alone_on(first, sim)
            while run.process.poll() is None:
                used = processor_seconds(sim) or used
                if pages and many is None and "live view: http" in run.text:
                    many = pages_of(address_of(run), pages)
                time.sleep(0.02)
            if many is not None:
                end(many)
    finally:
        os.sched_setaffinity(0, {first, *others})
    return used


def end(process):
    """End a program that is not needed any more."""
    process.kill()
    process.wait()
    process.stdout.close()


def measure_lockstep():
    """Print the processor time of the simulation: alone, with a live view, with ten pages, in turns."""
    cases = {"alone": (0,), "with a live view": (0, ("live:=true",)), "with ten pages": (10, ("live:=true",))}
    found = {name: [] for name in cases}
    for _ in range(ROUNDS):
        for name, arguments in cases.items():
            found[name].append(run_of_bug2(*arguments))
    for name, times in found.items():
        shares = [mine / alone for mine, alone in zip(times, found["alone"])]
        print("lockstep %-16s %.2f s of processor time, %.2f to %.2f; of its pair alone %.3f, %.3f to %.3f, %s" % (
            name, statistics.median(times), min(times), max(times), statistics.median(shares), min(shares),
            max(shares), load()), flush=True)


def world_file(folder, count):
    """Write a world with a number of green boxes; return its path."""
    boxes = "".join(BOX % (number, 0.8 * (number % SIDE) - 0.4 * SIDE, 0.8 * (number // SIDE) - 0.4 * SIDE)
                    for number in range(count))
    path = os.path.join(folder, "%d.world" % count)
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("<sdf version=\"1.6\"><world name=\"default\">%s</world></sdf>" % boxes)
    return path


def measure_obstacles():
    """Print from the address given to Chromium to a picture in which all obstacles are; for one obstacle, too."""
    from live_browser import Page
    from live_pages import address_of, green
    from sim_probe import Simulation, wait_until
    with tempfile.TemporaryDirectory() as folder:
        for count in (1, OBSTACLES):
            with launched("sim.launch", "world:=" + world_file(folder, count), "gui:=false", "live:=true") as running:
                Simulation().wait_for_model("box%d" % (count - 1))
                with Page(address_of(running)) as page:
                    time.sleep(SETTLE)
                    last, times = green(page.scene()), []
                    for _ in range(ROUNDS):
                        page.driver.get("about:blank")
                        began = time.monotonic()
                        page.driver.get(page.address)
                        wait_until(lambda: green(page.scene()) > 0.95 * last, "a picture of all obstacles")
                        times.append(time.monotonic() - began)
            print("%4d obstacles shown after %s s (%d green pixels), %s" % (
                count, ", ".join("%.1f" % seconds for seconds in times), last, load()), flush=True)


def main():
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--receive", nargs=2, metavar=("ADDRESS", "PAGES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.receive:
        receive_all(options.receive[0], int(options.receive[1]), WINDOW)
        return 0
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error("%s; expected some of %s" % (", ".join(sorted(unknown)), ", ".join(PARTS)))
    parts = options.parts or PARTS
    if len(parts) > 1:          # a process each: rospy knows one master
        return max(subprocess.call([sys.executable, os.path.abspath(__file__), part]) for part in parts)
    import rosgraph
    import rospy

    from check_launch_errors import free_port
    from sim_probe import wait_until
    port = free_port()
    os.environ.update(ROS_MASTER_URI="http://127.0.0.1:%d" % port, ROS_HOSTNAME="127.0.0.1")
    os.environ.pop("ROS_IP", None)
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)
    try:
        wait_until(rosgraph.is_master_online, "the master")
        rospy.init_node("speed", disable_rostime=True, log_level=rospy.ERROR)
        globals()["measure_" + parts[0]]()
    finally:
        master.terminate()
        master.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())
