# SPDX-License-Identifier: BSD-3-Clause
"""How much memory the mapper's process keeps: no more than the map that is there takes.

A map is thousands of small arrays among a few large ones. glibc gives each thread a heap of its own (at most eight
times as many as there are cores), and no heap fills another one's holes. Large pieces are outside the heaps, but only
those that are larger than the largest one freed so far: after some maps the large arrays lie between the small ones.
Then each heap stays as large as its fullest moment, although no object is left.
"""
import ctypes

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8        # of glibc's mallopt
LARGEST_IN_HEAP = 256 << 10     # above a scan's arrays (20 kB), below those of maps, messages and reads (0.5 to 4 MB)


def use_one_heap():
    """Let all threads share one heap, and keep what is large outside; to be called before numpy begins threads.

    Where Python runs one thread at a time, and kernels allocate next to nothing, none waits for another one's heap.
    A large piece goes back to the system when it is freed, and is taken from there page by page when it is filled.

    Returns
    -------
    bool
        Whether the C library takes it; glibc does.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
        return all([mallopt(_M_ARENA_MAX, 1), mallopt(_M_MMAP_THRESHOLD, LARGEST_IN_HEAP)])
    except (AttributeError, OSError):
        return False
