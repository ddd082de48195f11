# SPDX-License-Identifier: BSD-3-Clause
"""Autosave of the run's state, so that a killed node continues after its restart.

This is not ``~state_file``, which the user names and keeps. An autosaved state belongs to one run of roslaunch and is
removed at a graceful shutdown.
"""
from __future__ import annotations

import os
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, Mapping, Optional, Sequence, Tuple

import rospy

from m2wr_gmapping.io import state
from m2wr_node.user_folder import starter

if TYPE_CHECKING:
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.mapper import Mapper

RUN = "run"             # additional key of the state: the run to which it belongs


class StateAutosave:
    """Writes snapshots in a thread, one at a time.

    Parameters
    ----------
    path : str
        The file; empty: no autosave.
    run : str
        Identifier of the run.
    period : float
        Wall time between two snapshots [s]; 0: no autosave.
    """

    def __init__(self, path: str, run: str, period: float) -> None:
        self.path, self._run, self._period = path if period > 0.0 else "", run, period
        self._next = time.monotonic() + period
        self._writer: Optional[threading.Thread] = None
        self._told: Optional[str] = None        # the last warning; None after a success

    def due(self) -> bool:
        """Return whether the period is over and the last snapshot is written."""
        return bool(self.path) and time.monotonic() >= self._next and (
            self._writer is None or not self._writer.is_alive())

    def keep(self, mapper: Mapper, host: Mapping[str, Any]) -> None:
        """Take a snapshot of a mapper, which must not change meanwhile, and write it in a thread.

        Parameters
        ----------
        mapper : Mapper
        host : dict
            As of ``state.snapshot``.
        """
        try:
            taken = state.snapshot(mapper, dict(host, **{RUN: self._run}))
        except state.StateError as error:
            self._tell("autosave failed: %s" % error)
            return
        finally:
            self._next = time.monotonic() + self._period
        self._writer = threading.Thread(target=self._write, args=(taken,), name="keeper", daemon=True)
        self._writer.start()

    def _write(self, taken: state.Snapshot) -> None:
        try:
            state.save(self.path, taken)
        except state.StateError as error:
            self._tell("%s: after a crash the map would %s" % (
                error, "continue from the older state" if os.path.exists(self.path) else "be lost"))
        else:
            if self._told is not None:
                rospy.loginfo("autosave works again")
            self._told = None

    def _tell(self, trouble: str) -> None:
        """Warn once about repeated trouble."""
        if trouble != self._told:
            rospy.logwarn(trouble)
        self._told = trouble

    def resume(self, config: GmappingConfig) -> Optional[state.State]:
        """Return the autosaved State of this run, or None; an unusable file causes a warning."""
        if not self.path or not os.path.exists(self.path):
            return None
        try:
            found = state.load(self.path, config)
        except state.StateError as error:
            rospy.logwarn("the autosaved state cannot be used, starting a new map: %s", error)
            return None
        if found.host.get(RUN) != self._run:
            found.mapper.close()
            return None
        return found

    def forget(self) -> None:
        """Wait for the writer, and remove the file."""
        if self._writer is not None:
            self._writer.join()
        if self.path:
            try:
                os.unlink(self.path)
            except OSError:
                pass            # never written


def autosave_location(words: Optional[Sequence[str]] = None) -> Tuple[str, str]:
    """Return file and identifier of the run of roslaunch; two empty strings without roslaunch.

    The file is beside the node's log. ``/run_id`` alone is not unique, since it lasts as long as the master, so the
    process of roslaunch is part of the identifier.
    """
    logs = [word[len("__log:="):] for word in (sys.argv if words is None else words) if word.startswith("__log:=")]
    if not logs:
        return "", ""
    return os.path.splitext(logs[0])[0] + ".state", "%s %s" % (rospy.get_param("/run_id", ""), _launch())


def _launch() -> str:
    """Return id and start time of roslaunch's process, which are unique on this machine."""
    parent = starter()
    try:
        with open("/proc/%d/stat" % parent, "rb") as stream:
            started = stream.read().rpartition(b")")[2].split()[19].decode()      # field 22, after name and state
        with open("/proc/sys/kernel/random/boot_id", encoding="utf-8") as stream:
            return "%d %s %s" % (parent, started, stream.read().strip())
    except (OSError, IndexError):
        return "%d" % parent
