# SPDX-License-Identifier: BSD-3-Clause
"""Keeping the state of the run on disk, so that a node that was killed and is started again goes on where it was.

This is not ``~state_file``, which the user names and which lasts: what is kept here belongs to one roslaunch and is
removed when the node ends well.
"""
import os
import sys
import threading
import time

import rospy

from m2wr_gmapping.io import state
from m2wr_node.user_folder import starter

RUN = "run"             # what a state of this module says in addition: to which run it belongs


class StateAutosave:
    """Writes snapshots on a thread of its own, one at a time.

    Parameters
    ----------
    path : str
        The file; empty: nothing is kept.
    run : str
        What tells the run from others.
    period : float
        Between two snapshots [s], wall; 0: nothing is kept.
    """

    def __init__(self, path, run, period):
        self.path, self._run, self._period = path if period > 0.0 else "", run, period
        self._next = time.monotonic() + period
        self._writer, self._told = None, None

    def due(self):
        """Whether a snapshot is to be taken now: the period is over, and the one before is written."""
        return bool(self.path) and time.monotonic() >= self._next and (
            self._writer is None or not self._writer.is_alive())

    def keep(self, mapper, host):
        """Take a snapshot of a mapper that nobody changes meanwhile, and write it beside; ``host`` as in ``state``."""
        try:
            taken = state.snapshot(mapper, dict(host, **{RUN: self._run}))
        except state.StateError as error:
            self._tell("the state cannot be kept: %s" % error)
            return
        finally:
            self._next = time.monotonic() + self._period
        self._writer = threading.Thread(target=self._write, args=(taken,), name="keeper", daemon=True)
        self._writer.start()

    def _write(self, taken):
        try:
            state.save(self.path, taken)
        except state.StateError as error:
            self._tell("%s: killed now, the map would %s" % (
                error, "go on from there" if os.path.exists(self.path) else "begin anew"))
        else:
            if self._told is not None:
                rospy.loginfo("the state of the run is kept again")
            self._told = None

    def _tell(self, trouble):
        """Warn of trouble once, not with every state that it befalls."""
        if trouble != self._told:
            rospy.logwarn(trouble)
        self._told = trouble

    def resume(self, config):
        """Return the State that this run has kept, or None; what cannot be used is told and left."""
        if not self.path or not os.path.exists(self.path):
            return None
        try:
            found = state.load(self.path, config)
        except state.StateError as error:
            rospy.logwarn("the state of the run cannot be used, the map begins anew: %s", error)
            return None
        if found.host.get(RUN) != self._run:
            found.mapper.close()
            return None
        return found

    def forget(self):
        """Wait for what is being written, and remove the file."""
        if self._writer is not None:
            self._writer.join()
        if self.path:
            try:
                os.unlink(self.path)
            except OSError:
                pass            # never written


def autosave_location(words=None):
    """Return file and mark of the run that roslaunch has started this node in; two empty texts without roslaunch.

    The file lies beside the node's log. The run's id alone is no mark: it lasts as long as the master, over any number
    of launches; so the process that began this node's session is part of it.
    """
    logs = [word[len("__log:="):] for word in (sys.argv if words is None else words) if word.startswith("__log:=")]
    if not logs:
        return "", ""
    return os.path.splitext(logs[0])[0] + ".state", "%s %s" % (rospy.get_param("/run_id", ""), _launch())


def _launch():
    """Return number and start of roslaunch's process, which no other process of this machine shares."""
    parent = starter()
    try:
        with open("/proc/%d/stat" % parent, "rb") as stream:
            started = stream.read().rpartition(b")")[2].split()[19].decode()      # field 22, after name and state
        with open("/proc/sys/kernel/random/boot_id", encoding="utf-8") as stream:
            return "%d %s %s" % (parent, started, stream.read().strip())
    except (OSError, IndexError):
        return "%d" % parent
