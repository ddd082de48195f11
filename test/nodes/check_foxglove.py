#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Foxglove server: topics, services, parameters, publishing, time, files, and what it refuses."""
import contextlib
import io
import json
import os
import socket
import struct
import sys
import threading
import unittest

import rosgraph
import rospkg
import rospy
import websockets.exceptions
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import Recorder, Running, program, run_checks, wait_until  # noqa: E402
from web_client import WebClient  # noqa: E402

PROTOCOL = "foxglove.websocket.v1"
MANY = 200              # clients at the same time


def written(message):
    stream = io.BytesIO()
    message.serialize(stream)
    return stream.getvalue()


class Foxglove(unittest.TestCase):
    """One server, started by the launch file."""

    @classmethod
    def setUpClass(cls):
        cls.port = free_port()
        cls.address = "ws://localhost:%d" % cls.port
        cls.clock = rospy.Publisher("/clock", Clock, queue_size=10)
        cls.running = Running(["roslaunch", "foxglove_bridge", "foxglove_bridge.launch", "port:=%d" % cls.port,
                               "client_topic_whitelist:=['/cmd_vel', '/own.*']"])
        cls.running.wait_for_text("Foxglove server started: ")

    @classmethod
    def tearDownClass(cls):
        cls.running.__exit__()

    def client(self, **options):
        made = WebClient(self.address, subprotocols=[PROTOCOL], **options)
        self.addCleanup(made.socket.close)
        self.assertEqual(made.socket.subprotocol, PROTOCOL)
        self.info = made.wait_for("serverInfo")
        self.assertEqual(self.info["metadata"], {"ROS_DISTRO": "noetic"})
        return made

    def advertised(self, client, operation, key, field, name):
        """Wait until a topic or service is advertised; returns its description."""
        found = client.wait(lambda message: isinstance(message, dict) and message["op"] == operation and any(
            one[field] == name for one in message[key]), "%s of %s" % (operation, name))
        return next(one for one in found[key] if one[field] == name)

    def test_a_topic_is_told_and_its_messages_are_sent(self):
        text, client = rospy.Publisher("/text", String, latch=True, queue_size=10), self.client()
        text.publish("<b>hello</b>")
        channel = self.advertised(client, "advertise", "channels", "topic", "/text")
        self.assertEqual((channel["encoding"], channel["schemaName"], channel["schema"]),
                         ("ros1", "std_msgs/String", String._full_text))
        client.send(op="subscribe", subscriptions=[{"id": 77, "channelId": channel["id"]}])
        frame = client.wait(lambda message: isinstance(message, bytes) and message[0] == 1, "a message")
        self.assertEqual(struct.unpack_from("<BI", frame), (1, 77))
        self.assertEqual(String().deserialize(frame[13:]).data, "<b>hello</b>")
        text.unregister()
        client.send(op="unsubscribe", subscriptionIds=[77])
        client.wait(lambda message: isinstance(message, dict) and message["op"] == "unadvertise" and channel[
            "id"] in message["channelIds"], "the end of /text")

    def test_a_client_drives(self):
        commands, client = Recorder("/cmd_vel", Twist), self.client()
        client.send(op="advertise", channels=[{"id": 5, "topic": "/cmd_vel", "encoding": "ros1",
                                               "schemaName": "geometry_msgs/Twist"}])
        command = Twist()
        command.linear.x = 0.5
        client.socket.send(struct.pack("<BI", 1, 5) + written(command))
        commands.wait(lambda messages: messages[0].linear.x == 0.5, "a command")
        client.send(op="unadvertise", channelIds=[5])
        wait_until(lambda: commands._subscriber.get_num_connections() == 0, "the end of the topic")

    def test_a_service_is_called(self):
        served = rospy.Service("/switch", SetBool, lambda request: SetBoolResponse(request.data, "done"))
        self.addCleanup(served.shutdown)
        client = self.client()
        service = self.advertised(client, "advertiseServices", "services", "name", "/switch")
        self.assertEqual(service["type"], "std_srvs/SetBool")
        self.assertIn("bool data", service["request"]["schema"])
        call = struct.pack("<BIII", 2, service["id"], 9, 4) + b"ros1"
        client.socket.send(call + written(SetBoolRequest(True)))
        frame = client.wait(lambda message: isinstance(message, bytes) and message[0] == 3, "an answer")
        self.assertEqual(frame[:17], struct.pack("<BIII", 3, service["id"], 9, 4) + b"ros1")
        self.assertEqual(SetBoolResponse().deserialize(frame[17:]), SetBoolResponse(True, "done"))
        client.socket.send(call + b"too long")
        self.assertEqual(client.wait_for("serviceCallFailure")["callId"], 9)
        client.socket.send(struct.pack("<BIII", 2, 99999, 10, 4) + b"ros1")
        self.assertEqual(client.wait_for("serviceCallFailure")["callId"], 10)

    def test_a_service_whose_address_is_not_ros_is_left_out(self):
        def hang_up():
            with contextlib.suppress(OSError):      # the test has ended
                while True:
                    listening.accept()[0].close()

        master, listening = rosgraph.Master(rospy.get_name()), socket.socket()
        listening.bind(("127.0.0.1", 0))
        listening.listen(5)
        threading.Thread(target=hang_up, daemon=True).start()
        address = "rosrpc://localhost:%d" % listening.getsockname()[1]
        master.registerService("/odd", address, rospy.get_node_uri())
        try:
            self.running.wait_for_text("service /odd is left out")
        finally:
            master.unregisterService("/odd", address)
            listening.shutdown(socket.SHUT_RDWR)
            listening.close()
        served = rospy.Service("/even", SetBool, lambda request: SetBoolResponse())
        self.addCleanup(served.shutdown)
        self.advertised(self.client(), "advertiseServices", "services", "name", "/even")

    def test_parameters_are_read_set_and_watched(self):
        rospy.set_param("/p/a", 1)
        client = self.client()
        client.send(op="getParameters", parameterNames=["/p/a", "/p/none"], id="g")
        self.assertEqual(client.wait_for("parameterValues", id="g")["parameters"], [{"name": "/p/a", "value": 1}])
        client.send(op="setParameters", parameters=[{"name": "/p/b", "value": [1.5, "x"]}], id="s")
        self.assertEqual(client.wait_for("parameterValues", id="s")["parameters"][0]["value"], [1.5, "x"])
        self.assertEqual(rospy.get_param("/p/b"), [1.5, "x"])
        client.send(op="setParameters", parameters=[{"name": "/p/c", "value": 2, "type": "float64"}], id="f")
        self.assertEqual(client.wait_for("parameterValues", id="f")["parameters"], [
            {"name": "/p/c", "value": 2.0, "type": "float64"}])
        self.assertIsInstance(rospy.get_param("/p/c"), float)
        client.send(op="subscribeParameterUpdates", parameterNames=["/p/a"])
        rospy.set_param("/p/a", 2)
        client.wait(lambda message: isinstance(message, dict) and message.get("parameters") == [
            {"name": "/p/a", "value": 2}], "the new value")

    def test_simulated_time_is_sent(self):
        client = self.client()
        self.assertIn("time", self.info["capabilities"])
        wait_until(lambda: self.clock.get_num_connections() > 0, "the subscriber")
        client.send(op="getParameters", parameterNames=[], id="ready")
        client.wait_for("parameterValues", id="ready")
        self.clock.publish(rospy.Time(12, 500))
        frame = client.wait(lambda message: isinstance(message, bytes) and message[0] == 2, "the time")
        self.assertEqual(struct.unpack("<BQ", frame), (2, 12 * 10**9 + 500))

    def test_the_graph_is_told(self):
        client = self.client()
        client.send(op="subscribeConnectionGraph")
        graph = client.wait_for("connectionGraphUpdate")
        topics = {one["name"]: one["publisherIds"] for one in graph["publishedTopics"]}
        self.assertIn("/foxglove_bridge", topics["/rosout"])

    def test_meshes_of_packages_are_sent_and_nothing_else(self):
        client = self.client()
        package = rospkg.RosPack().get_path("m2wr_description")
        with open(os.path.join(package, "urdf", "m2wr.xacro"), "rb") as stream:
            expected = stream.read()
        for number, (uri, good) in enumerate((
                ("package://m2wr_description/urdf/m2wr.xacro", True), ("package://m2wr_description/package.xml", False),
                ("package://m2wr_description/../../../../../../etc/passwd.png", False), ("file:///etc/passwd", False),
                ("package://no_such_package/a.stl", False), ("package://m2wr_description/none.stl", False),
                ("package://m2wr_description/a\0.stl", False))):
            client.send(op="fetchAsset", uri=uri, requestId=number)
            frame = client.wait(lambda message: isinstance(message, bytes) and message[0] == 4, "a file")
            _, request, failed, length = struct.unpack_from("<BIBI", frame)
            self.assertEqual((request, failed), (number, 0 if good else 1), uri)
            self.assertEqual(frame[10 + length:], expected if good else b"")

    def test_odd_messages_are_answered_and_the_node_continues(self):
        client = self.client()
        for message, words in (
                ("no JSON", "not a request"), ("[" * 100000, "object"), ('{"op": "fly"}', "fly"), (b"", "binary"),
                (b"\x02\0\0", "binary"), (b"\x02" + b"\xff" * 12, "binary"), (b"\x09", "binary"),
                (struct.pack("<BI", 1, 4), "not advertised"), ('{"op": "subscribe", "subscriptions": 5}', "array"),
                ('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99999}]}', "channel 99999"),
                ('{"op": "unadvertise", "channelIds": [4]}', "not advertised"),
                (json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/own", "encoding": "json",
                                                              "schemaName": "std_msgs/String"}]}), "expected ros1"),
                (json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/own", "encoding": "ros1",
                                                              "schemaName": "os/path"}]}), "os"),
                (json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/other", "encoding": "ros1",
                                                              "schemaName": "std_msgs/String"}]}), "whitelist"),
                ('{"op": "setParameters", "parameters": [{"name": "a b", "value": 1}]}', "parameter name")):
            client.socket.send(message)
            self.assertIn(words, client.wait_for("status")["message"])
        client.send(op="getParameters", parameterNames=[], id="all")
        self.assertTrue(client.wait_for("parameterValues", id="all")["parameters"])

    def test_pages_of_other_sites_are_refused(self):
        for origin in ("http://elsewhere.example", "null", "http://app.foxglove.dev"):
            with self.assertRaises(websockets.exceptions.InvalidStatus, msg=origin):
                WebClient(self.address, subprotocols=[PROTOCOL], origin=origin)
        for origin in ("https://app.foxglove.dev", "file://", "http://localhost:8080"):
            self.client(origin=origin)

    def test_a_port_that_is_taken_is_said_with_its_owner(self):
        with Running([program("foxglove_bridge", "foxglove_bridge"), "__name:=second",
                      "_port:=%d" % self.port]) as node:
            self.assertEqual(node.wait(), 1)
            self.assertRegex(node.text, r":%d cannot be used .*\(process \d+\) has it" % self.port)

    def test_two_hundred_clients_are_served(self):
        pages = [self.client() for _ in range(MANY)]
        for page in pages:
            page.send(op="getParameters", parameterNames=["/rosdistro"], id="all")
        for page in pages:
            page.wait_for("parameterValues", id="all")

    def test_a_gigabyte_is_refused_before_it_is_read(self):
        page = self.client()
        page.socket.socket.sendall(b"\x81\xff" + struct.pack(">Q", 1 << 30) + b"\0\0\0\0")
        with self.assertRaises(websockets.exceptions.ConnectionClosed) as caught:
            while True:
                page.receive()
        self.assertEqual(caught.exception.rcvd.code, 1009)
        self.client()

    def test_another_protocol_is_refused(self):
        with self.assertRaises(websockets.exceptions.InvalidStatus):
            WebClient(self.address, subprotocols=["other.v1"])


if __name__ == "__main__":
    rospy.init_node("check_foxglove", disable_rostime=True)
    run_checks("foxglove", Foxglove)
