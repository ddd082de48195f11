# SPDX-License-Identifier: BSD-3-Clause
"""Bytes that no client would send, over TCPROS and XML-RPC, to a running simulation and a mapper."""
import ctypes
import io
import os
import signal
import socket
import struct
import subprocess
import sys
import time
import xmlrpc.client

import mutations
from harness import ROOT, Target, Wrong

sys.path.insert(0, os.path.join(ROOT, "test", "nodes"))
import wire  # noqa: E402

NODES = ("/gazebo", "/slam_gmapping")
START, PATIENCE = 120.0, 20.0       # s of wall time for the nodes to start, and for the clock to advance
MOST_MEMORY, MOST_THREADS, MOST_DESCRIPTORS = 400 << 20, 150, 300
_BRIEF = 0.05                       # s that an attacker waits for an answer
_STALLED = 8                        # silent connections that are kept open at a time
_HOUSEKEEPING = 100                 # cases
_ME = "/fuzz"
_METHODS = ("getPid", "getBusInfo", "getBusStats", "getMasterUri", "getSubscriptions", "getPublications",
            "paramUpdate", "publisherUpdate", "requestTopic", "nothing", "system.listMethods", "__init__")
_SERVICES = ("apply_body_wrench", "apply_joint_effort", "clear_body_wrenches", "get_joint_properties",
             "get_link_properties", "get_link_state", "get_model_properties", "get_model_state", "get_light_properties",
             "get_physics_properties", "get_world_properties", "set_joint_properties", "set_link_properties",
             "set_link_state", "set_model_configuration", "set_model_state", "spawn_sdf_model", "spawn_urdf_model",
             "delete_light", "reset_world", "clear_joint_forces")
_PUBLISHED = ("/cmd_vel", "/scan", "/tf", "/gazebo/set_model_state", "/gazebo/set_link_state", "/clock", "/tf_static")
_ODD_XML = ("<?xml version='1.0'?><!DOCTYPE a [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;'><!ENTITY c "
            "'&b;&b;&b;&b;&b;&b;&b;'>]><methodCall><methodName>&c;</methodName></methodCall>",
            "<methodCall><methodName>getPid</methodName><params>" + "<param><value><array><data>" * 300,
            "<methodCall/>", "", "\0" * 100, "<methodCall><methodName>getPid</methodName></methodCall>" * 20)


def _die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


class Graph:
    """The nodes under attack, on a master of their own."""

    def __init__(self):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.uri = "http://127.0.0.1:%d" % port
        environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOSTNAME="127.0.0.1")
        environment.pop("ROS_IP", None)
        self._process = subprocess.Popen(
            ["roslaunch", "-p", str(port), os.path.join(ROOT, "test", "fuzz", "network.launch")], env=environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=_die_with_parent)
        self._clock, self.ticks = None, 0
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    def _connect(self):
        deadline = time.monotonic() + START
        while True:
            try:
                self.addresses = {node: self._lookup("lookupNode", node) for node in NODES}
                self.ports = {node: self._tcpros(node) for node in NODES}
                self._lookup("lookupService", "/gazebo/spawn_urdf_model")
                break
            except (OSError, Wrong, xmlrpc.client.Error):
                if time.monotonic() > deadline:
                    raise Wrong("the nodes did not start within %g s" % START) from None
                time.sleep(0.2)
        self.pids = {node: xmlrpc.client.ServerProxy(uri).getPid(_ME)[2] for node, uri in self.addresses.items()}
        self._clock = wire.Listener(self.uri, "/clock", "/gazebo", self._tick, _ME)
        self._clock.start()
        self.wait_for_clock()

    def _lookup(self, method, name):
        code, text, value = getattr(xmlrpc.client.ServerProxy(self.uri), method)(_ME, name)
        if code != 1:
            raise Wrong(text)
        return value

    def _tcpros(self, node):
        topic = {"/gazebo": "/clock", "/slam_gmapping": "/map"}[node]
        code, text, protocol = xmlrpc.client.ServerProxy(self.addresses[node]).requestTopic(_ME, topic, [["TCPROS"]])
        if code != 1 or not protocol:
            raise Wrong(text)
        return protocol[1], protocol[2]

    def _tick(self, _):
        self.ticks += 1

    def wait_for_clock(self):
        """Wait until the clock has advanced; Wrong if it does not."""
        before, deadline = self.ticks, time.monotonic() + PATIENCE
        while self.ticks <= before:
            if time.monotonic() > deadline:
                raise Wrong("the clock has not advanced for %g s" % PATIENCE)
            time.sleep(0.002)

    def check(self):
        """Raise Wrong if a node has died, grows or does not release its resources."""
        for node, pid in self.pids.items():
            try:
                with open("/proc/%d/statm" % pid) as stream:
                    size = int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
                threads, descriptors = len(os.listdir("/proc/%d/task" % pid)), len(os.listdir("/proc/%d/fd" % pid))
            except (OSError, IndexError):
                raise Wrong("%s has died" % node) from None
            if size > MOST_MEMORY or threads > MOST_THREADS or descriptors > MOST_DESCRIPTORS:
                raise Wrong("%s has %d MB, %d threads, %d descriptors" % (node, size >> 20, threads, descriptors))

    def call(self, service, body=b"", patience=PATIENCE):
        """Call a service with raw bytes; returns the answer's bytes, None for an error."""
        with socket.create_connection(self.ports["/gazebo"], PATIENCE) as stream:
            stream.settimeout(patience)
            stream.sendall(wire.header(callerid=_ME, service=service, md5sum="*", persistent="0"))
            wire.read_framed(stream)
            stream.sendall(struct.pack("<I", len(body)) + body)
            if wire.read_exactly(stream, 1) != b"\1":
                return None
            return wire.read_framed(stream)

    def close(self):
        """End the nodes."""
        if self._clock is not None:
            self._clock.close()
        self._process.terminate()
        try:
            self._process.wait(30.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Network(Target):
    """A case is a list of ``(kind, node or name, bytes)``; each is one connection."""

    name, weight, dear = "network", 3.0, 10.0

    def prepare(self):
        import roslib.message

        from gazebo_msgs import srv  # noqa: F401 (so that workers need not)
        from m2wr_sim.ros.gazebo_services.table import SERVICES
        from messages import Filler
        from target_documents import corpus
        self.filler = Filler(lambda _: ("", "world", "cart", "cart::base", "jl", "crate", "crate::link", "sun"), 0.2)
        self.requests = {name: SERVICES[name]._request_class for name in _SERVICES}
        kinds = {"/cmd_vel": "geometry_msgs/Twist", "/scan": "sensor_msgs/LaserScan", "/tf": "tf2_msgs/TFMessage",
                 "/tf_static": "tf2_msgs/TFMessage", "/clock": "rosgraph_msgs/Clock",
                 "/gazebo/set_model_state": "gazebo_msgs/ModelState", "/gazebo/set_link_state": "gazebo_msgs/LinkState"}
        self.kinds = {topic: roslib.message.get_message_class(kind) for topic, kind in kinds.items()}
        self.text = corpus("light.sdf")[0]
        self.headers = [wire.header(callerid=_ME, topic="/clock", type="*", md5sum="*", tcp_nodelay="1"),
                        wire.header(callerid=_ME, service="/gazebo/get_world_properties", md5sum="*", persistent="1"),
                        wire.header(callerid=_ME, topic="/scan", type="sensor_msgs/LaserScan", md5sum="0" * 32),
                        wire.header(callerid=_ME), wire.header(error="x" * 3000),
                        struct.pack("<I", 0xffffffff) + b"a=b",
                        struct.pack("<I", 4) + struct.pack("<I", 0), b"GET / HTTP/1.0\r\n\r\n", b"\0" * 64]
        self.graph, self._publishers = None, {}

    def make(self, rng):
        return [self._attack(rng) for _ in range(rng.choice((1, 1, 1, 2, 4)))]

    def _attack(self, rng):
        node = rng.choice(NODES)
        kind = rng.choice(("handshake", "handshake", "stall", "drip", "service", "service", "service", "publish",
                           "publish", "xmlrpc", "xmlrpc", "http"))
        if kind in ("handshake", "stall", "drip"):
            data = rng.choice(self.headers)
            return kind, node, mutations.change_bytes(rng, data, self.headers) if rng.randrange(4) else data
        if kind == "service":
            name = rng.choice(_SERVICES)
            request = self.filler.fill(rng, self.requests[name]())
            if name.startswith("spawn"):
                request.model_name, request.model_xml = "new", self.text
            return kind, name, self._body(rng, request)
        if kind == "publish":
            topic = rng.choice(_PUBLISHED[:5])
            return kind, topic, self._body(rng, self.filler.fill(rng, self.kinds[topic]()))
        return kind, node, self._http(rng, kind)

    @staticmethod
    def _body(rng, message):
        buffer = io.BytesIO()
        message.serialize(buffer)
        body = buffer.getvalue()
        return mutations.change_bytes(rng, body) if rng.randrange(3) == 0 else body

    @staticmethod
    def _http(rng, kind):
        arguments = tuple(rng.choice(("/fuzz", "/clock", 0, -1, 2 ** 31 - 1, [], [["TCPROS"]], [["UDPROS", 1, 2, 3]],
                                      "",
                                      ["http://127.0.0.1:1"], {"a": [1.5]}, True, "x" * 2000)) for _ in range(
                                          rng.randrange(5)))
        body = xmlrpc.client.dumps(arguments, rng.choice(_METHODS)).encode()
        if rng.randrange(3) == 0:
            body = mutations.change_bytes(rng, body).replace(b"shutdown", b"shut")
        elif rng.randrange(6) == 0:
            body = rng.choice(_ODD_XML).encode()
        length = rng.choice((len(body), len(body), len(body), 0, -1, 2 ** 40, len(body) + 5, "x"))
        head = "POST %s HTTP/1.%d\r\nContent-Length: %s\r\nContent-Type: text/xml\r\n\r\n" % (
            rng.choice(("/", "/RPC2", "/../x")), rng.randrange(2), length)
        whole = head.encode() + body
        return mutations.change_bytes(rng, whole).replace(b"shutdown", b"shut") if kind == "http" else whole

    def begin(self):
        self._open, self._count, self._publishers = [], 0, {}
        self.graph = Graph()
        os.environ.update(ROS_MASTER_URI=self.graph.uri, ROS_HOSTNAME="127.0.0.1")
        import rospy
        rospy.init_node("fuzz_publisher", disable_signals=True, disable_rostime=True, log_level=rospy.FATAL)
        for topic, kind in self.kinds.items():
            raw = type(kind.__name__, (kind,), {"serialize": lambda self, buff: buff.write(self.bytes),
                                                "__slots__": ("bytes",)})
            self._publishers[topic] = rospy.Publisher(topic, raw, queue_size=10), raw

    def end(self):
        for stream in self._open:
            stream.close()
        if self.graph is not None:
            self.graph.close()

    def run(self, case):
        try:
            for kind, where, data in case:
                getattr(self, "send_" + kind)(where, data)
            self.graph.check()
            self.graph.wait_for_clock()
            self._count += 1
            if self._count % _HOUSEKEEPING == 0:
                self._tidy()
        except Wrong:
            self.broken = True          # the nodes are restarted by a process without old connections
            raise

    def _tidy(self):
        """Delete the added models; a service must still answer."""
        for name in (b"new", b"crate"):
            self.graph.call("/gazebo/delete_model", struct.pack("<I", len(name)) + name)

    def send_handshake(self, node, data, pause=0.0):
        try:
            with socket.create_connection(self.graph.ports[node], PATIENCE) as stream:
                stream.settimeout(_BRIEF)
                if pause:
                    for k in range(0, min(len(data), 20)):
                        stream.sendall(data[k:k + 1])
                        time.sleep(pause)
                else:
                    stream.sendall(data)
                stream.recv(1000)
        except OSError:
            pass                    # refused, closed, or no answer: all are allowed

    def send_drip(self, node, data):
        self.send_handshake(node, data, 0.005)

    def send_stall(self, node, data):
        """Send some data, and then nothing more; the connection stays open for some cases."""
        try:
            stream = socket.create_connection(self.graph.ports[node], PATIENCE)
            stream.sendall(data)
            self._open.append(stream)
        except OSError:
            pass
        while len(self._open) > _STALLED:
            self._open.pop(0).close()

    def send_service(self, name, body):
        try:
            self.graph.call("/gazebo/" + name, body, 5.0 * _BRIEF)
        except (OSError, wire.WireError):
            pass

    def send_publish(self, topic, body):
        publisher, raw = self._publishers[topic]
        message = raw()
        message.bytes = body
        publisher.publish(message)

    def send_xmlrpc(self, node, data):
        host, _, port = self.graph.addresses[node].rpartition("//")[2].strip("/").partition(":")
        try:
            with socket.create_connection((host, int(port)), PATIENCE) as stream:
                stream.settimeout(_BRIEF)
                stream.sendall(data)
                stream.recv(1000)
        except OSError:
            pass

    send_http = send_xmlrpc
