# SPDX-License-Identifier: BSD-3-Clause
"""Threads that share the items of a computation."""
import queue
import threading

import pytest

from m2wr_node.thread_team import ThreadTeam


@pytest.mark.parametrize("threads, count", [(1, 7), (2, 7), (3, 100), (4, 1)])
def test_every_item_is_processed_once(threads, count):
    done, workers = [], ThreadTeam(threads)
    workers.run(lambda first, last: done.extend(range(first, last)), count)
    assert sorted(done) == list(range(count))
    workers.close()


def test_exception_in_a_worker_is_re_raised():
    workers, done = ThreadTeam(2), []
    with pytest.raises(ZeroDivisionError):
        workers.run(lambda first, last: 1 // 0, 50)

    def elsewhere(first, last):             # only the helper fails, and it has the time to begin
        if threading.current_thread() is not threading.main_thread():
            begun.set()
            raise ZeroDivisionError
        assert begun.wait(10.0), "no helper has begun within 10 s"

    begun = threading.Event()
    with pytest.raises(ZeroDivisionError):
        workers.run(elsewhere, 50)
    workers.run(lambda first, last: done.extend(range(first, last)), 50)
    assert sorted(done) == list(range(50))
    workers.close()


def test_threads_end_with_their_owner():
    workers = ThreadTeam(3)
    workers.run(lambda first, last: None, 50)
    helpers = list(workers._helpers)
    del workers
    for helper in helpers:
        helper.join(10.0)
        assert not helper.is_alive()


def test_busy_helper_is_not_waited_for():
    workers, done, begun, resume, left = ThreadTeam(2), [], threading.Event(), threading.Event(), queue.SimpleQueue()

    def busy():             # blocks the helper
        begun.set()
        resume.wait(20.0)

    workers._shares.put((busy, left))
    assert begun.wait(10.0), "the helper has not begun within 10 s"
    workers._shares.put((busy, left))       # of a run that was interrupted: not taken for a share of the next
    workers.run(lambda first, last: done.extend(range(first, last)), 50)
    assert sorted(done) == list(range(50)) and not resume.is_set() and workers._shares.empty()
    resume.set()
    assert left.get(timeout=10.0) is None
    workers.close()
