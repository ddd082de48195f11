# SPDX-License-Identifier: BSD-3-Clause
"""A machine, packages and a graph without faults, for the tests of the doctor."""
from m2wr_tools.doctor import clients, environment, graph

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


def make_graph(**changes):
    running = graph.Graph(
        publishers={"/clock": ["/gazebo"], "/cmd_vel": ["/go_to_point", "/wall_follower"], "/scan": ["/gazebo"]},
        subscribers={"/cmd_vel": ["/gazebo"], "/tf": ["/rviz"]}, services={},
        types={"/clock": "rosgraph_msgs/Clock", "/cmd_vel": "geometry_msgs/Twist", "/scan": "sensor_msgs/LaserScan"},
        nodes={"/gazebo": "http://localhost:1", "/go_to_point": "http://localhost:2"}, silent=[], sim_time=True)
    return running._replace(**changes)


def environment_findings(machine=None, **variables):
    machine = machine or FakeMachine()
    machine.environ.update(variables)
    return environment.check_environment(machine)
