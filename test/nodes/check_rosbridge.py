#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""rosbridge: what web pages may do over a websocket, and what they may not."""
import base64
import io
import json
import os
import socket
import struct
import sys
import threading
import unittest

import cbor2
import rospy
import websockets.exceptions
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import TransformStamped, Twist
from PIL import Image
from rosbridge_msgs.msg import ConnectedClients
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Int32, String, UInt8MultiArray
from std_srvs.srv import SetBool, SetBoolResponse
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import Recorder, Running, program, run_checks, wait_until  # noqa: E402
from web_client import WebClient  # noqa: E402

MANY = 200              # clients at the same time
BIG = 200_000           # bytes of a message that fills the buffers of a slow client soon
STARTED = "Rosbridge WebSocket server started: "
WANTED = {"source_frames": ["/base"], "target_frame": "odom", "angular_thres": 0.1, "trans_thres": 0.1, "rate": 20.0}


def memory(process):
    """Return the memory that a process holds [bytes]."""
    with open("/proc/%d/statm" % process, encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Rosbridge(unittest.TestCase):
    """One server, started by the launch file."""

    @classmethod
    def setUpClass(cls):
        cls.port = free_port()
        cls.running = Running(["roslaunch", "rosbridge_server", "rosbridge_websocket.launch", "port:=%d" % cls.port,
                               "unregister_timeout:=0.5"])
        cls.running.wait_for_text(STARTED)
        rospy.wait_for_service("/rosapi/get_param_names", 60.0)         # the last that rosapi offers
        cls.address = "ws://localhost:%d" % cls.port

    @classmethod
    def tearDownClass(cls):
        cls.running.__exit__()

    def client(self, **options):
        made = WebClient(self.address, **options)
        self.addCleanup(made.socket.close)
        return made

    def call(self, client, called, **arguments):
        client.send(op="call_service", service=called, args=arguments, id=called)
        answer = client.wait_for("service_response", id=called)
        self.assertTrue(answer["result"], answer)
        return answer["values"]

    # ---- topics ------------------------------------------------------------------------------------------------

    def test_a_page_drives_even_with_its_first_message(self):
        commands, page = Recorder("/cmd_vel", Twist), self.client()
        page.send(op="advertise", topic="/cmd_vel", type="geometry_msgs/Twist")
        page.send(op="publish", topic="/cmd_vel", msg={"linear": {"x": 0.5}})
        commands.wait(lambda messages: messages[0].linear.x == 0.5, "a command")
        page.socket.close()
        wait_until(lambda: commands._subscriber.get_num_connections() == 0, "the end of the topic")

    def test_each_compression_brings_the_message(self):
        scans = rospy.Publisher("/scan", LaserScan, latch=True, queue_size=1)
        scans.publish(LaserScan(ranges=[1.5, float("nan"), float("inf")]))
        page = self.client()
        page.send(op="subscribe", topic="/scan", type="sensor_msgs/LaserScan")
        self.assertEqual(page.wait_for("publish")["msg"]["ranges"], [1.5, None, None])
        late = self.client()
        late.send(op="subscribe", topic="/scan", compression="png", fragment_size=100)
        parts, total = {}, None
        while total is None or len(parts) < total:
            part = late.wait_for("fragment")
            parts[part["num"]], total = part["data"], part["total"]
        picture = json.loads("".join(parts[number] for number in sorted(parts)))
        pixels = Image.open(io.BytesIO(base64.b64decode(picture["data"]))).tobytes()
        self.assertEqual(json.loads(pixels)["msg"]["ranges"], [1.5, None, None])
        binary = self.client()
        binary.send(op="subscribe", topic="/scan", compression="cbor")
        ranges = cbor2.loads(binary.wait(lambda message: isinstance(message, bytes), "CBOR"))["msg"]["ranges"]
        self.assertEqual((ranges.tag, ranges.value[:4]), (85, struct.pack("<f", 1.5)))
        raw = self.client()
        raw.send(op="subscribe", topic="/scan", compression="cbor-raw")
        content = cbor2.loads(raw.wait(lambda message: isinstance(message, bytes), "CBOR"))["msg"]["bytes"]
        self.assertEqual(list(LaserScan().deserialize(content).ranges[:1]), [1.5])

    def test_throttle_sends_fewer_and_the_newest(self):
        numbers = rospy.Publisher("/numbers", Int32, queue_size=1000)
        page = self.client()
        page.send(op="subscribe", topic="/numbers", throttle_rate=300, queue_length=1)
        wait_until(lambda: numbers.get_num_connections(), "the subscriber")
        for number in range(200):
            numbers.publish(number)
        got = []
        while not got or got[-1] != 199:
            got.append(page.wait_for("publish")["msg"]["data"])
        self.assertLess(len(got), 10)
        self.assertEqual(got, sorted(got))

    def test_a_slow_client_costs_no_memory_and_delays_no_other(self):
        big = rospy.Publisher("/big", UInt8MultiArray, queue_size=10)
        slow, fast = self.client(), self.client()
        slow.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for page in (slow, fast):
            page.send(op="subscribe", topic="/big", queue_length=2)
        wait_until(lambda: big.get_num_connections(), "the subscriber")
        process, = [int(pid) for pid in os.listdir("/proc") if pid.isdigit() and self.is_server(pid)]
        message, before = UInt8MultiArray(data=bytes(BIG)), 0
        for number in range(400):
            big.publish(message)
            self.assertEqual(len(fast.wait_for("publish")["msg"]["data"]), 4 * -(-BIG // 3))
            if number == 50:
                before = memory(process)
        self.assertLess(memory(process) - before, 100 * BIG)        # 350 messages came since

    def is_server(self, pid):
        try:
            with open("/proc/%s/cmdline" % pid, "rb") as stream:
                words = stream.read().split(b"\0")
        except OSError:
            return False
        return any(word.endswith(b"/rosbridge_websocket") for word in words) and os.getpgid(int(pid)) and \
            self.is_below(int(pid), self.running.process.pid)

    @staticmethod
    def is_below(pid, ancestor):
        while pid > 1:
            if pid == ancestor:
                return True
            with open("/proc/%d/stat" % pid, encoding="utf-8") as stream:
                pid = int(stream.read().rpartition(")")[2].split()[1])
        return False

    def test_two_hundred_clients_get_every_message(self):
        text = rospy.Publisher("/text", String, queue_size=10)
        pages = [self.client() for _ in range(MANY)]
        for page in pages:
            page.send(op="subscribe", topic="/text", type="std_msgs/String")
            page.send(op="call_service", service="/rosapi/get_time", id="ready")
        for page in pages:
            page.wait_for("service_response", id="ready")
        wait_until(lambda: text.get_num_connections(), "the subscriber")
        text.publish("<b>all</b>")
        for page in pages:
            self.assertEqual(page.wait_for("publish")["msg"], {"data": "<b>all</b>"})

    # ---- services and parameters -------------------------------------------------------------------------------

    def test_services_work_in_both_directions(self):
        served = rospy.Service("/ours", SetBool, lambda request: SetBoolResponse(request.data, "ours"))
        self.addCleanup(served.shutdown)
        page = self.client()
        self.assertEqual(self.call(page, "/ours", data=True), {"success": True, "message": "ours"})
        page.send(op="advertise_service", service="/theirs", type="std_srvs/SetBool")
        rospy.wait_for_service("/theirs", 60.0)
        answers = []
        thread = threading.Thread(target=lambda: answers.append(rospy.ServiceProxy("/theirs", SetBool)(True)))
        thread.start()
        asked = page.wait_for("call_service")
        self.assertEqual(asked["args"], {"data": True})
        page.send(op="service_response", service="/theirs", id=asked["id"], values={"message": "page"}, result=True)
        thread.join(60.0)
        self.assertEqual(answers[0].message, "page")

    def test_a_page_that_leaves_ends_its_open_calls(self):
        page, errors = self.client(), []
        page.send(op="advertise_service", service="/leaving", type="std_srvs/SetBool")
        rospy.wait_for_service("/leaving", 60.0)

        def call():
            try:
                rospy.ServiceProxy("/leaving", SetBool)(True)
            except rospy.ServiceException as error:
                errors.append(str(error))
        thread = threading.Thread(target=call)
        thread.start()
        page.wait_for("call_service")
        page.socket.close()
        thread.join(60.0)
        self.assertIn("has left", errors[0])

    def test_parameters_and_the_graph_are_told_by_rosapi(self):
        page = self.client()
        self.call(page, "/rosapi/set_param", name="/page/value", value='{"a": [1, 2.5]}')
        self.assertEqual(rospy.get_param("/page/value"), {"a": [1, 2.5]})
        self.assertEqual(json.loads(self.call(page, "/rosapi/get_param", name="/page/value")["value"]), {"a": [1, 2.5]})
        self.assertEqual(self.call(page, "/rosapi/get_param", name="/none", default="7")["value"], "7")
        self.assertIn("/page/value/a", self.call(page, "/rosapi/get_param_names")["names"])
        self.assertTrue(self.call(page, "/rosapi/has_param", name="/page/value")["exists"])
        self.call(page, "/rosapi/delete_param", name="/page/value")
        self.assertFalse(self.call(page, "/rosapi/has_param", name="/page/value")["exists"])
        self.assertEqual(self.call(page, "/rosapi/topic_type", topic="/rosout")["type"], "rosgraph_msgs/Log")
        self.assertIn("/rosapi", self.call(page, "/rosapi/nodes")["nodes"])
        self.assertIn("/rosapi/nodes", self.call(page, "/rosapi/node_details", node="/rosapi")["services"])
        self.assertEqual(self.call(page, "/rosapi/service_type", service="/rosapi/nodes")["type"], "rosapi/Nodes")
        self.assertEqual(self.call(page, "/rosapi/service_node", service="/rosapi/nodes")["node"], "/rosapi")
        topics = self.call(page, "/rosapi/topics")
        self.assertEqual(topics["types"][topics["topics"].index("/rosout")], "rosgraph_msgs/Log")
        details = self.call(page, "/rosapi/message_details", type="geometry_msgs/Twist")["typedefs"]
        self.assertEqual([one["type"] for one in details], ["geometry_msgs/Twist", "geometry_msgs/Vector3"])
        asked = self.call(page, "/rosapi/service_request_details", type="std_srvs/SetBool")["typedefs"]
        self.assertEqual(asked[0]["fieldnames"], ["data"])
        self.assertGreater(self.call(page, "/rosapi/get_time")["time"]["secs"], 0)
        self.assertLessEqual(set(self.call(page, "/rosapi/action_servers")["action_servers"]), {"/tf2_web_republisher"})

    # ---- bad input ---------------------------------------------------------------------------------------------

    def test_odd_messages_are_answered_and_the_node_continues(self):
        page = self.client()
        for text, words in (
                ("no JSON", "not a request"), ("[" * 100000, "object"), (b"\x00", "binary"), ("{}", "op"),
                ('{"op": "publish", "topic": "/cmd_vel", "msg": {"linear": {"x": NaN}}}', "malformed"),
                ('{"op": "advertise", "topic": "/a b", "type": "std_msgs/String"}', "topic name"),
                ('{"op": "advertise", "topic": "/a", "type": "os/path"}', "os"),
                ('{"op": "advertise", "topic": "/a", "type": "std_msgs/No"}', "no such type"),
                ('{"op": "advertise", "topic": "/rosout", "type": "std_msgs/String"}', "rosgraph_msgs/Log"),
                ('{"op": "subscribe", "topic": "/rosout", "type": "std_msgs/String"}', "rosgraph_msgs/Log"),
                ('{"op": "publish", "topic": "/unknown", "msg": {}}', "no type yet"),
                ('{"op": "call_service", "service": "/unknown"}', "does not exist"),
                ('{"op": "advertise_service", "service": "/x", "type": "std_srvs/No"}', "no such type")):
            page.socket.send(text)
            answer = page.wait_for("status")
            self.assertEqual(answer["level"], "error")
            self.assertIn(words, answer["msg"])
        page.send(op="advertise", topic="/typed", type="geometry_msgs/Twist")
        page.send(op="publish", topic="/typed", msg={"linear": {"x": "fast"}}, id="wrong")
        self.assertIn("msg.linear.x: expected float64", page.wait_for("status", id="wrong")["msg"])
        self.assertTrue(self.call(page, "/rosapi/nodes")["nodes"])

    def test_a_gigabyte_is_refused_before_it_is_read(self):
        page = self.client()
        page.socket.socket.sendall(b"\x81\xff" + struct.pack(">Q", 1 << 30) + b"\0\0\0\0")
        with self.assertRaises(websockets.exceptions.ConnectionClosed) as caught:
            page.receive()
        self.assertEqual(caught.exception.rcvd.code, 1009)
        self.assertTrue(self.call(self.client(), "/rosapi/nodes")["nodes"])

    def test_pages_of_other_sites_are_refused(self):
        for origin in ("http://elsewhere.example", "null", "http://localhost.elsewhere.example"):
            with self.assertRaises(websockets.exceptions.InvalidStatus, msg=origin) as caught:
                WebClient(self.address, origin=origin)
            self.assertEqual(caught.exception.response.status_code, 403)
        with self.assertRaises(websockets.exceptions.InvalidStatus):
            WebClient("ws://elsewhere.example:%d" % self.port, sock=socket.create_connection(("localhost", self.port)))
        self.client(origin="http://localhost:8000")

    def test_a_port_that_is_taken_is_said_and_waited_for(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen(1)
            port = other.getsockname()[1]
            with Running([program("rosbridge_server", "rosbridge_websocket"), "__name:=second", "_port:=%d" % port,
                          "_retry_startup_delay:=0.2"]) as node:
                node.wait_for_text("(process %d) has it" % os.getpid())
                other.close()
                node.wait_for_text(STARTED)

    def test_port_0_is_a_free_one_that_is_said(self):
        with Running([program("rosbridge_server", "rosbridge_websocket"), "__name:=any_port", "_port:=0"]) as node:
            node.wait_for_text(STARTED)
            wait_until(lambda: rospy.has_param("/any_port/actual_port"), "the parameter, which is set after the text")
            port = rospy.get_param("/any_port/actual_port")
            node.wait_for_text("ws://localhost:%d" % port)
            with WebClient("ws://localhost:%d" % port) as page:
                self.assertTrue(page.socket.ping().wait(60.0))

    def test_another_address_needs_the_token(self):
        with Running([program("rosbridge_server", "rosbridge_websocket"), "__name:=open", "_address:=0.0.0.0",
                      "_port:=%d" % free_port()]) as node:
            node.wait_for_text(STARTED)
            wait_until(lambda: "token=" in node.text and node.text.endswith("\n"), "the link")
            link = node.text.partition(STARTED)[2].split()[0].partition("\x1b")[0]
            with WebClient(link, origin="http://elsewhere.example") as page:
                self.assertTrue(page.socket.ping().wait(60.0))
            with self.assertRaises(websockets.exceptions.InvalidStatus):
                WebClient(link.partition("?")[0])

    def test_wrong_parameters_end_the_node_with_a_reason(self):
        for name, value, reason in (("authenticate", "true", "token"), ("port", "99999", "port"),
                                    ("topics_glob", "/a", "brackets"), ("ssl", "true", "certfile")):
            with Running([program("rosbridge_server", "rosbridge_websocket"), "__name:=wrong_" + name,
                          "_%s:=%s" % (name, value)]) as node:
                self.assertEqual(node.wait(), 1)
                self.assertIn(reason, node.text)

    def test_number_and_addresses_of_clients_are_published(self):
        counts, clients = Recorder("/client_count", Int32), Recorder("/connected_clients", ConnectedClients)
        page = self.client()
        counts.wait(lambda messages: messages[-1].data >= 1, "a client")
        one, = clients.wait(lambda messages: messages[-1].clients if len(messages[-1].clients) == 1 else None,
                            "the address of the only client")
        self.assertIn(one.ip_address, ("127.0.0.1", "::1"))
        self.assertLess(abs((rospy.get_rostime() - one.connection_time).to_sec()), 60.0)
        page.socket.close()
        counts.wait(lambda messages: messages[-1].data == 0, "no client")
        clients.wait(lambda messages: not messages[-1].clients, "a list without clients")

    # ---- transforms --------------------------------------------------------------------------------------------

    def moving_frame(self):
        """Publish a transform from base to odom; returns a function that sets its x [m]."""
        sender = rospy.Publisher("/tf_static", TFMessage, latch=True, queue_size=1)
        node = Running([program("tf2_web_republisher", "tf2_web_republisher")])
        node.__enter__()
        self.addCleanup(node.__exit__)
        rospy.wait_for_service("/republish_tfs", 60.0)

        def move(x):
            found = TransformStamped(child_frame_id="base")
            found.header.frame_id, found.transform.translation.x, found.transform.rotation.w = "odom", x, 1.0
            sender.publish([found])
        move(1.0)
        return move

    def test_a_page_gets_transforms_as_feedback_of_an_action(self):
        move, page = self.moving_frame(), self.client()
        root, kind = "/tf2_web_republisher/", "tf2_web_republisher/TFSubscriptionAction"
        for name, part in (("goal", "Goal"), ("cancel", "")):
            page.send(op="advertise", topic=root + name, type=kind + part if part else "actionlib_msgs/GoalID")
        page.send(op="subscribe", topic=root + "feedback", type=kind + "Feedback")

        def x_of(message):
            transform, = message["msg"]["feedback"]["transforms"]
            self.assertEqual((transform["child_frame_id"], transform["header"]["frame_id"]), ("base", "odom"))
            return transform["transform"]["translation"]["x"]
        page.send(op="publish", topic=root + "goal", msg={"goal_id": {"id": "one"}, "goal": WANTED})
        self.assertEqual(x_of(page.wait_for("publish", topic=root + "feedback")), 1.0)
        move(1.05)                          # below the threshold, and so is not sent
        move(2.0)
        self.assertEqual(x_of(page.wait_for("publish", topic=root + "feedback")), 2.0)
        page.send(op="subscribe", topic=root + "status", type="actionlib_msgs/GoalStatusArray")

        def end_of(goal):
            found = page.wait(lambda message: message.get("topic") == root + "status" and any(
                one["goal_id"]["id"] == goal and one["status"] > GoalStatus.ACTIVE
                for one in message["msg"]["status_list"]), "the end of goal " + goal)["msg"]["status_list"]
            return [(one["status"], one["text"]) for one in found if one["goal_id"]["id"] == goal][0]
        page.send(op="publish", topic=root + "cancel", msg={"id": "one"})
        self.assertEqual(end_of("one")[0], GoalStatus.PREEMPTED)
        page.send(op="publish", topic=root + "goal",
                  msg={"goal_id": {"id": "two"}, "goal": dict(WANTED, rate=0.0)})
        status, reason = end_of("two")
        self.assertEqual(status, GoalStatus.REJECTED)
        self.assertIn("rate is 0 Hz", reason)
        self.assertEqual(self.call(page, "/rosapi/action_servers")["action_servers"], ["/tf2_web_republisher"])

    def test_a_page_gets_transforms_on_a_topic_of_a_service(self):
        move, page = self.moving_frame(), self.client()
        topic = self.call(page, "/republish_tfs", **dict(WANTED, timeout={"secs": 1, "nsecs": 0}))["topic_name"]
        page.send(op="subscribe", topic=topic, type="tf2_web_republisher/TFArray")
        transform, = page.wait_for("publish", topic=topic)["msg"]["transforms"]
        self.assertEqual(transform["transform"]["translation"], {"x": 1.0, "y": 0.0, "z": 0.0})
        move(2.0)
        transform, = page.wait_for("publish", topic=topic)["msg"]["transforms"]
        self.assertEqual(transform["transform"]["translation"]["x"], 2.0)
        page.socket.close()
        wait_until(lambda: topic not in dict(rospy.get_published_topics()), "the end of a topic that is not read")


if __name__ == "__main__":
    rospy.init_node("check_rosbridge", disable_rostime=True)
    run_checks("rosbridge", Rosbridge)
