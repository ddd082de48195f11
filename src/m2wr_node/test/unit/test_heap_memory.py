# SPDX-License-Identifier: BSD-3-Clause
"""One heap for all threads, without large arrays: what is freed is given back to the system."""
import subprocess
import sys

HEAPS = """
import ctypes
import threading
from m2wr_node.heap_memory import use_one_heap

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


LARGE = """
import os
import numpy
from m2wr_node.heap_memory import use_one_heap

def resident():
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2.0 ** 20

if {wanted}:
    assert use_one_heap()
largest = numpy.ones(1 << 21)
del largest                                              # 16 MB: the largest that was freed
before = resident()
large = [(numpy.ones(1 << 16), numpy.ones(1 << 10)) for _ in range(100)]    # 512 kB, and 8 kB after each
small = [pair[1] for pair in large]
del large
print(resident() - before)
"""


def left(wanted):
    """Return how many MB of 50 in large arrays, with small ones between, stay when the large ones are freed."""
    return float(subprocess.check_output([sys.executable, "-c", LARGE.format(wanted=wanted)], timeout=120))


def test_freed_large_arrays_leave_no_holes_in_the_heap():
    assert left(False) > 40.0, "the C library keeps nothing of this: the test tests nothing"
    assert left(True) < 5.0


def test_it_needs_no_numpy():
    script = "import sys, m2wr_node.interrupts; import m2wr_node.heap_memory; assert 'numpy' not in sys.modules"
    subprocess.check_call([sys.executable, "-c", script], timeout=120)
