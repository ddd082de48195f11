# SPDX-License-Identifier: BSD-3-Clause
"""The replay command on bags that are cut off or damaged, and on files that are no bags."""
import struct

import numpy as np
import pytest
from sensor_msgs.msg import LaserScan

from m2wr_gmapping.replay import replay_command as command
from m2wr_gmapping.replay.bag_messages import BagError, BagFile
from replay_bag import run, write_bag

pytestmark = pytest.mark.usefixtures("no_master")


@pytest.mark.parametrize("share", [0.5, 0.77, 0.95])
def test_truncated_bag_is_read_up_to_its_end(tmp_path, ring, laser, share, caplog):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    whole = (tmp_path / "drive.bag").read_bytes()
    (tmp_path / "drive.bag").write_bytes(whole[:int(share * len(whole))])
    code, stats = run(tmp_path)
    assert code == 0 and 0 < stats["scans"] <= len(truth)
    assert "broken at byte" in caplog.text


def stamps_of(path, topic="/scan"):
    with BagFile(str(path)) as bag:
        return [LaserScan().deserialize(message.data).header.stamp.to_sec() for message in bag.messages(
            lambda name: name == topic)], bag.damage


def test_truncated_chunk_is_read_up_to_its_end(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    whole, _ = stamps_of(tmp_path / "drive.bag")
    content = (tmp_path / "drive.bag").read_bytes()
    last, ends = 0, np.linspace(5000, len(content), 40).astype(int)
    for end in ends:
        (tmp_path / "cut.bag").write_bytes(content[:end])
        found, damage = stamps_of(tmp_path / "cut.bag")
        assert found == whole[:len(found)] and len(found) >= last and (damage is None) == (end == ends[-1])
        last = len(found)
        assert found or end < 20000         # not only whole chunks, of 20000 bytes
    assert last == len(whole)


def test_damaged_chunk_does_not_affect_later_chunks(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    whole, _ = stamps_of(tmp_path / "drive.bag")
    content = bytearray((tmp_path / "drive.bag").read_bytes())
    content[42000:42400] = bytes(400)
    (tmp_path / "hole.bag").write_bytes(bytes(content))
    found, damage = stamps_of(tmp_path / "hole.bag")
    assert "broken at byte" in damage and found[0] == whole[0] and found[-1] == whole[-1]
    assert set(found) < set(whole) and len(found) > len(whole) - 30


def test_a_record_with_an_empty_kind_is_damage(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    content = (tmp_path / "drive.bag").read_bytes()
    fields = b"\x03\x00\x00\x00op="              # op without a value
    record = struct.pack("<I", len(fields)) + fields + struct.pack("<I", 0)
    (tmp_path / "odd.bag").write_bytes(content[:13] + record + content[13:])
    found, damage = stamps_of(tmp_path / "odd.bag")
    assert "broken at byte 13" in damage and found


def test_random_bytes_never_raise(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    whole = bytearray((tmp_path / "drive.bag").read_bytes())
    rng = np.random.default_rng(0)
    for _ in range(40):
        broken = bytearray(whole)
        for at in rng.integers(13, len(whole), 5):
            broken[at] = int(rng.integers(256))
        (tmp_path / "broken.bag").write_bytes(bytes(broken))
        with BagFile(str(tmp_path / "broken.bag")) as bag:
            for _ in bag.messages(lambda topic: True):
                pass


def test_non_bag_and_empty_bag_have_different_errors(tmp_path):
    with pytest.raises(BagError, match="No such file"):
        BagFile(str(tmp_path / "none.bag"))
    (tmp_path / "text.bag").write_text("not a bag")
    with pytest.raises(BagError, match="expected a ROS 1 bag"):
        BagFile(str(tmp_path / "text.bag"))
    assert command.main(["--bag_filename", str(tmp_path / "text.bag")]) == command.USAGE
