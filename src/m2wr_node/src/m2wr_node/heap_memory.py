# SPDX-License-Identifier: BSD-3-Clause
"""Limits the memory of a process to what it uses at the time.

A map, for example, consists of thousands of small arrays and a few large ones. glibc creates a heap for each thread (at
most eight per core), and free space in one heap is not used by other threads. Large arrays are outside the heaps, but
only if they are larger than the largest one freed so far. So after some maps the large arrays lie between small ones,
and each heap keeps its greatest size.
"""
from __future__ import annotations

import ctypes

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8        # of glibc's mallopt
LARGEST_IN_HEAP = 256 << 10     # above the arrays of scans (20 kB), below those of maps and messages (0.5 to 4 MB)


def use_one_heap(largest: int = LARGEST_IN_HEAP) -> bool:
    """Let all threads share one heap without large arrays; call this before numpy starts threads.

    Python runs one thread at a time and kernels hardly allocate, so threads do not wait for the heap. A large array is
    returned to the system when it is freed, and it grows without a copy.

    Parameters
    ----------
    largest : int
        Size of the largest arrays in the heap [bytes].

    Returns
    -------
    bool
        Whether the C library supports it; glibc does.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
        return all([mallopt(_M_ARENA_MAX, 1), mallopt(_M_MMAP_THRESHOLD, largest)])
    except (AttributeError, OSError):
        return False
