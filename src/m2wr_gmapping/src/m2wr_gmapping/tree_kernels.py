"""Keeping the trajectory tree free of branches that no particle descends from."""
from numba import njit


@njit(cache=True, nogil=True, error_model='numpy')
def release(leaf, parent, children, free, counters):
    """Delete ``leaf`` if nothing hangs on it, and its ancestors that are then childless; their places become free."""
    node = leaf
    while node >= 0 and children[node] == 0:
        above = parent[node]
        free[counters[0]] = node
        counters[0] += 1
        if above >= 0:
            children[above] -= 1
        node = above


@njit(cache=True, nogil=True, error_model='numpy')
def lineage(leaf, parent, out):
    """Write the nodes from ``leaf`` up to its root into ``out``; return how many."""
    count, node = 0, leaf
    while node >= 0:
        out[count] = node
        count += 1
        node = parent[node]
    return count
