# SPDX-License-Identifier: BSD-3-Clause
"""Windows of messages are encoded once for all pages, in viser's format."""
import msgspec
import numpy as np
import viser._messages
import zstandard

from m2wr_live.web.windows import _KEPT, _LARGEST, Encoder


def moved(name, points):
    return viser._messages.SceneNodeUpdateMessage(name, {"points": np.asarray(points, dtype=np.float32)})


def decoded(data):
    """Return the messages of a window, and its arrays as bytes."""
    sizes = [int.from_bytes(data[begin:begin + 8], "little") for begin in (0, 8)]
    text = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16:16 + sizes[1]]))
    place, arrays = 16 + sizes[1], []
    for size in text["binaryBufferLengths"]:
        place += -place % 8
        arrays.append(data[place:place + size])
        place += size
    assert place == len(data)
    return text["messages"], arrays


def test_a_window_is_encoded_once_for_all_pages():
    encoder, window = Encoder(), [moved("/a", [1, 2, 3]), moved("/b", [4, 5, 6])]
    first = encoder.encode(window, 0.0)
    assert all(encoder.encode(list(window), 1.0) is first for _ in range(10))
    assert encoder.encoded == 1


def test_a_page_reads_names_and_arrays():
    messages, arrays = decoded(Encoder().encode([moved("/a", [1, 2, 3]), moved("/b", [4, 5])], 0.0))
    assert [message["name"] for message in messages] == ["/a", "/b"]
    assert [np.frombuffer(array, dtype="<f4").tolist() for array in arrays] == [[1, 2, 3], [4, 5]]
    assert messages[1]["updates"]["points"] == {"__binary_index": 1, "dtype": "<f4"}


def test_other_messages_are_never_taken_for_known_ones():
    encoder = Encoder()
    for number in range(20 * _KEPT):            # each window is let go of; the next messages may get its address
        messages, arrays = decoded(encoder.encode([moved("/n", [number])], 0.0))
        assert np.frombuffer(arrays[0], dtype="<f4").tolist() == [number]
    assert len(encoder._known) == _KEPT


def test_large_windows_are_not_kept():
    encoder = Encoder()
    encoder.encode([moved("/a", np.zeros(_LARGEST))], 0.0)
    assert not encoder._known
