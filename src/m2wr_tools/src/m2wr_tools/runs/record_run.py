# SPDX-License-Identifier: BSD-3-Clause
"""The recorder of launch files: ``rosbag record`` with a supervisor, so a fault of the recorder never ends a run.

If the recorder cannot write its file, is killed, or the disk is full, one line reports it. The recorded part gets an
index and its final name, and the run continues.
"""
from __future__ import annotations

import argparse
import ctypes
import http.client
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import xmlrpc.client
from typing import Any, List, Optional, Sequence

import rosbag
import rosgraph
import rosgraph.names
import rospkg
import rospy

from m2wr_node.ros.is_there import PatientTransport
from m2wr_node.ros.starting import register
from m2wr_node.user_folder import from_user
from m2wr_tools.runs.bag_order import settle_times
from m2wr_view.errors import ViewError

_CHUNK_KB = 256             # written at once; at most this is lost when the recorder is killed
_SPACE_MB = 64              # free on the disk, below which it stops; its own default is 1 GB, more than most runs take
_CLOSING = 12.0             # s of wall time for the recorder to close its file; roslaunch waits for 15
_LOOK = 0.1                 # s between two looks at the recorder
_INDEX = 256 << 10          # bytes; upper limit of the message definitions in an index
#: Topics that ``--all`` leaves out: duplicates, and the states of all links and models at 100 Hz. The states of robots
#: are in /gazebo/robot_states.
NOT_OF_ALL = "^(/rosout_agg|/gazebo/(link_states|model_states|parameter_.*)|.*/parameter_(descriptions|updates))$"
_SET_DEATH_SIGNAL = 1       # of prctl(2)


class RecordError(Exception):
    """The recording cannot begin, or has ended early; one sentence for the user."""


def find_recorder() -> str:
    """Return the path of rosbag's recorder; RecordError if there is none."""
    for folder in ("/usr/lib/rosbag", "/opt/ros/noetic/lib/rosbag"):
        if os.access(os.path.join(folder, "record"), os.X_OK):
            return os.path.join(folder, "record")
    try:
        import roslib.packages
        found = roslib.packages.find_node("rosbag", "record")
    except (ImportError, OSError, rospkg.ResourceNotFound):
        found = []
    if not found:
        raise RecordError("there is no recorder; expected rosbag's: sudo apt install rosbag")
    return found[0]


def check_place(path: str) -> None:
    """Raise RecordError if a file cannot be made at a path."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise RecordError("there is no folder %s" % folder)
    if os.path.isdir(path):
        raise RecordError("%s is a folder; expected the name of a bag" % path)
    try:
        with tempfile.TemporaryFile(dir=folder) as stream:
            stream.write(b"#ROSBAG")
        if os.path.exists(path):
            open(path, "r+b").close()
    except OSError as error:
        raise RecordError("%s cannot be written: %s" % (path, error.strerror)) from error


def keep_earlier(path: str) -> Optional[str]:
    """Rename the unfinished bag of an earlier recorder, which a new one would overwrite; return its path, or None."""
    left = path + ".active"
    if not os.path.exists(left):
        return None
    kept = "%s.%s.active" % (path, time.strftime("%Y-%m-%d-%H-%M-%S"))
    os.replace(left, kept)
    return kept


def check_room(path: str) -> None:
    """Raise OSError if there is no space for an index at the end of a file; the file is not changed.

    An incomplete index would make it unreadable.
    """
    size = os.path.getsize(path)
    try:
        with open(path, "ab") as stream:
            stream.write(bytes(_INDEX + size // 100))
            stream.flush()
            os.fsync(stream.fileno())
    finally:
        os.truncate(path, size)


def rescue(path: str) -> str:
    """Make a readable bag of the unfinished file of a recorder.

    Parameters
    ----------
    path : str
        The bag's name; the unfinished file has the suffix ``.active``.

    Returns
    -------
    str
        The result, as a part of a sentence.
    """
    left = path + ".active"
    if not os.path.exists(left):
        return "%s is complete" % path if _has_messages(path) else "nothing was recorded"
    try:
        check_room(left)
        with rosbag.Bag(left, "a", allow_unindexed=True) as bag:
            for _ in bag.reindex():
                pass
            count = bag.get_message_count()
    except Exception as error:          # rosbag raises errors of any kind; and there may be no space
        return "the recorded part is in %s; with free disk space, `rosbag reindex %s` makes it readable (%s)" % (
            left, left, error)
    if not count:
        return "nothing was recorded"
    os.replace(left, path)
    return "%d messages up to there are in %s" % (count, path)


def _has_messages(path: str) -> bool:
    """Return whether a bag has messages, or exists but cannot be read."""
    try:
        with rosbag.Bag(path) as bag:
            return bag.get_message_count() > 0
    except Exception:                   # rosbag raises errors of any kind
        return os.path.exists(path)


def leave_master(argv: Sequence[str]) -> None:
    """Unregister a recorder that has ended; otherwise the master may list it forever.

    Parameters
    ----------
    argv : list of str
        Command line with the recorder's ``__name:=``.
    """
    names = [word[len("__name:="):] for word in argv if word.startswith("__name:=")]
    if not names:
        return
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(argv=argv), names[0])
    master: Any = xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), transport=PatientTransport())
    try:
        code, _, address = master.lookupNode(name, name)
        if code != 1:
            return          # it has left by itself
        publishers, subscribers, services = master.getSystemState(name)[2]
        for topic, nodes in publishers:
            if name in nodes:
                master.unregisterPublisher(name, topic, address)
        for topic, nodes in subscribers:
            if name in nodes:
                master.unregisterSubscriber(name, topic, address)
        for service, nodes in services:
            if name in nodes:
                master.unregisterService(name, service, master.lookupService(name, service)[2])
    except (OSError, http.client.HTTPException, xmlrpc.client.Error, ValueError, TypeError, IndexError):
        return              # there is no master any more


def _die_with_parent() -> None:
    """Make the recorder close its file if its supervisor is killed; called in the recorder's process."""
    ctypes.CDLL(None, use_errno=True).prctl(_SET_DEATH_SIGNAL, signal.SIGINT)


class Keeper:
    """Starts, supervises and stops a recorder.

    Parameters
    ----------
    path : str
        Of the bag.
    words : list of str
        Topics, and remappings such as ``__name:=record``.
    options : list of str
        Of rosbag's recorder.
    in_order : bool
        Make readers of the bag return each topic in the order of recording, which runs in lockstep repeat.
    """

    def __init__(self, path: str, words: List[str], options: Sequence[str] = (), in_order: bool = False) -> None:
        self._path, self._words, self._options, self._in_order = path, words, list(options), in_order
        self._ending = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: self._ending.set())

    def record(self) -> None:
        """Record until a signal; RecordError if the recorder ends earlier or does not start."""
        check_place(self._path)
        kept = keep_earlier(self._path)
        if kept:
            sys.stderr.write("record: an earlier recording of this name was not finished; it is kept as %s\n" % kept)
        command = [find_recorder(), "--lz4", "--tcpnodelay", "--chunksize=%d" % _CHUNK_KB,
                   "--min-space=%dM" % _SPACE_MB, "-O", self._path]
        # in its own session it receives no signal but ours; a full disk is an error, not a signal that ends it
        recorder = subprocess.Popen(command + self._options + self._words, start_new_session=True,
                                    restore_signals=False, preexec_fn=_die_with_parent)
        try:
            self._await_end(recorder)
        finally:
            # `record -a` subscribes in a thread of its own, which may register after the recorder has left the master
            leave_master(self._words)
        code = recorder.returncode
        if os.path.exists(self._path + ".active") or (code != 0 and not self._ending.is_set()):
            raise RecordError("the recorder ended with %s; is the disk full (df -h %s)? %s" % (
                "signal %d" % -code if code < 0 else "code %d" % code, os.path.dirname(self._path) or ".",
                rescue(self._path)))
        if not self._ending.is_set():
            raise RecordError("the recorder has ended by itself; %s" % rescue(self._path))
        if self._in_order and os.path.exists(self._path):
            try:
                settle_times(self._path)
            except (OSError, ValueError) as error:
                sys.stderr.write("record: the bag is complete, but where several nodes publish on one topic, readers "
                                 "may show another order than was recorded: %s\n" % error)

    def _await_end(self, recorder: subprocess.Popen[bytes]) -> None:
        """Wait for the recorder, or for a signal and then until it has closed its file; RecordError if it does not."""
        while recorder.poll() is None and not self._ending.wait(_LOOK):
            continue
        if recorder.poll() is None:
            recorder.send_signal(signal.SIGINT)
            try:
                recorder.wait(_CLOSING)
            except subprocess.TimeoutExpired:
                recorder.kill()
                recorder.wait()
                raise RecordError("the recorder did not close its file within %g s; %s" % (
                    _CLOSING, rescue(self._path))) from None

    def wait(self) -> None:
        """Wait for a signal."""
        while not self._ending.wait(1.0):
            continue

    def listen(self) -> None:
        """Subscribe to the recorder's topics in its place, because simulated time in lockstep waits for it."""
        try:
            register("record", self._ending.is_set, disable_rostime=True)
        except rospy.ROSInitException:
            self.wait()
            return
        for topic in self._words:
            if ":=" not in topic:
                rospy.Subscriber(topic, rospy.AnyMsg, lambda _: None, queue_size=1)
        while not self._ending.wait(_LOOK) and not rospy.is_shutdown():
            continue
        rospy.signal_shutdown("the run ends")


def finish_as_mcap(bag: str, path: str) -> None:
    """Replace a bag that is complete by an MCAP file.

    Parameters
    ----------
    bag : str
    path : str
        Of the new file.

    Raises
    ------
    RecordError
        If this fails; the bag stays.
    """
    from m2wr_tools.runs.mcap_files import bag_to_mcap  # its libraries take 0.2 s, which other recordings save
    if not os.path.exists(bag):
        return
    try:
        bag_to_mcap(bag, path)
    except ViewError as error:
        raise RecordError("%s; the recording is in %s" % (error, bag)) from error
    os.remove(bag)


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code: 0, 1 where less was recorded than was wanted, 2 on misuse."""
    parser = argparse.ArgumentParser(prog="record_run", description="rosbag record for launch files: if the recording "
                                     "fails, the run continues and the recorded part is readable.")
    name = parser.add_mutually_exclusive_group(required=True)
    name.add_argument("-O", dest="path", metavar="FILE", help="name of the bag; with the ending .mcap the recording "
                      "becomes an MCAP file when it ends")
    name.add_argument("-o", dest="prefix", metavar="PREFIX", help="beginning of the name; the time is appended")
    parser.add_argument("--lockstep", default="false", help="true: without a recorder, listen in its place; the bag "
                        "shows each topic in the order in which it was recorded")
    parser.add_argument("--all", action="store_true",
                        help="record all other topics too, except those that match " + NOT_OF_ALL)
    parser.add_argument("topics", nargs="+", metavar="TOPIC")
    given = parser.parse_args(sys.argv[1:] if argv is None else argv)
    path = given.path or "%s_%s" % (given.prefix, time.strftime("%Y-%m-%d-%H-%M-%S"))
    path = from_user(path if path.endswith((".bag", ".mcap")) else path + ".bag")
    base, ending = os.path.splitext(path)
    bag = path if ending == ".bag" else base + ".bag"
    lockstep = given.lockstep.lower() == "true"
    keeper = Keeper(bag, given.topics, ["-a", "-x", NOT_OF_ALL] if given.all else [], in_order=lockstep)
    try:
        if bag != path and os.path.exists(path):
            raise RecordError("%s exists; expected the name of a new file" % path)
        keeper.record()
    except RecordError as error:
        sys.stderr.write("record: %s. The run continues without a recording.\n" % error)
        sys.stderr.flush()
        if lockstep:
            keeper.listen()
        else:
            keeper.wait()
        return 1
    if bag != path:
        try:
            finish_as_mcap(bag, path)
        except RecordError as error:
            sys.stderr.write("record: %s\n" % error)
            return 1
    return 0
