# SPDX-License-Identifier: BSD-3-Clause
"""Keeps what was read from files, for all simulations of a process; the records are immutable.

A record is used again while each file that it was read from has the same time of change and size, and while no file
has appeared where one was looked for.  A call with other environment variables, or from another working
directory, gets a record of its own.
"""
from __future__ import annotations

import os
import threading
from collections import OrderedDict
from typing import Callable, Dict, Generic, Hashable, Tuple, TypeVar

from m2wr_sim.model.source_files import Stamp, noted_files, unchanged

_Record = TypeVar("_Record")


class Shared(Generic[_Record]):
    """Records by key; the ones used longest ago are dropped.

    Parameters
    ----------
    weigh : callable
        Returns the weight of a record.
    heaviest : int
        Greatest weight of all records together.
    most : int
        Greatest number of records.
    """

    def __init__(self, weigh: Callable[[_Record], int], heaviest: int, most: int = 256) -> None:
        self._weigh, self._heaviest, self._most = weigh, heaviest, most
        self._records: OrderedDict[Hashable, Tuple[_Record, Dict[str, Stamp], int]] = OrderedDict()
        self._weight = 0
        self._lock = threading.Lock()

    def get(self, key: Hashable, read: Callable[[], _Record]) -> _Record:
        """Return the record of a key, read again if a file has changed.

        Parameters
        ----------
        key : hashable
            What is read: a text or path, and all other arguments.
        read : callable
            Reads it; its errors are not kept.

        Returns
        -------
        record
        """
        key = key, _place()
        with self._lock:
            known = self._records.get(key)
        if known is not None and unchanged(known[1]):
            with self._lock:
                if key in self._records:
                    self._records.move_to_end(key)
            return known[0]
        with noted_files() as stamps:
            record = read()
        self._keep(key, record, stamps)
        return record

    def _keep(self, key: Hashable, record: _Record, stamps: Dict[str, Stamp]) -> None:
        weight = self._weigh(record)
        with self._lock:
            if key in self._records:
                self._weight -= self._records.pop(key)[2]
            self._records[key] = record, stamps, weight
            self._weight += weight
            while self._records and (self._weight > self._heaviest or len(self._records) > self._most):
                self._weight -= self._records.popitem(last=False)[1][2]

    def clear(self) -> None:
        """Drop all records."""
        with self._lock:
            self._records.clear()
            self._weight = 0

    def __len__(self) -> int:
        return len(self._records)


def _place() -> Hashable:
    """Return what paths and searches depend on besides files: environment variables and working directory."""
    try:
        folder = os.getcwd()
    except OSError:                             # it was deleted
        folder = ""
    return folder, frozenset(os.environ.items())
