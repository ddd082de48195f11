# SPDX-License-Identifier: BSD-3-Clause
"""The program ``live``: a node beside a running simulation, or the replay of a bag."""
from __future__ import annotations

import argparse
import logging
import math
import os
import secrets
import sys
import threading
import time
from typing import Any, Callable, List, Optional, Set

import rosgraph
import rospkg
import rospy

from m2wr_live.ros.graph import read_overview
from m2wr_live.ros.inbox import Inbox
from m2wr_live.ros.simulation import Driver, Simulation
from m2wr_live.scene.live_scene import LiveScene
from m2wr_node.listening import AddressError, free_port
from m2wr_node.ros.starting import start_node
from m2wr_node.web_access import Access, forwarded_sites, is_loopback
from m2wr_view.errors import ViewError
from m2wr_view.solids import read_robot

log = logging.getLogger("m2wr_live")

RATE = 30.0                 # pictures a second while a page is open
IDLE_RATE = 5.0             # and while none is open, so that trails are complete
_STATUS = 0.25              # s between two measurements for the status
_IDLE_STATUS = 1.0          # and while no page is open, so that plots have the last minute
_LOOK = 2.0                 # s between two looks for new topics
_LISTS = 3.0                # s between two looks for nodes, frames and parameters
_MOST_COMPLAINTS = 20       # different errors that are logged
_REST = 0.002               # s after a picture in which other threads run in any case
_DRAGS = 0.05               # s between two moves of a dragged model
_WATCH = 0.05               # s between two looks whether pages that drive are silent


def find_mesh(uri: str) -> Optional[str]:
    """Return the path of a mesh that a description names, or None."""
    if uri.startswith("package://"):
        name, _, rest = uri[len("package://"):].partition("/")
        try:
            path = os.path.join(rospkg.RosPack().get_path(name), rest)
        except rospkg.ResourceNotFound:
            return None
    else:
        path = uri[len("file://"):] if uri.startswith("file://") else uri
    ending = os.path.splitext(path)[1].lower()
    return path if os.path.isabs(path) and ending in (".stl", ".obj", ".dae") and os.path.isfile(path) else None


def make_pages(host: str, port: int, token: str, scene: LiveScene, actions: Optional[Simulation],
               driver: Optional[Driver]) -> Any:
    """Return the pages, which are served from now on; the address is logged.

    Parameters
    ----------
    host : str
        Address to listen at.
    port : int
        0: a free one.
    token : str
        Needed in the link; empty: none, or a new one where the address is not of this machine only.
    scene : LiveScene
    actions : Simulation or None
        None: pages may only watch.
    driver : Driver or None

    Raises
    ------
    ViewError
        If the address cannot be used or viser cannot be imported.
    """
    try:
        from m2wr_live.web.pages import Pages
        from m2wr_live.web.server import PageServer
    except (ImportError, AttributeError) as error:
        raise ViewError("the live view needs viser 1.1 and numpy 1.21 or newer (make setup installs viser): %s"
                        % error) from error
    if not token and not is_loopback(host):
        token = secrets.token_urlsafe(16)
    try:
        port = free_port(host, port)
    except AddressError as error:
        raise ViewError(str(error)) from error
    folder = os.path.join(rospkg.RosPack().get_path("m2wr_live"), "page")
    sites = forwarded_sites(os.environ, port)
    server = PageServer(host, port, Access(token, "m2wr_live_%d" % port, sites=sites), folder,
                        None if driver is None else driver.drive)
    shown = "localhost" if is_loopback(host) or host in ("0.0.0.0", "::") else host
    log.info("live view: %s/%s%s", "https://" + sites[0] if sites else "http://%s:%d" % (shown, port),
             "?token=" + token if token else "", "" if actions or driver else "   (pages may only watch)")
    return Pages(server, scene, actions)


class Live:
    """Serves pages beside a running simulation until it is stopped."""

    def __init__(self) -> None:
        self._stopping = threading.Event()
        self._scene, self._driver = LiveScene(), Driver(
            _positive("linear", rospy.get_param("~linear", 0.5)),
            _positive("angular", rospy.get_param("~angular", 1.0)))
        control = rospy.get_param("~control", True)
        if not isinstance(control, bool):
            raise ViewError("parameter ~control is %r; expected true or false" % (control,))
        self._actions = Simulation() if control else None
        self._control = control
        host, port = rospy.get_param("~host", "127.0.0.1"), rospy.get_param("~port", 0)
        if not isinstance(port, int) or isinstance(port, bool) or not isinstance(host, str):
            raise ViewError("parameters ~host and ~port are %r and %r; expected an address and a number" % (host, port))
        self._pages = make_pages(host, port, str(rospy.get_param("~token", "")), self._scene, self._actions,
                                 self._driver if control else None)
        self._inbox = Inbox(self._scene, self._pages.solids, find_mesh)
        self._descriptions: List[str] = []
        self._complaints: Set[str] = set()

    def run(self) -> None:
        """Draw until ROS ends."""
        rospy.on_shutdown(self._stopping.set)
        loops = [(_LOOK, self._look), (_LISTS, self._list), (_DRAGS, self._drag), (_WATCH, self._driver.watch)]
        if self._actions is not None:
            loops.append((_STATUS, self._actions.recorder.watch))
        for loop in loops:      # a thread each: a robot must stop in time while a service or the recorder is waited for
            threading.Thread(target=self._repeat, args=loop, daemon=True).start()
        measured, due = 0.0, time.monotonic()
        while not self._stopping.is_set():
            began = time.monotonic()
            busy = self._pages.server.pages > 0
            measure = began - measured > (_STATUS if busy else _IDLE_STATUS)
            measured = began if measure else measured
            try:
                self._picture(began, busy, measure)
            except Exception as error:      # one picture fails; the node and the other pictures do not
                self._complain(error)
            now = time.monotonic()
            period = 1.0 / (RATE if busy else IDLE_RATE)
            due = max(due + period, now - period)       # on a grid: a late picture does not delay those after it
            self._stopping.wait(max(_REST, due - now))
        self._pages.server.stop()
        if self._actions is not None:
            self._actions.recorder.close()

    def _picture(self, wall: float, busy: bool, measure: bool) -> None:
        """Read what has come, and send it if a page is open (``busy``); ``measure``: the status, too."""
        self._inbox.read(wall)
        if busy:
            self._pages.draw()
        if measure:
            self._measure(wall)

    def _complain(self, error: Exception) -> None:
        """Log an error, each text once."""
        text = "%s: %s" % (type(error).__name__, error)
        if text not in self._complaints and len(self._complaints) < _MOST_COMPLAINTS:
            self._complaints.add(text)
            log.error("live view: a picture could not be drawn (said once)", exc_info=error)

    def _repeat(self, period: float, action: Callable[[], None]) -> None:
        while not self._stopping.is_set():
            try:
                action()
            except Exception as error:      # the loop must not end: pages would show old data without a word
                log.warning("live view: %s: %s", type(error).__name__, error)
            self._stopping.wait(period)

    def _measure(self, wall: float) -> None:
        self._pages.problems = self._inbox.problems
        driver = self._driver if self._control else None
        self._pages.measure(wall, self._pages.solids.blocking, self._actions.paused() if self._actions else None,
                            driver.topics if driver else [], driver.others if driver else {})

    def _look(self) -> None:
        """Look for topics and descriptions that have appeared."""
        try:
            self._inbox.subscribe(rospy.get_published_topics())
            names = [name for name in rospy.get_param_names() if name.endswith("robot_description")][:50]
            for name in names:
                if name not in self._descriptions:
                    self._take_description(name)
        except (OSError, rosgraph.MasterException, rospy.ROSException) as error:
            log.debug("live view: %s", error)
        if self._control:
            self._driver.find(rospy.get_name())
        if self._actions is not None and (self._pages.server.pages or self._actions.factor() is None):
            self._actions.ask_settings()

    def _list(self) -> None:
        """Look for nodes, frames and parameters, if a page is there to show them."""
        if self._pages.server.pages:
            self._pages.sections = read_overview(rospy.get_name(), self._scene.frames.parents())

    def _take_description(self, name: str) -> None:
        text = rospy.get_param(name, "")
        self._descriptions.append(name)
        try:
            if isinstance(text, str) and text.strip():
                self._inbox.take_description(name, text)
                self._pages.footprint = read_robot(text).footprint or self._pages.footprint
        except ViewError as error:
            log.warning("parameter %s: %s", name, error)

    def _drag(self) -> None:
        for panel in self._pages.panels:
            panel.apply_drag()


def _positive(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
        raise ViewError("parameter ~%s is %r; expected a number above 0" % (name, value))
    return float(value)


def _log_to(handler: Optional[logging.Handler]) -> None:
    """Send this package's log through rospy, or to a handler."""
    own, rosout = logging.getLogger("m2wr_live"), logging.getLogger("rosout")
    own.setLevel(logging.INFO)
    own.propagate = False
    own.handlers = rosout.handlers if handler is None else [handler]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="live", description="Show a running simulation, or a recorded run, in web browsers.",
        epilog="parameters of the node: _host, _port, _token, _control, _linear [m/s], _angular [rad/s]; "
               "see docs/how-to/live_view.md")
    parser.add_argument("--bag", metavar="FILE", help="show this bag, with a slider for the time")
    parser.add_argument("--host", default="127.0.0.1", help="address for --bag (%(default)s)")
    parser.add_argument("--port", type=int, default=0, help="port for --bag; 0: a free one from 8080 on (%(default)s)")
    parser.add_argument("--token", default="", help="word that the link must have, for --bag; "
                        "an address that is not of this machine only always gets one")
    return parser


def main() -> int:
    """Entry point; returns the exit code."""
    options = _parser().parse_args(rospy.myargv(sys.argv)[1:])
    if options.bag:
        from m2wr_live.ros.replay import replay
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
        _log_to(handler)
        try:
            return replay(options)
        except ViewError as error:
            log.error("%s", error)
            return 1
    start_node("live", disable_rostime=True)
    _log_to(None)
    try:
        live = Live()
    except ViewError as error:
        rospy.logfatal("live view: %s", error)
        return 1
    live.run()
    return 0
