"""How much memory the mapper's process keeps: no more than the map that is there takes.

A map is thousands of small arrays among a few large ones. glibc gives each thread a heap of its own (at most eight
times as many as there are cores), keeps what is freed unless it lies at a heap's end, and no heap fills another one's
holes: after some maps each heap is as large as its fullest moment, although no object is left. One heap, and giving
back what is free now and then, keep the process at what it uses.
"""
import ctypes

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8        # of glibc's mallopt
# glibc raises the size from which a piece is mapped by itself to that of the largest one freed so far. Then the 4 MB
# that a subscriber asks for with each read, of which it fills some kilobytes, come from pages of the heap that were
# filled before. So the size stays at half of that; and what is free at the heap's end stays until ``give_back``.
_LARGEST_IN_HEAP, _KEPT_FREE = 2 << 20, 8 << 20         # bytes


def use_one_heap():
    """Let all threads share one heap; to be called before numpy, whose threads begin with the import, is there.

    Where Python runs one thread at a time, and kernels allocate next to nothing, none waits for another one's heap.
    Pieces of more than 2 MB are outside, and go back to the system when they are freed.

    Returns
    -------
    bool
        Whether the C library takes it; glibc does.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
        return all([mallopt(_M_ARENA_MAX, 1), mallopt(_M_MMAP_THRESHOLD, _LARGEST_IN_HEAP),
                    mallopt(_M_TRIM_THRESHOLD, _KEPT_FREE)])
    except (AttributeError, OSError):
        return False


def give_back():
    """Give the system all whole pages of the heap that are free.

    Returns
    -------
    bool
        Whether there were some; False as well where the C library has no ``malloc_trim``.
    """
    try:
        return bool(ctypes.CDLL(None).malloc_trim(0))
    except (AttributeError, OSError):
        return False
