# SPDX-License-Identifier: BSD-3-Clause
"""Counts of scans that are not used."""
import threading

from m2wr_maps.scan_account import DROPPED, NO_TRANSFORM, OUT_OF_ORDER, REFUSED, ScanAccount


def test_scans_are_counted_by_reason():
    account = ScanAccount()
    account.received = 10
    assert account.text() == "0 of 10 scans not used"
    assert [account.leave_out(REFUSED), account.leave_out(REFUSED, 2), account.leave_out(NO_TRANSFORM)] == [1, 3, 1]
    assert account.leave_out(OUT_OF_ORDER, 0) == 0
    assert account.unused == {NO_TRANSFORM: 1, REFUSED: 3}
    assert (account.count(*DROPPED), account.count(REFUSED), account.count()) == (1, 3, 0)
    assert account.text() == "4 of 10 scans not used (no transform: 1, refused: 3)"


def test_threads_lose_no_count():
    account = ScanAccount()

    def count():
        for _ in range(20000):
            account.leave_out(REFUSED)

    threads = [threading.Thread(target=count) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert account.unused == {REFUSED: 80000}
