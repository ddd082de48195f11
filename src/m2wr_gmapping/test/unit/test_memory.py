"""What a map took is given back when it is dropped."""
import os
import subprocess
import sys
import threading
import weakref

import numpy as np
import rospy

from m2wr_gmapping.occupancy import Grid
from m2wr_gmapping.ros import outputs
from m2wr_gmapping.ros.outputs import MapOutput

# Each thread has a heap of its own. In the last one that is taken stands what stays, as what lies there by chance does.
HOLES = """
import os, threading
import numpy as np
from m2wr_gmapping.ros.memory import give_back

kept = []

def resident():
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2.0 ** 20

def fill():
    pieces = [np.ones(4096) for _ in range(1000)]           # 32 kB each
    kept.append(np.ones(4096))

def leave():
    threads = [threading.Thread(target=fill) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

before = resident()
leave()
left = resident()
told = give_back()
print(before, left, resident(), told)
"""

HEAPS = """
import ctypes
import threading
from m2wr_gmapping.ros.memory import use_one_heap

if {wanted}:
    assert use_one_heap()
import numpy
thread = threading.Thread(target=lambda: numpy.ones(4096))
thread.start()
thread.join()
ctypes.CDLL(None).malloc_stats()
"""


def heaps(wanted):
    """Return how many heaps a program with two threads ends with."""
    said = subprocess.run([sys.executable, "-c", HEAPS.format(wanted=wanted)], stderr=subprocess.PIPE, timeout=120,
                          check=True).stderr.decode()
    return sum(line.startswith("Arena ") for line in said.splitlines())


def test_all_threads_share_one_heap():
    assert heaps(False) > 1, "the C library has one heap anyway: the test tests nothing"
    assert heaps(True) == 1


READS = """
import ctypes
from m2wr_gmapping.ros.memory import use_one_heap

if {wanted}:
    assert use_one_heap()
mallinfo = ctypes.CDLL(None).mallinfo
mallinfo.restype = type("Info", (ctypes.Structure,), dict(_fields_=[(letter, ctypes.c_int) for letter in "abcdefghij"]))
large = bytearray(20 << 20)
del large
before = mallinfo().e
read = bytearray(4 << 20)
print(mallinfo().e - before)
"""


def mapped(wanted):
    """Return how many bytes of a piece of 4 MB are mapped by themselves after a piece of 20 MB has been freed."""
    return int(subprocess.check_output([sys.executable, "-c", READS.format(wanted=wanted)], timeout=120))


def test_what_a_subscriber_reads_into_stays_outside_the_heap():
    assert mapped(False) == 0, "the C library maps it anyway: the test tests nothing"
    assert mapped(True) >= 4 << 20


def test_the_node_takes_one_heap_before_numpy_begins_threads():
    program = os.path.join(os.path.dirname(__file__), "..", "..", "nodes", "slam_gmapping")
    with open(program, encoding="utf-8") as stream:
        text = stream.read()
    assert text.index("\nuse_one_heap()") < text.index("m2wr_gmapping.ros.node")
    script = "import sys, m2wr_view.interrupts; import m2wr_gmapping.ros.memory; assert 'numpy' not in sys.modules"
    subprocess.check_call([sys.executable, "-c", script], timeout=120)


def test_holes_in_the_heaps_of_threads_are_given_back():
    said = subprocess.check_output([sys.executable, "-c", HOLES], env=dict(os.environ), timeout=120).decode().split()
    before, left, after = (float(number) for number in said[:3])
    assert left - before > 20.0, "the C library keeps nothing of this: the test tests nothing"
    assert after - before < 0.1 * (left - before) and said[3] == "True"


class Outlet:
    """In the place of publishers and services."""

    def __init__(self, *_, **__):
        pass

    def publish(self, _):
        pass


class OneMapMapper:
    """A mapper with one scan."""

    entropy, given, stamps = 0.0, 0, [1.0]

    @staticmethod
    def map_request():
        return np.zeros((1, 3)), []

    @staticmethod
    def map_of(_, __):
        return Grid(np.zeros((32, 32), np.int8), 0.05, np.zeros(2))

    @staticmethod
    def base_poses(poses):
        return poses


def test_who_makes_maps_holds_no_mapper_that_was_dropped(monkeypatch):
    for name in ("Publisher", "Service"):
        monkeypatch.setattr(rospy, name, Outlet)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1))
    output, mapper = MapOutput("map"), OneMapMapper()
    gone = threading.Event()
    weakref.finalize(mapper, gone.set)
    output.ask(mapper)
    del mapper
    try:
        assert gone.wait(60.0)
        assert output.made == 1
    finally:
        output.close()


def test_free_memory_is_given_back_after_a_map_and_not_after_each_of_many(monkeypatch):
    for name in ("Publisher", "Service"):
        monkeypatch.setattr(rospy, name, Outlet)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1))
    held, given = [], threading.Semaphore(0)
    made = threading.Semaphore(0)

    class Many(OneMapMapper):
        @staticmethod
        def base_poses(poses):
            made.release()
            return poses
    output, mapper = MapOutput("map"), Many()
    still = weakref.ref(mapper)

    def note():
        held.append(still() is not None)
        given.release()
    monkeypatch.setattr(outputs, "give_back", note)
    monkeypatch.setattr(outputs.time, "monotonic", lambda: 100.0)
    try:
        output.ask(mapper)
        del mapper
        assert given.acquire(timeout=60.0) and held == [False], "the mapper was still held"
        for _ in range(5):
            output.ask(Many())
            assert made.acquire(timeout=60.0)
    finally:
        output.close()
    assert held == [False]
