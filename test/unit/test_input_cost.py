# SPDX-License-Identifier: BSD-3-Clause
"""The cost of reading files and parameters grows at most linearly; src/m2wr_sim's test_behaviour_text_cost covers XML.

Cost is the number of Python calls, and the CPU time of two inputs that are read one after the other, so that a busy
machine, or one whose speed varies, changes nothing: the least ratio of several tries counts.
An input four times as long may cost 2.2 times 2.2 as much; quadratic cost would be sixteen times as much.
"""
import io
import sys
import time

import numpy as np
import pytest
import rosbag
import rospy
from PIL import Image
from sensor_msgs.msg import LaserScan

from m2wr_files import state_file
from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.replay import bag_messages
from m2wr_maps import saved_map_reader
from m2wr_sim.errors import SimError
from m2wr_sim.model.sdf.loader import load_sdf
from m2wr_sim.ros.params import read_config
from m2wr_tools.map_comparison.command import read_saved
from m2wr_tools.runs import bag_report
from m2wr_view.errors import ViewError
from motion_plan.tour import Tour, TourError

TIMES = 4               # length of the second input relative to the first
GROWTH = 2.2 ** 2       # largest growth of the cost: linear cost gives 4
FLOOR = 500             # calls independent of the length: opening, checking, refusing
LEAST = 0.02            # CPU time [s] below which a ratio is not meaningful
TRIES = 12
FORESEEN = (SimError, ViewError, TourError, ConfigError, saved_map_reader.MapReadingError, state_file.StateError,
            bag_messages.BagError)


def run(read, given):
    try:
        read(given)
    except FORESEEN:
        pass


def calls(read, given):
    """Return the number of function calls of a reader."""
    counted = [0]

    def count(_, event, __):
        if event in ("call", "c_call"):
            counted[0] += 1

    sys.setprofile(count)
    try:
        run(read, given)
    finally:
        sys.setprofile(None)
    return counted[0]


def cpu(read, given):
    """Return the CPU time of reading once [s]."""
    began = time.thread_time()
    run(read, given)
    return time.thread_time() - began


def check_growth(read, make, length):
    """Compare the cost of reading ``make(length)`` with that of an input TIMES as long."""
    short, long = make(length), make(TIMES * length)
    run(read, short)                    # excludes imports and the compilation of kernels
    few, many = calls(read, short), calls(read, long)
    assert many < GROWTH * few + FLOOR, "%d calls, and %d for %d times the length" % (few, many, TIMES)
    for _ in range(TRIES):
        one, four = cpu(read, short), cpu(read, long)
        if four < max(GROWTH * one, LEAST):
            return
    raise AssertionError("%.4f s, and %.4f s for %d times the length" % (one, four, TIMES))


def test_quadratic_cost_is_found():
    with pytest.raises(AssertionError, match=r"\d s, and"):          # C code is found by its time
        check_growth(lambda items: [item for item in items if items.count(item) > 1], lambda n: list(range(n)), 1000)
    with pytest.raises(AssertionError, match="calls"):
        check_growth(lambda n: [abs(other) for _ in range(n) for other in range(n)], lambda n: n, 50)


# ---- tours and parameters ----------------------------------------------------------------------------------------

@pytest.mark.parametrize("points", [lambda n: [[k, 1.0] for k in range(n)], lambda n: [[1.0, 2.0]] * n + ["x"],
                                    lambda n: "x" * n, lambda n: [["9" * n, 1]]],
                         ids=["good", "bad end", "text", "digits"])
def test_tours(points):
    check_growth(Tour, points, 20000)


PARAMETERS = {
    "many": lambda n: {"p%d" % k: k for k in range(n)},
    "long text": lambda n: {"engine": "x" * n, "base_frame": "x" * n, "maxUrange": "9" * n},
    "listeners": lambda n: {"lockstep_listeners": ["/a%d: /b" % k for k in range(n)]},
    "topics": lambda n: {"lockstep_listeners": ["/a: " + "/b " * n]},
    "respawned": lambda n: {"lockstep_listeners": ["/a" + " respawned" * n]},
    "controllers": lambda n: {"lockstep_controllers": ["/a%d" % k for k in range(n)]},
    "replies": lambda n: {"lockstep_replies": ["/a -> /b%d by /c" % k for k in range(n)]},
    "one reply": lambda n: {"lockstep_replies": ["/a -> /b" + " by /c" * n]},
    "conventions": lambda n: {"wheel_conventions": {"r%d" % k: "kinetic" for k in range(n)}},
}


@pytest.mark.parametrize("kind", sorted(PARAMETERS))
@pytest.mark.parametrize("read", [read_config, GmappingConfig.from_mapping], ids=["simulation", "mapper"])
def test_parameters(read, kind):
    check_growth(read, PARAMETERS[kind], 4000)


# ---- maps --------------------------------------------------------------------------------------------------------

READERS = [saved_map_reader.read_map, read_saved]
try:
    from map_pictures import files
    READERS.append(files.read_map)
    FORESEEN += (files.MapError,)
except ImportError:                     # the real map_server is installed
    pass
GOOD = "image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
TEXTS = {                               # at most 64 kB are read
    "values": lambda n: GOOD + "".join("k%d: 1\n" % k for k in range(n // 9)),
    "comments": lambda n: GOOD + "#x\n" * (n // 3), "blanks": lambda n: GOOD + "a: 1" + " " * n,
    "list": lambda n: GOOD + "a: [" + "1," * (n // 2) + "1]", "open": lambda n: "[" * n,
    "dashes": lambda n: "- " * (n // 2),
    "quotes": lambda n: GOOD + "a: '" + "''" * (n // 2), "anchors": lambda n: GOOD + "a: [" + "&a 1," * (n // 5) + "1]",
    "aliases": lambda n: GOOD + "a: &a 1\nb: [" + "*a," * (n // 3) + "1]", "keys": lambda n: "? " * (n // 2),
    "folded": lambda n: GOOD + "a: >\n" + " x\n\n" * (n // 4), "digits": lambda n: GOOD + "b: " + "9" * n,
    "colons": lambda n: GOOD + "b: " + "1:" * (n // 2), "tags": lambda n: GOOD + "b: " + "!a " * (n // 3),
    "directives": lambda n: "%A b\n" * (n // 5) + "---\n" + GOOD}


def pgm(head, rows):
    return head + bytes(((7 * k) % 256 for k in range(256))) * rows


PICTURES = {
    "pixels": lambda n: pgm(b"P5\n256 %d\n255\n" % n, n),
    "comments": lambda n: b"P5\n" + b"# x\n" * n + b"4 4\n255\n" + b"0" * 16,
    "blanks": lambda n: b"P5\n" + b" " * n + b"4 4\n255\n" + b"0" * 16,
    "text": lambda n: b"P2\n16 %d\n255\n" % (n // 8) + b"0 254 205 7 " * (n // 8 * 4),
    "cut off": lambda n: pgm(b"P5\n256 %d\n255\n" % n, n // 2)}


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__module__)
@pytest.mark.parametrize("kind", sorted(TEXTS))
def test_yaml_of_maps(tmp_path, reader, kind):
    (tmp_path / "room.pgm").write_bytes(b"P5\n4 4\n255\n" + b"0" * 16)

    def make(length):
        path = tmp_path / ("%d.yaml" % length)
        path.write_text(TEXTS[kind](length))
        return str(path)
    short = make(3000)
    run(reader, short)                  # excludes imports
    check_growth(reader, make, 3000 if cpu(reader, short) > LEAST else 12000)


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__module__)
@pytest.mark.parametrize("kind", sorted(PICTURES))
def test_pictures_of_maps(tmp_path, reader, kind):
    def make(length):
        (tmp_path / ("%d.pgm" % length)).write_bytes(PICTURES[kind](length))
        path = tmp_path / ("%d.yaml" % length)
        path.write_text(GOOD.replace("room.pgm", "%d.pgm" % length))
        return str(path)
    check_growth(reader, make, 1000)


def test_height_maps(tmp_path):
    """Twice as many samples along each side are four times as many."""
    def make(length):
        side = 2 ** (6 + length) + 1
        buffer = io.BytesIO()
        Image.fromarray(np.add.outer(np.arange(side), np.arange(side)).astype(np.uint8)).save(buffer, "PNG")
        path = tmp_path / ("%d.png" % side)
        path.write_bytes(buffer.getvalue())
        return str(path)

    def read(path):
        load_sdf("<sdf version='1.6'><model name='m'><static>1</static><link name='l'><collision name='c'><geometry>"
                 "<heightmap><uri>file://%s</uri><size>4 4 1</size></heightmap></geometry></collision></link></model>"
                 "</sdf>" % path, "a.sdf")

    check_growth(read, lambda length: make(1 if length < TIMES else 2), 1)


# ---- bags and states ---------------------------------------------------------------------------------------------

@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@pytest.mark.parametrize("whole", [True, False], ids=["whole", "cut off"])
def test_bags(tmp_path, compression, whole):
    def make(count):
        path = tmp_path / ("%d.bag" % count)
        with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=20000) as bag:
            for k in range(count):
                stamp = rospy.Time(10) + rospy.Duration(0.1 * k)
                scan = LaserScan(angle_max=1.0, angle_increment=0.1, range_max=8.0, ranges=[1.0] * 11)
                scan.header.stamp = stamp
                bag.write("/scan%d" % (k % 3), scan, stamp)
        if not whole:
            path.write_bytes(path.read_bytes()[:-path.stat().st_size // 3])
        return str(path)

    def replay(path):
        with bag_messages.BagFile(path) as bag:
            for _ in bag.messages(lambda topic: True):
                pass

    check_growth(replay, make, 200)
    check_growth(bag_report.report, make, 200)


@pytest.mark.parametrize("document, arrays", [
    (lambda n: {"a": list(range(n))}, lambda n: {}), (lambda n: {"k%d" % k: k for k in range(n)}, lambda n: {}),
    (lambda n: {"a": "\\" * n}, lambda n: {}), (lambda n: {"a": [[{}]] * n}, lambda n: {}),
    (lambda n: {}, lambda n: {"cells": np.zeros(300 * n, np.int8)})],
    ids=["list", "names", "text", "tables", "array"])
def test_states(tmp_path, document, arrays):
    kind = state_file.Format("a state", 1, "a program", "nothing")

    def make(length):
        path = str(tmp_path / ("%d.state" % length))
        state_file.write(path, kind, document(length), arrays(length))
        return path
    check_growth(lambda path: state_file.read(path, kind), make, 5000)
