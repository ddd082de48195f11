# SPDX-License-Identifier: BSD-3-Clause
"""The doctor: each check on a machine or a graph that is well, and on one with the fault it is for."""
import json
import re

import pytest

from m2wr_tools.doctor import clients, command, environment, frames, graph, installation
from m2wr_tools.doctor.finding import Finding, some, worst
from m2wr_tools.doctor.machine import Machine

LIST = """
# a list as the shipped one
python-is-python3  -          program python
python3-tf         tf         module tf        # a comment
tf-tools           tf         node static_transform_publisher
libnav-msgs-dev    nav_msgs   cmake
libtopic-tools-dev topic_tools  package
"""


class FakeMachine:
    """A machine on which all is well; tests change what they are about."""

    def __init__(self, **changes):
        self.environ = {"HOME": "/home/me", "ROS_HOSTNAME": "localhost", "DISPLAY": ":0",
                        "ROS_MASTER_URI": "http://localhost:11311", "CMAKE_PREFIX_PATH": "/ws/devel"}
        self.folder = "/home/me"
        self.python, self.version = "/usr/bin/python3", (3, 11, 2)
        self.missing, self.absent, self.locked, self.broken = set(), set(), set(), set()
        self.programs = {name: "/usr/bin/" + name for name in (
            "python", "python3", "roscore", "roslaunch", "rosrun", "Xvfb", "ffmpeg", "glxinfo")}
        self.runs = {"glxinfo": (0, "OpenGL renderer string: llvmpipe (LLVM 15)\n")}
        self.hosts = {"localhost": ["127.0.0.1"], "other": ["10.0.0.9"]}
        self.free, self.open_ports, self.answers = 50 << 30, set(), {"/tmp/.X11-unix/X0"}
        self.files = {"/ws/devel/lib/m2wr_sim/demo": b"#!/usr/bin/python3\n"}
        self.kernels = ["/ws/x.nbi"]
        self.texts = {"/ws/src/m2wr_sim/" + clients.LIST: LIST}
        self.open_everywhere = set()
        self.absent.add("/opt/ros/noetic/setup.bash")
        for name, value in changes.items():
            getattr(self, name)         # no typing errors
            setattr(self, name, value)

    def which(self, program):
        return self.programs.get(program)

    def has_module(self, name):
        return name not in self.missing

    def run(self, arguments, patience=0.0):
        return self.runs.get(arguments[0].split("/")[-1], (0, ""))

    def exists(self, path):
        return path not in self.absent

    def executable(self, path):
        return path not in self.broken

    def first_line(self, path):
        return self.files[path]

    def lines(self, path):
        if path not in self.texts:
            raise FileNotFoundError(path)
        return self.texts[path].splitlines(True)

    def open_to_all(self):
        return self.open_everywhere

    def below(self, folder):
        return self.kernels

    def writable(self, folder):
        return folder not in self.locked

    def free_bytes(self, folder):
        return self.free

    def host_name(self):
        return "laptop"

    def addresses(self, host):
        return self.hosts.get(host, [])

    def is_local(self, address):
        return address.startswith("127.")

    def accepts(self, host, port, patience=0.0):
        return (host, port) in self.open_ports

    def accepts_unix(self, path):
        return path in self.answers


class FakePackages:
    """Packages at their places."""

    def __init__(self, machine, missing=(), twice=(), roots=("/ws/src",), sourced=None):
        self._sourced = sourced
        self._machine, self._missing, self._twice, self._roots, self.fault = machine, missing, twice, roots, ""

    def roots(self):
        return list(self._roots)

    def find(self, name):
        return None if name in self._missing else "/ws/src/" + name

    def sourced(self, name):
        return self._sourced if name == "m2wr_description" and self._sourced else None

    def copies(self, name):
        return ["/ws/src/" + name] + ["/old/src/" + name] * (name in self._twice)

    def executables(self, name):
        return sorted(path for path in self._machine.files if "/lib/%s/" % name in path)


def faults(found):
    return [entry for entry in found if entry.level != "ok"]


def one_fault(found, level, *words):
    entry, = faults(found)
    assert entry.level == level and entry.cure, entry
    for word in words:
        assert word in entry.what + " -> " + entry.cure
    return entry


def install(machine, **packages):
    return installation.check(machine, FakePackages(machine, **packages))


# -- installation ---------------------------------------------------------------------------------------------------

def test_a_sound_installation_has_no_faults():
    found = install(FakeMachine())
    assert found and not faults(found)


@pytest.mark.parametrize("changes, packages, level, words", [
    ({"version": (3, 6, 9)}, {}, "problem", ("3.6.9", "3.8")),
    ({"missing": {"rospy"}}, {}, "problem", ("rospy", "apt install python3-rospy")),
    ({"missing": {"xacro"}}, {}, "problem", ("xacro", "setup.bash", "make setup")),
    ({"missing": {"trimesh"}}, {}, "warning", ("trimesh", "meshes")),
    ({"missing": {"numba"}}, {}, "warning", ("numba", "slower", "python3-numba")),
    ({"kernels": []}, {}, "warning", ("no compiled kernels", "warm_up")),
    ({}, {"missing": ("m2wr_sim",)}, "problem", ("not sourced", "setup.bash")),
    ({}, {"missing": ("motion_plan",)}, "problem", ("motion_plan", "make build")),
    ({}, {"missing": ("rviz",)}, "warning", ("rviz", "make setup")),
    ({}, {"twice": ("m2wr_sim",)}, "warning", ("2 times", "/old/src/m2wr_sim is shadowed")),
    ({"absent": {"/gone"}}, {"roots": ("/ws/src", "/gone")}, "warning", ("/gone", "new shell")),
    ({"files": {}}, {}, "problem", ("not built", "make build")),
    ({}, {"sourced": "/other/m2wr_description"}, "problem",
     ("/ws/src/m2wr_description", "/other/m2wr_description", "multiple files named", "another name")),
    ({"programs": {name: name for name in ("roscore", "roslaunch", "rosrun", "python3")}}, {}, "warning",
     ("#!/usr/bin/env python\"", "127", "sudo apt install python-is-python3")),
    ({"missing": {"tf"}}, {}, "warning", ("Python module tf", "sudo apt install python3-tf")),
    ({}, {"missing": ("topic_tools",)}, "warning", ("package topic_tools", "libtopic-tools-dev")),
    ({"absent": {prefix + "/%s/tf/static_transform_publisher" % place for place in ("lib", "share")
                 for prefix in ("/ws/devel", "/usr", "/opt/ros/noetic")} | {"/opt/ros/noetic/setup.bash"}}, {},
     "warning", ("tf/static_transform_publisher", "sudo apt install tf-tools")),
    ({"missing": {"tf"}, "absent": set()}, {}, "warning", ("Python module tf", "sudo apt install ros-noetic-tf")),
    ({"texts": {}}, {}, "warning", ("cannot be read", "again")),
    ({"texts": {"/ws/src/m2wr_sim/" + clients.LIST: "python3-tf tf modul tf\n"}}, {}, "warning",
     ("line 1", "modul tf")),
    ({"broken": {"/ws/devel/lib/m2wr_sim/demo"}}, {}, "problem", ("not executable", "chmod +x")),
    ({"files": {"/ws/devel/lib/m2wr_sim/demo": b"#!/usr/bin/python3\r\n"}}, {}, "problem", ("Windows", "sed -i")),
])
def test_faults_of_an_installation(changes, packages, level, words):
    one_fault(install(FakeMachine(**changes), **packages), level, *words)


def test_all_that_is_missing_is_told_together_with_one_command():
    found = install(FakeMachine(missing={"tf"}), missing=("topic_tools",))
    one_fault(found, "warning", "Python module tf, package topic_tools", "install libtopic-tools-dev python3-tf")


def test_headers_are_searched_in_both_distributions():
    asked = []

    class Asked(FakeMachine):
        def exists(self, path):
            asked.append(path)
            return not path.endswith("nav_msgsConfig.cmake")

    one_fault(install(Asked()), "warning", "C++ of nav_msgs")
    assert "/opt/ros/noetic/share/nav_msgs/cmake/nav_msgsConfig.cmake" in asked
    assert any(path.startswith("/usr/lib/") and path.endswith("cmake/nav_msgs/nav_msgsConfig.cmake") for path in asked)


def test_the_shipped_list_can_be_read_and_names_each_thing_once():
    import os
    with open(os.path.join(os.path.dirname(__file__), "..", "..", "..", "m2wr_sim", clients.LIST)) as stream:
        entries = clients.parse(stream)
    assert len(entries) > 40 and len(set(entry[1:] for entry in entries)) == len(entries)


def test_a_package_found_twice_is_reported(tmp_path):
    for place in ("mine/thing", "ws/thing"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text("<package><name>thing</name></package>")
    (tmp_path / "devel").mkdir()
    (tmp_path / "devel/.catkin").write_text("%s;%s" % (tmp_path / "ws/other", tmp_path / "ws/thing"))
    machine = Machine()
    machine.environ.update(ROS_PACKAGE_PATH="%s:%s" % (tmp_path / "mine", tmp_path / "ws"),
                           CMAKE_PREFIX_PATH="/gone:%s" % (tmp_path / "devel"))
    packages = installation.PackageList(machine)
    assert packages.find("thing") == str(tmp_path / "mine/thing")
    assert packages.sourced("thing") == str(tmp_path / "ws/thing")
    assert packages.sourced("unknown") is None


def test_a_foreign_python_first_on_the_path():
    machine = FakeMachine(programs=dict(FakeMachine().programs, python3="/opt/conda/bin/python3"))
    assert not faults(install(machine))                     # it can import rospy
    machine.runs["python3"] = (1, "No module named rospy")
    one_fault(install(machine), "warning", "/opt/conda/bin/python3", "PATH=/usr/bin")


@pytest.mark.parametrize("entry, strange", [
    ("/opt/ros/kinetic/lib/python2.7/dist-packages", True), ("/opt/conda/lib/python3.9/site-packages", True),
    ("/opt/anaconda/lib", True), ("/ws/devel/lib/python3/dist-packages", False),
    ("/ws/.venv/lib/python3.11/site-packages", False), ("/home/me/python_things", False)])
def test_modules_of_another_python(entry, strange):
    machine = FakeMachine()
    machine.environ["PYTHONPATH"] = entry
    found = faults(install(machine))
    assert bool(found) == strange and all(entry in fault.what for fault in found)


def test_files_that_tools_leave_are_no_executables():
    files = {"/ws/devel/lib/m2wr_sim/cmake.lock": b"", "/ws/devel/lib/m2wr_sim/demo": b"#!/usr/bin/python3\n"}
    assert not faults(install(FakeMachine(files=files, broken={"/ws/devel/lib/m2wr_sim/cmake.lock"})))


def test_packages_are_found_where_they_are(tmp_path):
    for place in ("one/thing", "two/deep/thing", "two/left_out/thing"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text("<package><name>thing</name></package>")
    (tmp_path / "two/left_out/CATKIN_IGNORE").write_text("")
    machine = Machine()
    machine.environ["ROS_PACKAGE_PATH"] = "%s:%s" % (tmp_path / "one", tmp_path / "two")
    packages = installation.PackageList(machine)
    assert packages.find("thing") == str(tmp_path / "one/thing")
    assert packages.copies("thing") == [str(tmp_path / "one/thing"), str(tmp_path / "two/deep/thing")]


# -- environment and display ----------------------------------------------------------------------------------------

def environment_findings(machine=None, **variables):
    machine = machine or FakeMachine()
    machine.environ.update(variables)
    return environment.check_environment(machine)


def test_a_sound_environment_has_no_faults():
    assert not faults(environment_findings())
    assert not faults(environment.check_display(FakeMachine()))


@pytest.mark.parametrize("variables, level, words", [
    ({"ROS_MASTER_URI": "localhost:11311"}, "problem", ("http://HOST:PORT",)),
    ({"ROS_MASTER_URI": "http://localhost:many"}, "problem", ("http://HOST:PORT",)),
    ({"ROS_MASTER_URI": "http://nowhere:11311"}, "problem", ("nowhere", "/etc/hosts")),
    ({"ROS_HOSTNAME": "nowhere"}, "problem", ("no address", "ROS_HOSTNAME=localhost")),
    ({"ROS_HOSTNAME": ""}, "problem", ("calls itself laptop", "no address")),
    ({"ROS_HOSTNAME": "other"}, "problem", ("10.0.0.9 is no address of this machine", "unset ROS_IP")),
    ({"ROS_IP": "127.0.0.1"}, "warning", ("both set", "unset ROS_IP"))])
def test_faults_of_an_environment(variables, level, words):
    one_fault(environment_findings(**variables), level, *words)


def test_a_folder_that_cannot_be_written():
    one_fault(environment_findings(FakeMachine(locked={"/home/me/.ros/log"})), "problem", ".ros/log", "ROS_LOG_DIR")
    one_fault(environment_findings(FakeMachine(locked={"/home/me"})), "warning", "bags and pictures", "record:=")


@pytest.mark.parametrize("free, level", [(50 << 20, "problem"), (1 << 30, "warning")])
def test_a_full_disk(free, level):
    found = faults(environment_findings(FakeMachine(free=free)))
    assert {entry.level for entry in found} == {level} and all("MB are free" in entry.what for entry in found)


def test_no_display_is_no_fault():
    machine = FakeMachine()
    machine.environ["DISPLAY"] = ""
    found = environment.check_display(machine)
    assert not faults(found) and "no DISPLAY" in found[0].what


@pytest.mark.parametrize("display, words", [(":1", ("nothing answers at DISPLAY :1", "ssh -X")),
                                            ("screen", ("like :0",)), ("other:10.0", ("nothing answers",))])
def test_a_display_that_is_not_there(display, words):
    machine = FakeMachine()
    machine.environ["DISPLAY"] = display
    one_fault(environment.check_display(machine), "warning", *words)


def test_a_display_over_the_network():
    machine = FakeMachine(open_ports={("other", 6010)})
    machine.environ["DISPLAY"] = "other:10.0"
    assert not faults(environment.check_display(machine))


def test_graphics_that_do_not_work():
    machine = FakeMachine(runs={"glxinfo": (1, "Error: couldn't find RGB GLX visual")})
    one_fault(environment.check_display(machine), "warning", "OpenGL", "LIBGL_ALWAYS_SOFTWARE=1")


@pytest.mark.parametrize("program", ["Xvfb", "ffmpeg"])
def test_programs_for_pictures(program):
    machine = FakeMachine()
    del machine.programs[program]
    one_fault(environment.check_display(machine), "warning", program, "apt install " + program.lower())


# -- master and topics ----------------------------------------------------------------------------------------------

def make_graph(**changes):
    running = graph.Graph(
        publishers={"/clock": ["/gazebo"], "/cmd_vel": ["/go_to_point", "/wall_follower"], "/scan": ["/gazebo"]},
        subscribers={"/cmd_vel": ["/gazebo"], "/tf": ["/rviz"]}, services={},
        types={"/clock": "rosgraph_msgs/Clock", "/cmd_vel": "geometry_msgs/Twist", "/scan": "sensor_msgs/LaserScan"},
        nodes={"/gazebo": "http://localhost:1", "/go_to_point": "http://localhost:2"}, silent=[], sim_time=True)
    return running._replace(**changes)


def test_a_sound_graph_has_no_faults():
    assert not faults(graph.check_master(FakeMachine(), make_graph()) + graph.check_topics(make_graph()))


def test_loopback_nodes_with_a_remote_master_are_reported():
    one_fault(environment_findings(ROS_MASTER_URI="http://other:11311"), "problem", "the master is on other",
              "ROS_HOSTNAME is localhost", "export ROS_IP=")


def test_nodes_open_to_the_network_are_reported():
    def examine(**variables):
        machine = FakeMachine()
        del machine.environ["ROS_HOSTNAME"]
        machine.environ.update(variables)
        machine.hosts["laptop"] = ["127.0.1.1"]
        return environment.check_environment(machine)

    one_fault(examine(), "warning", "neither ROS_IP nor ROS_HOSTNAME", "ROS_IP=127.0.0.1")
    assert not faults(examine(ROS_MASTER_URI="http://other:11311"))


def test_ports_of_cpp_nodes_that_others_can_reach_are_told():
    running = graph.Graph({}, {}, {}, {}, {"/rosout": "http://localhost:4001/", "/gazebo": "http://localhost:4002/"},
                          [], None)
    texts = [entry.what for entry in graph.check_master(FakeMachine(open_everywhere={4001}), running)]
    assert any(text.startswith("/rosout: XML-RPC port open to other machines") for text in texts), texts
    texts = [entry.what for entry in graph.check_master(FakeMachine(), running)]
    assert "all nodes listen at the loopback address only" in texts


def test_only_sockets_bound_to_every_address_count_as_open():
    import socket
    with socket.socket() as everywhere, socket.socket() as here:
        everywhere.bind(("0.0.0.0", 0))
        here.bind(("127.0.0.1", 0))
        everywhere.listen(1)
        here.listen(1)
        found = Machine().open_to_all()
        assert everywhere.getsockname()[1] in found and here.getsockname()[1] not in found


def test_no_master_is_no_fault_here_and_one_elsewhere():
    assert not faults(graph.check_master(FakeMachine(), None))
    machine = FakeMachine()
    machine.environ["ROS_MASTER_URI"] = "http://other:11311"
    one_fault(graph.check_master(machine, None), "warning", "other:11311", "unset ROS_MASTER_URI")
    one_fault(graph.check_master(FakeMachine(open_ports={("localhost", 11311)}), None), "problem", "no ROS master")


@pytest.mark.parametrize("changes, level, words", [
    ({"publishers": {}}, "problem", ("nothing publishes /clock", "use_sim_time false")),
    ({"publishers": {"/clock": ["/gazebo", "/play"]}}, "problem", ("2 nodes publish /clock", "rosnode kill")),
    ({"sim_time": None}, "warning", ("not set", "use_sim_time true")),
    ({"sim_time": False}, "warning", ("is false",)),
    ({"silent": ["/go_to_point"]}, "warning", ("/go_to_point is registered", "rosnode cleanup")),
    ({"silent": ["/far"], "nodes": {"/far": "http://nowhere:3"}}, "problem", ("nowhere", "ROS_HOSTNAME"))])
def test_faults_of_a_graph(changes, level, words):
    one_fault(graph.check_master(FakeMachine(), make_graph(**changes)), level, *words)


def test_a_dead_simulator_publishes_no_clock():
    found = faults(graph.check_master(FakeMachine(), make_graph(silent=["/gazebo"])))
    assert [entry.level for entry in found] == ["warning", "problem"]


@pytest.mark.parametrize("senders, takers, words", [
    (["/teleop", "/go_to_point"], ["/gazebo"], ("2 nodes may command /cmd_vel", "rosnode kill")),
    (["/teleop"], [], ("no robot listens", "spawn"))])
def test_faults_of_commands(senders, takers, words):
    state = make_graph(publishers={"/cmd_vel": senders}, subscribers={"/cmd_vel": takers})
    one_fault(graph.check_topics(state), "warning", *words)


def test_a_robot_in_another_namespace_is_named():
    state = make_graph(types={"/cmd_vel": "geometry_msgs/Twist", "/r1/cmd_vel": "geometry_msgs/Twist"},
                       publishers={"/cmd_vel": ["/teleop"]}, subscribers={"/r1/cmd_vel": ["/gazebo"]})
    one_fault(graph.check_topics(state), "warning", "cmd_vel:=/r1/cmd_vel")


def test_no_master_is_noticed_quickly():
    assert graph.read_graph({"ROS_MASTER_URI": "http://127.0.0.1:1"}) is None
    assert graph.read_graph({"ROS_MASTER_URI": "nonsense"}) is None


# -- frames ---------------------------------------------------------------------------------------------------------

EDGES = {("odom", "link_chassis"): frames.Edge({"/gazebo"}, -0.01, False),
         ("link_chassis", "sensor_laser"): frames.Edge({"/robot_state_publisher"}, None, True),
         ("link_chassis", "link_left_wheel"): frames.Edge({"/robot_state_publisher"}, -0.01, False)}


def make_seen(**changes):
    return frames.Seen(
        edges=dict(EDGES), scans={"/scan": frames.Stream(50, {("sensor_laser", None)}, [0.01])},
        odometry={"/odom": frames.Stream(50, {("odom", "link_chassis")}, [0.01])}, clock=(10.0, 12.5),
        links=["link_chassis", "sensor_laser", "link_left_wheel"])._replace(**changes)


def without(*pairs):
    return {pair: edge for pair, edge in EDGES.items() if pair not in pairs}


def test_a_sound_robot_has_no_faults():
    found = frames.check(make_graph(), make_seen())
    assert found and not faults(found)


@pytest.mark.parametrize("changes, level, words", [
    ({"clock": (10.0, 10.0), "scans": {"/scan": frames.Stream(0, set(), [])}}, "warning", ("not advance", "unpause")),
    ({"scans": {}}, "warning", ("no node publishes a laser scan",)),
    ({"scans": {"/scan": frames.Stream(0, set(), [])}}, "problem", ("/scan is advertised, but no scan comes", "log")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo", "/ekf"}, -0.01, False)}}, "problem",
     ("odom -> link_chassis is published by /ekf, /gazebo", "stop one")),
    ({"edges": {**EDGES, ("map", "link_chassis"): frames.Edge({"/amcl"}, -0.01, False)}}, "problem",
     ("link_chassis has 2 parents, map, odom",)),
    ({"edges": without(("link_chassis", "link_left_wheel"))}, "warning", ("link_left_wheel", "joint_states")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, 3.0, False)}}, "problem",
     ("3.0 s in the future", "use_sim_time")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, -9.0, False)}}, "warning",
     ("9.0 s old", "use_sim_time")),
    ({"scans": {"/scan": frames.Stream(50, {("sensor_laser", None)}, [1.6e9])}}, "problem", ("in the past", "clock")),
    ({"edges": without(("odom", "link_chassis"))}, "problem", ("no transform from odom to the laser's frame",)),
    ({"edges": {}}, "problem", ("no transforms at all", "robot_state_publisher"))])
def test_faults_of_frames(changes, level, words):
    one_fault(frames.check(make_graph(), make_seen(**changes)), level, *words)


def test_an_unknown_laser_frame():
    seen = make_seen(scans={"/scan": frames.Stream(9, {("laser", None)}, [0.01])})
    one_fault(frames.check(make_graph(), seen), "problem", "\"laser\" is in no transform", "link_chassis")


@pytest.mark.parametrize("edges", [{}, without(("link_chassis", "sensor_laser"), ("link_chassis", "link_left_wheel"))])
def test_a_robot_without_frames_yet_is_no_problem(edges):
    alone = make_graph(subscribers={"/tf": ["/doctor_17_3"]})
    found = frames.check(alone, make_seen(edges=edges))
    assert not faults(found) and any("rvis.launch" in finding.what for finding in found)
    read = make_graph(subscribers={"/tf": ["/doctor_17_3", "/rviz"]})
    assert any(finding.level == "problem" for finding in frames.check(read, make_seen(edges=edges)))


def test_fast_time_ages_stamps_faster():
    edges = {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, -9.0, False)}
    assert not faults(frames.check(make_graph(), make_seen(edges=edges, clock=(0.0, 50.0))))


def test_links_without_a_name_are_ignored():
    assert frames.links_of('<robot name="r"><link/><link name="base"/></robot>') == ["base"]


def test_a_ring_of_frames_ends():
    edges = {("a", "b"): frames.Edge({"/n"}, None, True), ("b", "a"): frames.Edge({"/n"}, None, True)}
    frames.check(make_graph(), make_seen(edges=edges))


# -- the command ----------------------------------------------------------------------------------------------------

def test_the_exit_code_is_the_worst_level():
    entries = [Finding("master", "ok", "", ""), Finding("master", "warning", "", "x")]
    assert worst([]) == "ok" and worst(entries) == "warning"
    assert worst(entries + [Finding("master", "problem", "", "x")]) == "problem"
    assert some("cab", 2) == "a, b and 1 more"


def test_a_check_that_fails_leaves_the_others():
    found = command._guarded("display", lambda: 1 / 0)
    assert found[0].level == "warning" and "ZeroDivisionError" in found[0].what


def test_json_and_text_say_the_same(capsys):
    machine = FakeMachine()
    machine.environ["ROS_MASTER_URI"] = "http://localhost:1"
    del machine.programs["ffmpeg"]
    code = command.main(["--json"], machine)
    told = json.loads(capsys.readouterr().out)
    assert told["exit_code"] == code and any("ffmpeg" in entry["what"] for entry in told["findings"])
    assert command.main(["--quiet", "__name:=doctor"], machine) == code
    text = capsys.readouterr().out
    assert "-> sudo apt install ffmpeg" in text and "  ok " not in text
    assert re.search(r"warnings, [1-9]\d* ok$", text.strip())      # what is left out is counted all the same


def test_this_machine_can_be_examined(tmp_path):
    machine = Machine()
    machine.environ.update(ROS_MASTER_URI="http://127.0.0.1:1", HOME=str(tmp_path))
    found = command.examine(machine)
    assert {entry.area for entry in found} >= {"installation", "environment", "display", "master"}
    assert not any("a check failed itself" in entry.what for entry in found)
    assert machine.writable(str(tmp_path / "new" / "folder")) and not machine.writable("/proc")
    assert machine.addresses("localhost") and not machine.accepts("127.0.0.1", 1)
