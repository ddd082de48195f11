# SPDX-License-Identifier: BSD-3-Clause
"""Draws a robot and its world from above: as a node from topics, or as a command from a bag."""
from __future__ import annotations

import argparse
import ctypes
import gc
import logging
import os
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple

import rosgraph
import roslib.message
import rospy
from sensor_msgs.msg import Image

from m2wr_node.ros.starting import note_signals, register
from m2wr_node.user_folder import from_user
from m2wr_view.bag_file import messages_of, open_bag, topic_types
from m2wr_view.dumping import make_dump
from m2wr_view.errors import ViewError
from m2wr_view.renderer import Renderer
from m2wr_view.scene import TOPICS, Scene
from m2wr_view.writers import make_writer

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from m2wr_view.dumping import Dump
    from m2wr_view.writers import Writer

log = logging.getLogger("rosout.m2wr_view")
MOST_PICTURES = 500     # about 30 MB of PNG files, four minutes at 2 Hz; bounds the use of disk space
_REMIND = 5.0           # s of wall time between two reminders of the topics that are waited for
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3           # of glibc's mallopt
_KEPT_FREE, _LARGEST_KEPT = 128 << 20, 32 << 20         # bytes; the largest picture takes 64 MB, one of 800 x 800 3 MB


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="image_dump", description=__doc__ + "  Topics are remapped as usual, also with --bag: odom:=/robot1/odom.")
    parser.add_argument("--bag", help="draw this recorded run; default: draw the topics")
    parser.add_argument("--out", action="append", default=[], metavar="PATH",
                        help="folder for PNG files, or a file .gif or .mp4; may be given several times")
    parser.add_argument("--rate", type=float, help="pictures a second of simulated time (default: 2)")
    parser.add_argument("--size", nargs=2, type=int, metavar=("W", "H"), help="of the pictures (default: 800 800)")
    parser.add_argument("--view", nargs=4, type=float, metavar=("X0", "Y0", "X1", "Y1"),
                        help="what to show [m] (default: everything)")
    parser.add_argument("--speed", type=float, default=5.0,
                        help="of films, in times the simulated time (default: %(default)s)")
    parser.add_argument("--max-pictures", type=int, metavar="N",
                        help="largest number of pictures, 0: no limit (default: %d, of a bag no limit)" % MOST_PICTURES)
    parser.add_argument("--times", action="store_true",
                        help="print the CPU time for drawing and writing a picture at the end")
    return parser


def _settle() -> None:
    """Prepare for drawing: the first picture then takes no longer than the others.

    Memory for pixels is allocated and freed several times per picture; page faults would cost more than the drawing,
    so freed memory is kept.  Imported objects are excluded from garbage collection.  A first picture loads the fonts.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        pass                            # another C library than glibc
    else:
        mallopt(_M_TRIM_THRESHOLD, _KEPT_FREE)
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_KEPT)
    Renderer().draw(Scene())
    gc.collect()
    gc.freeze()


def _log_to_screen() -> None:
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("image_dump: %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.propagate = False


def _writers(paths: List[str], rate: float, speed: float) -> List[Writer]:
    """Return the writers that could be opened; errors of the others are logged."""
    found = []
    for path in paths:
        try:
            if not speed > 0.0:
                raise ViewError("speed %r: expected more than 0" % speed)
            found.append(make_writer(path, min(50.0, max(0.1, rate * speed))))
        except ViewError as error:
            log.error("%s. The other outputs are written.", error)
    return found


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns 0 if all was written, 1 after an error, 2 for wrong usage."""
    words = rospy.myargv(sys.argv if argv is None else ["image_dump"] + argv)[1:]
    options = _parser().parse_args(words)
    _settle()
    if options.bag:
        _log_to_screen()
        try:
            return dump_bag(options, rosgraph.names.load_mappings(sys.argv if argv is None else argv))
        except ViewError as error:
            log.error("%s", error)
            return 1
    return Node(options).run()


# ---- a bag -------------------------------------------------------------------------------------------------------

def dump_bag(options: argparse.Namespace, mappings: Optional[Dict[str, str]] = None) -> int:
    """Draw a recorded run.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command line.
    mappings : dict of str to str, optional
        New names of topics, by their names in ``TOPICS``.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    ViewError
        If the bag cannot be read, nothing in it can be drawn, or an option is invalid.
    """
    rate, path = 2.0 if options.rate is None else options.rate, options.bag
    dump = make_dump(rate, tuple(options.size or (800, 800)), options.view, [])
    names = {"/" + (mappings or {}).get(name, name).lstrip("/"): name for name in TOPICS}
    with open_bag(path) as bag:
        types = topic_types(bag)
        check_topics(path, types, names)
        dump = make_dump(rate, tuple(options.size or (800, 800)), options.view,
                         _writers(options.out or [os.path.splitext(path)[0] + "_pictures"], rate, options.speed),
                         clock=_clock(options), limit=options.max_pictures or 0)
        if dump.failed:
            return 1
        usable = [topic for topic in names if types.get(topic) == TOPICS[names[topic]][0]]
        try:
            for topic, message, _ in messages_of(bag, path, usable):
                dump.take(names[topic], message)
                if dump.failed:
                    return 1
        except KeyboardInterrupt:
            log.info("interrupted; what has been drawn is kept")
        except Exception as error:      # damaged bytes cause errors of any kind
            log.error("bag %s: it cannot be read any further (%s: %s); what has been drawn is kept",
                      path, type(error).__name__, error)
    written = dump.close()
    if not dump.count:
        raise ViewError("bag %s: none of its messages has a time; expected /clock or /odom in it" % path)
    log.info("%s", written)
    for line in dump.timing():
        log.info("%s", line)
    return 1 if dump.failed else 0


def _clock(options: argparse.Namespace) -> Optional[Callable[[], float]]:
    return time.thread_time if options.times else None


def check_topics(path: str, types: Dict[str, str], names: Dict[str, str]) -> None:
    """Log which topics a bag lacks.

    Parameters
    ----------
    path : str
        The bag.
    types : dict of str to str
        Message type by topic of the bag.
    names : dict of str to str
        Name in ``TOPICS`` by topic of the bag.

    Raises
    ------
    ViewError
        If it has neither poses of a robot nor a world.
    """
    for topic, kind in types.items():
        if topic in names and kind != TOPICS[names[topic]][0]:
            log.warning("bag %s: topic %s has the type %s and is left out; expected %s", path, topic, kind,
                        TOPICS[names[topic]][0])
    there = {names[topic] for topic in types if topic in names and types[topic] == TOPICS[names[topic]][0]}
    if not there & {"odom", "tf", "map", "gazebo/robot_states", "gazebo/world_markers"}:
        raise ViewError("bag %s: it has none of the topics /odom, /tf, /map, /gazebo/robot_states and "
                        "/gazebo/world_markers, so there is nothing to draw; topics in it: %s"
                        % (path, ", ".join(sorted(types)) or "none"))
    for name, lost in (("gazebo/world_markers", "the world"), ("m2wr/laser/scan", "the laser"),
                       ("robot_description", "the robot's shape (that of m2wr is drawn)"),
                       ("odom", "the odometry (tf is used, of several robots the true poses)")):
        if name not in there:
            log.warning("bag %s: no topic /%s; the pictures lack %s", path, name, lost)


# ---- a node ------------------------------------------------------------------------------------------------------

def _parameter(name: str, given: Any, default: Any) -> Any:
    return given if given is not None else rospy.get_param("~" + name, default)


class Node:
    """Draws topics until it is stopped; options of the command line take precedence over parameters."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options, self._lock = options, threading.Lock()
        self._signals: List[int] = []
        self._dump: Optional[Dump] = None
        self._image: Any = None         # rospy.Publisher, after the start

    def run(self) -> int:
        """Run; returns the exit code."""
        self._signals = note_signals()
        register("image_dump", self._ending, disable_rostime=True)
        try:
            dump, paths = self._start()
        except (ViewError, ValueError, TypeError) as error:
            rospy.logfatal("%s", error)
            rospy.signal_shutdown("a parameter is invalid")
            return 1
        self._wait(dump)
        with self._lock:
            written = dump.close()
            self._dump = None
        if written:
            rospy.loginfo("written: %s", written)
        for line in dump.timing():
            rospy.loginfo("%s", line)
        failed = bool(paths) and dump.failed
        if not dump.count:
            rospy.logwarn("no picture was drawn: no message was received on clock or odom")
        rospy.signal_shutdown("shutdown requested")
        return 1 if failed else 0

    def _ending(self) -> bool:
        return bool(self._signals) or rospy.core.is_shutdown_requested()

    def _start(self) -> Tuple[Dump, List[str]]:
        options = self._options
        rate = float(_parameter("rate", options.rate, 2.0))
        size = [int(side) for side in _parameter("size", options.size, [800, 800])]
        view = _parameter("view", options.view, []) or None
        out = options.out or rospy.get_param("~out", "")
        paths = [path.strip() for path in out.split(",") if path.strip()] if isinstance(out, str) else list(out)
        paths = [from_user(path) for path in paths]
        limit = int(_parameter("max_pictures", options.max_pictures, MOST_PICTURES))
        make_dump(rate, tuple(size), view, [], limit=limit)
        self._image = rospy.Publisher("~image", Image, queue_size=2)
        dump = make_dump(rate, tuple(size), view, _writers(
            paths, rate, float(_parameter("speed", None, options.speed))), self._show, _clock(options), limit)
        self._dump = dump
        for name, (kind, _) in TOPICS.items():
            rospy.Subscriber(name, roslib.message.get_message_class(kind), self._take, name, queue_size=100,
                             tcp_nodelay=True)
        return dump, paths

    def _take(self, message: Any, name: str) -> None:
        with self._lock:
            if self._dump is not None:
                self._dump.take(name, message)

    def _show(self, image: Picture, now: float) -> None:
        dump = self._dump
        if dump is None or not self._image.get_num_connections():
            return
        message = Image(width=image.width, height=image.height, encoding="rgb8", step=3 * image.width,
                        data=image.tobytes())
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(now), dump.scene.odom_frame
        self._image.publish(message)

    def _wait(self, dump: Dump) -> None:
        """Wait for shutdown; until the first picture, log every few seconds what is missing."""
        told = time.monotonic()
        while not self._ending():
            time.sleep(0.05)
            if not dump.count and time.monotonic() - told > _REMIND:
                told = time.monotonic()
                rospy.loginfo("no picture yet: waiting for %s or %s", rospy.resolve_name("clock"),
                              rospy.resolve_name("odom"))
