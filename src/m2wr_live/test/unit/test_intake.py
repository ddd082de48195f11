# SPDX-License-Identifier: BSD-3-Clause
"""What pages send to viser: only what they need is read, at a bounded rate."""
import asyncio
import logging
import math
import threading
import time

import msgspec
import pytest
import zstandard
from websockets.sync.client import connect

from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.web.intake import _BURST, LONGEST, Pace, Refused, check, take_messages
from m2wr_live.web.layers import LAYERS, add_layers
from m2wr_live.web.pages import Pages
from m2wr_live.web.server import PageServer
from m2wr_node.listening import free_port
from m2wr_node.web_access import Access

CAMERA = dict(type="ViewerCameraMessage", wxyz=[1, 0, 0, 0], position=[0, 0, 5], fov=1.0, near=0.1, far=100.0,
              image_height=700, image_width=900, look_at=[0, 0, 0], up_direction=[0, 0, 1])
GIZMO = dict(type="TransformControlsUpdateMessage", name="/gizmo", wxyz=[1, 0, 0, 0], position=[0, 0, 0], owner="1")


def update(**updates):
    return dict(type="GuiUpdateMessage", uuid="a", updates=updates)


@pytest.mark.parametrize("message", [CAMERA, GIZMO, update(value=True), update(value=1.5), update(value="a" * LONGEST)])
def test_what_pages_need_is_read(message):
    assert check(message)


@pytest.mark.parametrize("message, words", [
    (7, "type None"), ({}, "type None"), ({"type": ["a"]}, "['a']"), ({"type": "RunJavascriptMessage"}, "Javascript"),
    ({"type": "FileTransferStartUpload"}, "Upload"), ({"type": "FileTransferPart"}, "Part"),
    ({"type": "ShareUrlRequest"}, "Share"), (update(visible=False), "visible"), (update(update_cb=[]), "update_cb"),
    (update(value=1, order=1), "order"), (update(value="a" * (LONGEST + 1)), "1000"), (update(value=math.nan), "nan"),
    (update(value={"a": 1}), "{'a': 1}"), (update(value=[1.0, 2.0]), "[1.0"), (dict(update(value=1), uuid=[]), "uuid"),
    (dict(CAMERA, position=[0, math.inf, 0]), "position"), (dict(CAMERA, look_at=[0, 0]), "look_at"),
    (dict(GIZMO, position=[math.nan, 0, 0]), "position"), (dict(GIZMO, wxyz=["1", 0, 0, 0]), "wxyz"),
    (dict(GIZMO, name=None), "name")])
def test_all_else_is_refused_with_why(message, words):
    with pytest.raises(Refused, match="expected") as caught:
        check(message)
    assert words in str(caught.value)


def test_some_messages_of_real_pages_are_ignored():
    assert not check({"type": "FileTransferPartAck"})


def test_a_page_that_floods_is_read_slowly():
    pace = Pace(0.0)
    burst = [pace.wait(10.0) for _ in range(_BURST - 1)]
    assert burst == [0.0] * (_BURST - 1)
    flood = [pace.wait(10.0) for _ in range(1000)]
    assert flood[-1] == pytest.approx(1000 / 200.0, abs=0.01)
    assert pace.wait(1000.0) == 0.0


class Script:
    """A connection that gets these messages, and is closed then."""

    def __init__(self, *messages):
        self._messages = list(messages)

    async def recv(self):
        if not self._messages:
            raise ConnectionError
        return self._messages.pop(0)


class Kinds:
    """Stands for viser's class of messages."""

    @staticmethod
    def deserialize(data):
        return msgspec.msgpack.decode(data)["type"]


def test_a_refused_message_is_logged_once(caplog):
    handled = []
    odd, good = msgspec.msgpack.encode({"type": "ShareUrlRequest"}), msgspec.msgpack.encode(CAMERA)
    logger = logging.getLogger("m2wr_live")
    with caplog.at_level("WARNING"):
        logger.addHandler(caplog.handler)
        try:
            with pytest.raises(ConnectionError):
                asyncio.run(take_messages(Script(odd, odd, b"\xc1", "text", good), handled.append, Kinds))
        finally:
            logger.removeHandler(caplog.handler)
    assert handled == ["ViewerCameraMessage"]
    assert sum("ShareUrlRequest" in record.getMessage() for record in set(caplog.records)) == 1


@pytest.fixture
def server(tmp_path):
    made = PageServer("127.0.0.1", free_port("127.0.0.1", 0), Access("", "c"), str(tmp_path))
    made.viser.on_client_connect(add_layers)
    yield made
    made.stop()


class RawPage:
    """Speaks viser's protocol; keeps what it gets."""

    def __init__(self, server):
        self._socket = connect("ws://localhost:%d/" % server.viser.get_port(), subprotocols=["viser-v1.1.1"],
                               max_size=None)
        self.got = []
        threading.Thread(target=self._read, daemon=True).start()
        self.send(**CAMERA)

    def _read(self):
        for data in self._socket:
            size = int.from_bytes(data[8:16], "little")
            text = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16:16 + size]))
            self.got += text["messages"]

    def send(self, **fields):
        self._socket.send(msgspec.msgpack.encode(fields))

    def wait(self, condition, what):
        deadline = time.monotonic() + 30.0
        while True:
            found = next((message for message in list(self.got) if condition(message)), None)
            if found:
                return found
            assert time.monotonic() < deadline, "waited for " + what
            time.sleep(0.01)

    def switch(self, label):
        return self.wait(lambda message: message["type"] == "GuiCheckboxMessage" and message["props"][
            "label"] == label, "the switch " + label)["uuid"]

    def hidden(self):
        return {message["name"] for message in list(self.got) if message["type"] == "SetSceneNodeVisibilityMessage"
                and not message["visible"]}

    def close(self):
        self._socket.close()


def test_a_layer_is_hidden_on_the_page_that_asks_only(server):
    one, other = RawPage(server), RawPage(server)
    uuid = one.switch("Laser beams")
    other.switch("Laser beams")
    one.send(**dict(update(value=False), uuid=uuid))
    one.wait(lambda _: "/beams" in one.hidden(), "hidden beams")
    server.viser.scene.add_frame("/after", show_axes=False)
    other.wait(lambda message: message.get("name") == "/after", "what is drawn later")
    assert "/beams" not in other.hidden()
    one.close()
    other.close()


def test_an_upload_is_not_kept(server):
    page = RawPage(server)
    uuid = page.switch("Maps")
    page.send(type="FileTransferStartUpload", source_component_uuid=uuid, transfer_uuid="t", filename="a",
              mime_type="a", part_count=1000, size_bytes=1)
    page.send(type="FileTransferPart", source_component_uuid=uuid, transfer_uuid="t", part_index=0, content=b"a" * 9)
    page.send(**dict(update(value=False), uuid=uuid))
    page.wait(lambda _: "/maps" in page.hidden(), "the answer to a later message")
    states = [server.viser.gui._current_file_upload_states] + [
        client.gui._current_file_upload_states for client in server.viser.get_clients().values()]
    assert len(states) == 2 and not any(states)
    page.close()


def test_an_audience_changes_its_own_page_only(tmp_path):
    server = PageServer("127.0.0.1", free_port("127.0.0.1", 0), Access("", "c"), str(tmp_path))
    try:
        Pages(server, LiveScene(), None)
        page = RawPage(server)
        page.switch(LAYERS[-1][0])              # the last control of a panel
        client, = server.viser.get_clients().values()
        controls = [control.label for control in client.gui._gui_input_handle_from_uuid.values()]
        assert sorted(controls) == sorted(["View", "Robot"] + [label for label, _ in LAYERS])
        assert not server.viser.gui._gui_input_handle_from_uuid
        assert not client.scene._scene_pointer_cb and not server.viser.scene._scene_pointer_cb
        page.close()
    finally:
        server.stop()
