# SPDX-License-Identifier: BSD-3-Clause
"""Bags as MCAP files and back, without loss; files that are damaged, cut or not of ROS 1."""
import io
import os
import struct

import lz4.frame
import pytest
import rosbag
import rospy
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from m2wr_tools.runs import mcap_files
from m2wr_tools.runs.convert_recording import main
from m2wr_tools.runs.mcap_files import bag_to_mcap, mcap_to_bag
from m2wr_view.errors import ViewError


@pytest.fixture
def bag(tmp_path):
    path = str(tmp_path / "run.bag")
    with rosbag.Bag(path, "w", compression="lz4") as made:
        for number in range(50):
            time = rospy.Time(100 + number, 7)
            made.write("/scan", LaserScan(ranges=[float(number)] * 100), time)
            made.write("/text", String("text %d" % number), time, connection_header={
                "topic": "/text", "type": "std_msgs/String", "md5sum": String._md5sum, "callerid": "/me",
                "message_definition": String._full_text, "latching": "1"})
    return path


def content(path):
    with rosbag.Bag(path) as opened:
        return [(topic, raw[0], raw[1], raw[2], time.to_nsec(), header.get("callerid"), header.get("latching"))
                for topic, raw, time, header in opened.read_messages(raw=True, return_connection_header=True)]


def text(value):
    return value.decode() if isinstance(value, bytes) else value


def plain(path):
    return [tuple(text(part) if index > 2 else part for index, part in enumerate(row)) for row in content(path)]


def test_a_bag_survives_the_way_there_and_back(bag, tmp_path):
    mcap, back = str(tmp_path / "run.mcap"), str(tmp_path / "back.bag")
    assert bag_to_mcap(bag, mcap) == (100, 2) and mcap_to_bag(mcap, back) == (100, 2)
    assert sorted(plain(back), key=str) == sorted(plain(bag), key=str)


def test_readers_find_types_times_and_messages(bag, tmp_path):
    path = str(tmp_path / "run.mcap")
    bag_to_mcap(bag, path)
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros1" and summary.statistics.message_count == 100
        schema, channel, message = next(iter(reader.iter_messages(topics=["/scan"])))
    assert (schema.name, schema.encoding, channel.message_encoding) == ("sensor_msgs/LaserScan", "ros1msg", "ros1")
    assert schema.data.decode() == LaserScan._full_text and channel.metadata["md5sum"] == LaserScan._md5sum
    assert message.log_time == 100 * 10**9 + 7 and LaserScan().deserialize(message.data).ranges == (0.0,) * 100


def write_mcap(path, encoding="ros1", compression=CompressionType.ZSTD, metadata=None, chunked=True):
    with open(path, "wb") as stream:
        writer = Writer(stream, compression=compression, use_chunking=chunked)
        writer.start("ros1")
        schema = writer.register_schema("std_msgs/String", "ros1msg", b"string data\n")
        for topic in ("/a", "/a", "/b"):
            channel = writer.register_channel(topic, encoding, schema, metadata or {})
            message = io.BytesIO()
            String("x").serialize(message)
            writer.add_message(channel, 5, message.getvalue(), 5)
        writer.finish()


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_other_programs_are_read(tmp_path, compression, chunked):
    path, target = str(tmp_path / "a.mcap"), str(tmp_path / "a.bag")
    write_mcap(path, compression=compression, chunked=chunked)
    assert mcap_to_bag(path, target) == (3, 2)
    with rosbag.Bag(target) as opened:
        assert [(topic, message.data) for topic, message, _ in opened.read_messages()] == [
            ("/a", "x"), ("/a", "x"), ("/b", "x")]
    assert {row[3] for row in plain(target)} == {String._md5sum}    # it was calculated


@pytest.mark.parametrize("keep", [0, 5, 8, 30, 300, 0.3, 0.6, 0.9, 0.999])
def test_a_cut_file_is_refused_and_leaves_nothing(bag, tmp_path, keep):
    whole = str(tmp_path / "run.mcap")
    bag_to_mcap(bag, whole)
    for source, convert, name in ((whole, mcap_to_bag, "cut.mcap"), (bag, bag_to_mcap, "cut.bag")):
        with open(source, "rb") as stream:
            data = stream.read()
        cut, target = str(tmp_path / name), str(tmp_path / (name + ".out"))
        with open(cut, "wb") as stream:
            stream.write(data[:int(keep if keep > 1 else keep * len(data))])
        with pytest.raises(ViewError, match="cut"):
            convert(cut, target)
        assert not [left for left in os.listdir(str(tmp_path)) if ".out" in left]


def test_damaged_bytes_raise_nothing_else(bag, tmp_path):
    whole = str(tmp_path / "run.mcap")
    bag_to_mcap(bag, whole)
    for source, convert in ((whole, mcap_to_bag), (bag, bag_to_mcap)):
        with open(source, "rb") as stream:
            data = bytearray(stream.read())
        for place in range(0, len(data), max(1, len(data) // 150)):
            damaged = str(tmp_path / "damaged")
            with open(damaged, "wb") as stream:
                stream.write(data[:place] + bytes([data[place] ^ 0xff]) + data[place + 1:])
            target = str(tmp_path / "target")
            try:
                convert(damaged, target)
                os.remove(target)
            except ViewError as error:
                assert "damaged" in str(error)
            assert not os.path.exists(target + ".part")


def test_other_encodings_are_refused_with_the_topic(tmp_path):
    path = str(tmp_path / "a.mcap")
    write_mcap(path, encoding="cdr")
    with pytest.raises(ViewError, match="topic /a is encoded as 'cdr'"):
        mcap_to_bag(path, str(tmp_path / "a.bag"))


@pytest.mark.parametrize("stated", [100, 1 << 40])
def test_a_chunk_beyond_its_size_is_refused(tmp_path, stated):
    data = lz4.frame.compress(bytes(50_000_000))
    body = struct.pack("<QQQII", 0, 0, stated, 0, 3) + b"lz4" + struct.pack("<Q", len(data)) + data
    path = str(tmp_path / "bomb.mcap")
    with open(path, "wb") as stream:
        stream.write(b"\x89MCAP0\r\n" + struct.pack("<BQII", 1, 8, 0, 0) + struct.pack("<BQ", 6, len(body)) + body)
    with pytest.raises(ViewError, match="chunk"):
        mcap_to_bag(path, str(tmp_path / "a.bag"))


def test_a_huge_record_is_refused_before_it_is_read(tmp_path):
    path = str(tmp_path / "huge.mcap")
    with open(path, "wb") as stream:
        stream.write(b"\x89MCAP0\r\n" + struct.pack("<BQ", 5, mcap_files.LARGEST + 1))
    with pytest.raises(ViewError, match="huge"):
        mcap_to_bag(path, str(tmp_path / "a.bag"))


def test_an_existing_file_is_kept(bag, tmp_path):
    target = tmp_path / "run.mcap"
    target.write_text("mine")
    with pytest.raises(ViewError, match="exists"):
        bag_to_mcap(bag, str(target))
    assert target.read_text() == "mine"


def test_the_command_converts_by_the_ending(bag, tmp_path, capsys):
    assert main([bag]) == 0 and "100 messages on 2 topics" in capsys.readouterr().out
    os.remove(bag)
    assert main([str(tmp_path / "run.mcap")]) == 0 and os.path.exists(bag)
    assert main([bag, str(tmp_path / "nowhere" / "a.mcap")]) == 1
    assert "nowhere" in capsys.readouterr().err
    assert main([str(tmp_path / "none.bag")]) == 1
    for words in (["a.txt"], ["a.bag", "b.bag"]):
        with pytest.raises(SystemExit) as caught:
            main(words)
        assert caught.value.code == 2
