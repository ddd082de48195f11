# SPDX-License-Identifier: BSD-3-Clause
"""The table of faults: launch file, fault, expected messages, and files that must remain."""
import glob
import os
import re
import signal
import time
from dataclasses import dataclass, field

from fault_run import PATIENCE, Later, wait_until

DRIVING = "state changed: Go to point"
BUG2 = ["m2wr_sim", "bug2.launch", "gui:=false", "record:=run.bag"]
MAPPING = ["m2wr_sim", "mapping.launch", "gui:=false", "particles:=5", "record:=run.bag", "map:=plan"]
HOUR = 3600             # [s]
_TIME = re.compile(r"^\[INFO\] \[(\d+\.\d+)", re.MULTILINE)
IN_TURNS = ["real_time_factor:=2"]


@dataclass(frozen=True)
class Case:
    """One fault.

    Attributes
    ----------
    name : str
    launch : list of str
        Words of roslaunch.
    fault : callable
        Injects the fault into a FaultRun that has printed ``ready``; None: ``environment`` or ``prefix`` is the fault.
    said : tuple of str
        Texts that must be printed by the end; none of ``fault_run.NEVER`` may be.
    left : tuple of str
        Results that must exist at the end: bag, map.
    ready : str
    ends : bool
        The run ends by itself; otherwise it continues and is interrupted.
    repeats : str
        Text that the run must print again after the fault, before it is interrupted.
    killed : tuple of str
        Nodes that could not unregister from the master.
    stray : tuple of str
        Temporary files that may remain.
    long : bool
        Left out of ``make test``.
    needs : list of str
        A command that succeeds where the fault can be injected.
    """

    name: str
    launch: list
    fault: object = None
    said: tuple = ()
    left: tuple = ("bag",)
    ready: str = DRIVING
    ends: bool = False
    repeats: str = ""
    killed: tuple = ()
    stray: tuple = ()
    long: bool = True
    environment: dict = field(default_factory=dict)
    prefix: tuple = ()
    needs: tuple = ()


def kill(part):
    """Return a fault: SIGKILL to the process with ``part`` in its command line."""
    return lambda run: run.signal(part, signal.SIGKILL)


def stop(part, seconds, until=""):
    """Return a fault: SIGSTOP for some seconds, or until a text is printed, then SIGCONT."""
    def fault(run):
        process = run.process(part)
        os.kill(process, signal.SIGSTOP)
        try:
            if until:
                run.wait_for(until)
            else:
                time.sleep(seconds)     # no event to wait for
        finally:
            os.kill(process, signal.SIGCONT)
    return fault


def kill_the_mapper(run):
    """Kill the mapper as soon as it has saved a state."""
    kept = os.path.join(run.home, ".ros", "log", "*", "slam_gmapping-*.state")
    wait_until(lambda: glob.glob(kept), "a state saved as %s" % kept)
    run.signal("m2wr_gmapping/slam_gmapping", signal.SIGKILL)


def kill_the_recorder(run):
    """Kill rosbag's recorder as soon as it has written a megabyte."""
    wait_until(lambda: os.path.exists(run.file("run.bag.active"))
               and os.path.getsize(run.file("run.bag.active")) > 1 << 20, "a megabyte of bag")
    run.signal("rosbag/record", signal.SIGKILL)


def jump_the_clock(run):
    """Let the wall clock of the nodes jump an hour ahead, then two back; each time the run must continue."""
    def stamps():
        return [float(word) for word in _TIME.findall(run.text)]

    for seconds in (HOUR, -HOUR):
        expected = stamps()[0] + seconds
        with open(os.path.join(run.top, "clock"), "w", encoding="ascii") as stream:
            stream.write("%d" % seconds)
        wait_until(lambda: abs(stamps()[-1] - expected) < 0.5 * HOUR, Later(
            lambda: "a jump of the clock in\n%s" % run.text), PATIENCE)
        run.wait_for_more("map against world", run.run)


def second_simulation(run):
    """Start another simulation on the same master; it must end by itself."""
    run.begin(["m2wr_sim", "sim.launch"]).wait(240.0)


def shell(text):
    """Return a prefix: a shell that does ``text`` as root of its own mounts, then roslaunch."""
    return ("unshare", "--mount", "--map-root-user", "sh", "-c", text + ' && exec "$@"', "sh")


MOUNTS = ("unshare", "--mount", "--map-root-user", "mount", "-t", "tmpfs", "none", "/mnt")
CASES = (
    Case("the simulation is killed", MAPPING, kill("/m2wr_sim_node"), ("exit code -9", "gazebo"), ("bag", "map"),
         ready="map against world", ends=True, killed=("/gazebo",), long=False),
    Case("the mapper is killed", MAPPING + ["state_save_period:=1"], kill_the_mapper,
         ("slam_gmapping", "exit code -9", "this node was killed"), ("bag", "map"),
         ready="map against world", repeats="map against world", long=False),
    Case("the mapper that time waits for is killed", MAPPING + IN_TURNS + ["state_save_period:=1"], kill_the_mapper,
         ("this node was killed",), ("bag", "map"), ready="map against world",
         repeats="map against world"),
    Case("the recorder is killed", BUG2, kill_the_recorder, ("record", "signal 9", "without a recording"),
         repeats="distance to line"),
    Case("the recorder's parent is killed", BUG2, kill("/record_run"), ("exit code -9",), repeats="distance to line"),
    Case("the controller is killed", BUG2, kill("/bug2.py"), ("bug2", "exit code -9"), ends=True, killed=("/bug2",)),
    Case("a controller that time waits for is killed", BUG2 + IN_TURNS, kill("/wall_follower.py"),
         ("wall_follower", "exit code -9"), killed=("/wall_follower",), ends=True),
    # nodes keep running without their roslaunch; ended one by one, they lose nothing
    Case("roslaunch is killed", BUG2, lambda run: run.kill_roslaunch(), (), ends=True),
    Case("the master is killed", BUG2, lambda run: run.kill_master(), (), repeats="distance to line"),
    Case("the simulation is stopped for a while", BUG2, stop("/m2wr_sim_node", 6.0), (), repeats="distance to line"),
    Case("the controller is stopped for a while", BUG2, stop("/bug2.py", 6.0), (), repeats="distance to line"),
    Case("a controller that time waits for is stopped", BUG2 + IN_TURNS, stop("/bug2.py", 6.0), (),
         repeats="distance to line"),
    Case("the mapper that time waits for is stopped", MAPPING + IN_TURNS, stop("m2wr_gmapping/slam_gmapping", 6.0),
         (), ("bag", "map"), ready="map against world", repeats="distance to line"),
    Case("the disk is full", MAPPING, None, ("record:", "disk full", "cannot write the map"), (),
         ready="without a recording", repeats="distance to line", stray=("run.bag.active",),
         prefix=shell("mount -t tmpfs -o size=16k none {folder} && cd {folder}"), needs=MOUNTS, long=False),
    Case("the folder cannot be written to", MAPPING, None, ("record:", "save_on_exit"), (),
         repeats="distance to line",
         prefix=shell("mount --bind {folder} {folder} && mount -o remount,ro,bind {folder} && cd {folder}"),
         needs=MOUNTS),
    Case("the home cannot be written to", BUG2, None, ("No such file or directory",), (), ready="", ends=True,
         prefix=shell("mount --bind {home} {home} && mount -o remount,ro,bind {home}"), needs=MOUNTS),
    Case("there is no HOME", MAPPING, None, (), ("bag", "map"), ready="map against world",
         environment={"HOME": None, "ROS_LOG_DIR": "/tmp"}),
    Case("64 descriptors", MAPPING, None, (), ("bag", "map"), ready="map against world",
         prefix=("prlimit", "--nofile=64:64")),
    Case("two simulations on one master", BUG2, second_simulation, ("gazebo",), repeats="distance to line"),
    Case("the wall clock jumps", MAPPING, jump_the_clock, (), ("bag", "map"), ready="map against world",
         environment={"M2WR_FAULT_JUMP": "1"}),
    Case("simulated time jumps back", MAPPING, lambda run: run.call("/gazebo/reset_simulation"), ("jumped back",),
         ("bag", "map"), ready="map against world", repeats="map against world"),
)

# launch files with arguments for a machine without a display, for interrupts at any time
LAUNCH_FILES = {
    "m2wr_sim/bug2.launch": ["gui:=false", "record:=run.bag"],
    "m2wr_sim/mapping.launch": ["gui:=false", "particles:=5", "record:=run.bag", "map:=plan"],
    "m2wr_sim/best_path.launch": ["gui:=false", "record:=run.bag", "memory:=memory"],
    "m2wr_sim/explore.launch": ["gui:=false", "record:=run.bag", "map:=plan"],
    "m2wr_sim/sim.launch": ["gui:=false", "record:=run.bag"],
    "m2wr_sim/rough.launch": ["gui:=false", "record:=run.bag"],
    "m2wr_sim/deliver.launch": ["gui:=false", "record:=run.bag", "robots:=1"],
    "m2wr_delivery/carriers.launch": None,      # needs the node delivery; deliver.launch includes it
    "m2wr_sim/robots.launch": ["gui:=false", "record:=run.bag"],
    "yocs_cmd_vel_mux/cmd_vel_mux.launch": [],
    "yocs_velocity_smoother/velocity_smoother.launch": [],
    "m2wr_sim/record.launch": [],
    "m2wr_sim/click_obstacles.launch": [],
    "m2wr_sim/live.launch": [],
    "m2wr_sim/robot_range.launch": [],
    "m2wr_sim/rviz.launch": None,               # needs a display; bug2.launch includes it
    "m2wr_view/rviz.launch": None,
    "m2wr_view/image_dump.launch": [],
    "m2wr_view/live.launch": [],
    "m2wr_description/spawn.launch": [],
    "m2wr_description/rviz.launch": None,
    "m2wr_description/rvis.launch": None,
    "m2wr_gmapping/gmapping.launch": ["gui:=false"],
    "m2wr_navigation/method.launch": ["method:=tangent_bug", "goal_x:=0", "goal_y:=-4"],
    "m2wr_navigation/move_base.launch": [],
    "m2wr_exploration/explore.launch": [],
    "m2wr_exploration/explore_team.launch": ["gui:=false", "map:=plan"],
    "m2wr_exploration/explorer_range.launch": [],
    "multirobot_map_merge/map_merge.launch": [],
    "m2wr_elevation/elevation.launch": [],
    "motion_plan/behaviors.launch": ["des_x:=0", "des_y:=-4"],
    "motion_plan/bug2.launch": [],
    "gazebo_ros/empty_world.launch": ["gui:=false"],
}
