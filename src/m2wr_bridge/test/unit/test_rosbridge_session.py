# SPDX-License-Identifier: BSD-3-Clause
"""The protocol of rosbridge without ROS and without a socket."""
import base64
import io
import json
import threading

import cbor2
import pytest
import roslib.message
from PIL import Image
from std_msgs.msg import String
from std_srvs.srv import SetBoolResponse

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.plain import Reader, typed_array
from m2wr_bridge.messages.received import Received
from m2wr_bridge.rosbridge import session as sessions
from m2wr_bridge.rosbridge.globs import Globs
from m2wr_bridge.rosbridge.session import RosbridgeSession, Rules
from m2wr_bridge.rosbridge.topics import Readers
from m2wr_bridge.web.server import Client

FIND = roslib.message.get_message_class


def received(text):
    return Received(b"raw", "std_msgs/String", "", "", 1, 2, lambda _: String(text))


class Graph:
    """Remembers what it is asked."""

    def __init__(self):
        self.listeners, self.published, self.messages, self.served = {}, {}, [], {}
        self.latched = {}
        self.release = threading.Event()
        self.release.set()

    def subscribe(self, topic, type_name, listener):
        if type_name == "no/Type":
            raise BridgeError("no such type")
        self.listeners[topic] = listener
        self.repeat_latched(topic, listener)

    def repeat_latched(self, topic, listener):
        for text in self.latched.get(topic, []):
            listener(received(text))

    def unsubscribe(self, topic, listener):
        assert self.listeners.pop(topic) is listener

    def advertise(self, topic, type_name, holder, latch, depth):
        self.published[topic] = (type_name, latch, depth)

    def unadvertise(self, topic, holder):
        del self.published[topic]

    def publish(self, topic, values):
        self.messages.append((topic, values))

    def call(self, service, type_name, arguments):
        self.release.wait()
        if service == "/bad":
            raise BridgeError("it failed")
        return SetBoolResponse(True, str(arguments))

    def offer_service(self, service, type_name, handler):
        self.served[service] = handler

    def withdraw_service(self, service):
        del self.served[service]


class Page:
    """A session, with what it has sent."""

    def __init__(self, topics="", services="", largest=1000):
        self.client, self.graph, self.woken = Client("test", 1, self.wake), Graph(), threading.Event()
        rules = Rules(Globs(topics, "topics_glob"), Globs(services, "services_glob"), 5.0, largest)
        self.time = 0.0
        readers = Readers(Reader(FIND), Reader(FIND, typed_array))
        self.session = RosbridgeSession(self.client, self.graph, rules, readers, lambda: self.time)

    def wake(self):
        self.woken.set()

    def ask(self, **fields):
        self.session.handle(json.dumps(fields))

    def frames(self):
        frames, _ = self.client.take(self.time)
        return frames

    def answer(self):
        frame, = self.frames()
        return json.loads(frame)

    def wait_for_answer(self):
        while True:
            self.woken.clear()
            frames = self.frames()
            if frames:
                return frames[0]
            assert self.woken.wait(30.0), "no answer came"

    def deliver(self, topic, text):
        self.graph.listeners[topic](received(text))


BAD = [
    ("no JSON", "not a request"), ("", "not a request"), ("[]", "object"), ("5", "object"), ("null", "object"),
    ("{}", "op"), ('{"op": "fly", "id": "7"}', "unknown operation 'fly'"), ('{"op": 5}', "op"),
    ('{"op": "publish", "id": "7"}', "topic"), ('{"op": "publish", "topic": 5}', "$.topic"),
    ('{"op": "publish", "topic": "/a", "msg": []}', "$.msg"),
    ('{"op": "publish", "topic": "/a", "msg": {"x": NaN}}', "malformed"),
    ("[" * 200000, "object"), ('{"op": "publish", "topic": "/a", "msg": ' + '{"a":' * 100000, "deep"),
    (b"\x00\x01", "binary"), ('{"op": "subscribe", "topic": "/a", "compression": "zip"}', "compression"),
    ('{"op": "subscribe", "topic": "/a", "throttle_rate": -1}', "throttle_rate"),
    ('{"op": "subscribe", "topic": "/a", "queue_length": -1}', "queue_length"),
    ('{"op": "subscribe", "topic": "/a", "type": "no/Type"}', "no such type"),
    ('{"op": "unadvertise", "topic": "/a"}', "not advertised"), ('{"op": "set_level", "level": "loud"}', "level"),
    ('{"op": "unadvertise_service", "service": "/a"}', "not advertised"),
    ('{"op": "service_response", "service": "/a", "id": "1", "values": {}}', "no call"),
    ('{"op": "fragment", "id": "1", "data": "x", "num": 2, "total": 2}', "fragment 2 of 2"),
    ('{"op": "fragment", "id": "1", "data": "x", "num": 0, "total": 1000000000}', "fragment"),
    ("\ud800", "")]


@pytest.mark.parametrize("text, words", BAD, ids=range(len(BAD)))
def test_bad_input_is_answered_with_a_status(text, words):
    page = Page()
    page.session.handle(text)
    answer = page.answer()
    assert answer["op"] == "status" and answer["level"] == "error" and words in answer["msg"]
    assert answer.get("id") == ("7" if '"7"' in str(text) else "1" if '"1"' in str(text) else None)


def test_set_level_none_silences_the_status():
    page = Page()
    page.ask(op="set_level", level="none")
    page.session.handle("no JSON")
    assert page.frames() == []


def test_topics_are_advertised_published_and_released():
    page = Page()
    page.ask(op="advertise", topic="/a", type="std_msgs/String", id="1", latch=True)
    page.ask(op="advertise", topic="/a", type="std_msgs/String", id="2")
    page.ask(op="publish", topic="/a", msg={"data": "x"})
    page.ask(op="unadvertise", topic="/a", id="1")
    assert "/a" in page.graph.published and page.graph.messages == [("/a", {"data": "x"})]
    page.ask(op="unadvertise", topic="/a", id="2")
    assert page.graph.published == {}
    page.ask(op="publish", topic="/b", msg={})
    assert "/b" in page.graph.published
    page.session.close()
    assert page.graph.published == {}


def test_a_message_is_sent_as_json():
    page = Page()
    page.ask(op="subscribe", topic="/a")
    page.deliver("/a", "<b>ä")
    assert page.answer() == {"op": "publish", "topic": "/a", "msg": {"data": "<b>ä"}}


def test_png_holds_the_json():
    page = Page()
    page.ask(op="subscribe", topic="/a", compression="png")
    page.deliver("/a", "ä" * 1000)
    picture = Image.open(io.BytesIO(base64.b64decode(page.answer()["data"])))
    assert json.loads(picture.tobytes().decode())["msg"]["data"] == "ä" * 1000


def test_cbor_and_cbor_raw_are_binary():
    page = Page()
    page.ask(op="subscribe", topic="/a", compression="cbor")
    page.deliver("/a", "x")
    assert cbor2.loads(page.frames()[0]) == {"op": "publish", "topic": "/a", "msg": {"data": "x"}}
    page.ask(op="subscribe", topic="/a", compression="cbor-raw")
    page.deliver("/a", "x")
    assert cbor2.loads(page.frames()[0])["msg"] == {"secs": 1, "nsecs": 2, "bytes": b"raw"}


def test_fragments_are_sent_and_joined():
    page = Page()
    page.ask(op="subscribe", topic="/a", id="s", fragment_size=20)
    page.deliver("/a", "x" * 100)
    parts = [json.loads(frame) for frame in page.frames()]
    assert len(parts) > 5 and {part["total"] for part in parts} == {len(parts)}
    assert json.loads("".join(part["data"] for part in parts))["msg"]["data"] == "x" * 100
    whole = json.dumps({"op": "publish", "topic": "/b", "msg": {"data": "y" * 100}})
    parts = [whole[start:start + 10] for start in range(0, len(whole), 10)]
    for number, part in reversed(list(enumerate(parts))):
        page.ask(op="fragment", id="p", num=number, total=len(parts), data=part)
    assert page.graph.messages == [("/b", {"data": "y" * 100})]


def test_fragments_are_bounded_in_size_number_and_time():
    page = Page(largest=100)
    for number in range(12):
        page.ask(op="fragment", id="big", num=number, total=20, data="x" * 100)
    assert "at most 1000" in page.answer()["msg"]
    for number in range(30):
        page.ask(op="fragment", id=str(number), num=0, total=2, data="x")
    assert "incomplete already" in page.answer()["msg"]
    while page.frames():
        pass
    page.time = 6.0
    page.ask(op="fragment", id="new", num=0, total=2, data="x")
    assert page.frames() == []


def test_subscriptions_are_merged_until_the_last_ends():
    page = Page()
    page.ask(op="subscribe", topic="/a", id="1", throttle_rate=1000, queue_length=5)
    page.ask(op="subscribe", topic="/a", id="2", throttle_rate=500)
    page.deliver("/a", "1")
    page.deliver("/a", "2")
    assert page.answer()["msg"]["data"] == "1" and page.frames() == []
    page.time = 0.5
    assert page.answer()["msg"]["data"] == "2"
    page.ask(op="unsubscribe", topic="/a", id="1")
    assert "/a" in page.graph.listeners
    page.ask(op="unsubscribe", topic="/a", id="2")
    assert page.graph.listeners == {}


def test_each_subscription_gets_the_latched_messages():
    page = Page()
    page.graph.latched["/a"] = ["1", "2"]
    for name in ("x", "y"):
        page.ask(op="subscribe", topic="/a", id=name)
        assert [page.answer()["msg"]["data"] for _ in range(2)] == ["1", "2"] and page.frames() == []


def test_an_unforeseen_error_is_said_and_the_client_continues(monkeypatch):
    page = Page()
    monkeypatch.setattr(page.graph, "publish", lambda topic, values: {}["none"])
    page.ask(op="publish", topic="/a", msg={}, id="7")
    answer = page.answer()
    assert answer["op"] == "status" and answer["id"] == "7" and "KeyError: 'none'" in answer["msg"]
    page.ask(op="subscribe", topic="/a")
    assert "/a" in page.graph.listeners


def test_names_outside_the_globs_are_refused():
    page = Page("[/robot/*]", "['/ok']")
    page.ask(op="subscribe", topic="/other")
    assert "topics_glob" in page.answer()["msg"]
    page.ask(op="publish", topic="/other", msg={})
    assert "topics_glob" in page.answer()["msg"]
    page.ask(op="subscribe", topic="/robot/scan")
    assert page.frames() == [] and "/robot/scan" in page.graph.listeners
    page.ask(op="call_service", service="/bad")
    assert "services_glob" in page.answer()["msg"]


@pytest.mark.parametrize("text", ["/a", "[/a", "nonsense]"])
def test_globs_need_brackets(text):
    with pytest.raises(BridgeError, match="brackets"):
        Globs(text, "topics_glob")


def test_a_service_is_called_with_and_without_success():
    page = Page()
    page.ask(op="call_service", service="/a", args={"data": True}, id="1")
    assert json.loads(page.wait_for_answer()) == {
        "op": "service_response", "service": "/a", "id": "1", "result": True,
        "values": {"success": True, "message": "{'data': True}"}}
    page.ask(op="call_service", service="/a", id="2", compression="cbor")
    assert cbor2.loads(page.wait_for_answer())["values"]["success"] is True
    page.ask(op="set_level", level="none")
    page.ask(op="call_service", service="/bad", id="3")
    assert json.loads(page.wait_for_answer()) == {
        "op": "service_response", "service": "/bad", "id": "3", "result": False, "values": "it failed"}


def test_calls_that_hang_are_bounded():
    page = Page()
    page.graph.release.clear()
    for number in range(sessions.MOST_CALLS + 1):
        page.ask(op="call_service", service="/a", id=str(number))
    assert "being called already" in json.loads(page.wait_for_answer())["values"]
    page.graph.release.set()
    assert json.loads(page.wait_for_answer())["result"] is True


def test_a_client_serves_and_its_end_fails_open_calls():
    page, got = Page(), []

    def call():
        try:
            got.append(page.graph.served["/s"]({"data": 1}))
        except BridgeError as error:
            got.append(str(error))

    page.ask(op="advertise_service", service="/s", type="std_srvs/SetBool")
    for closing in (False, True):
        thread = threading.Thread(target=call)
        thread.start()
        asked = json.loads(page.wait_for_answer())
        assert asked["op"] == "call_service" and asked["args"] == {"data": 1}
        if closing:
            page.session.close()
        else:
            page.ask(op="service_response", service="/s", id=asked["id"], values={"success": True}, result=True)
        thread.join(30.0)
    assert got == [{"success": True}, "the client that serves /s has left"] and page.graph.served == {}
