# SPDX-License-Identifier: BSD-3-Clause
"""rviz on a virtual display, with software rendering: saves screenshots periodically and on request."""
from __future__ import annotations

import logging
import math
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Tuple

import rosgraph
import rospy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from m2wr_node.node_help import answer_help
from m2wr_node.ros.starting import note_signals, register
from m2wr_node.user_folder import from_user
from m2wr_view.errors import ViewError
from m2wr_view.ros.processes import Xvfb, start_rviz
from m2wr_view.rviz_config import VIEWS, for_pictures
from m2wr_view.screenshots import Screenshots

if TYPE_CHECKING:
    from m2wr_view.ros.processes import Child

log = logging.getLogger("rosout.m2wr_view")

_LOOP = 0.05                # s of wall time between two passes of the loop
_DRAW_TIME = 2.0            # s from the start of rviz to its first complete picture
_STATE_DELAY = 1.0          # s from a change of state to its picture: rviz must have drawn it
_READY_PATIENCE = 30.0      # s for rviz to start, until a warning, and until a request is refused
_RESTARTS = 3               # of an rviz that ends soon after its start
_SOON = 120.0               # s
_QUIET = 30.0               # s between two lines on pictures that cannot be written
_GREATEST = 4000            # pixels


@dataclass(frozen=True)
class DisplayConfig:
    """Parameters of the node; times in seconds of wall time."""

    config: str             # rviz configuration file
    out: str                # folder of the pictures; empty: only on request, in the folder screenshots
    period: float           # s between two pictures; 0: no periodic pictures
    size: Tuple[int, int]             # pixels
    frame_rate: float       # Hz
    view: str               # one of VIEWS
    follow: str             # frame that the camera keeps above
    distance: float         # m
    state_topic: str        # std_msgs/String; empty: no pictures of changes


def _number(get: Callable[[str, Any], Any], name: str, default: float, least: float, most: float) -> float:
    value = get("~" + name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) \
            or not least <= value <= most:
        raise ViewError("parameter ~%s is %r; expected a number from %g to %g" % (name, value, least, most))
    return float(value)


def read_parameters(get: Callable[[str, Any], Any]) -> DisplayConfig:
    """Return a :class:`DisplayConfig`.

    Parameters
    ----------
    get : callable
        ``get(name, default)`` of private parameters.

    Raises
    ------
    ViewError
        If a parameter is invalid; the message names it.
    """
    size = get("~size", [1280, 720])
    if not isinstance(size, (list, tuple)) or len(size) != 2 or not all(
            isinstance(side, int) and not isinstance(side, bool) and 100 <= side <= _GREATEST for side in size):
        raise ViewError("parameter ~size is %r; expected [width, height] from 100 to %d pixels" % (size, _GREATEST))
    view = get("~view", "orbit")
    if view not in VIEWS:
        raise ViewError("parameter ~view is %r; expected one of %s" % (view, ", ".join(VIEWS)))
    config = str(get("~config", ""))
    if not config:
        raise ViewError("parameter ~config is not set; expected the path of an rviz configuration")
    out = from_user(str(get("~out", "screenshots")))
    return DisplayConfig(config, out, _number(get, "period", 10.0, 0.0, 86400.0), tuple(size),
                         _number(get, "frame_rate", 10.0, 1.0, 60.0), view, str(get("~follow", "")).strip("/"),
                         _number(get, "distance", 10.0, 0.1, 1000.0), str(get("~state_topic", "bug2/state")))


class VirtualDisplay:
    """The node: a display, rviz on it, pictures of it."""

    def __init__(self) -> None:
        self._signals: List[int] = []
        self._lock = threading.Lock()
        self._display: Optional[Xvfb] = None
        self._rviz: Optional[Child] = None
        self._shots: Optional[Screenshots] = None
        self._text, self._restarts, self._born = "", 0, 0.0
        self._stale: Optional[str] = None       # service of an rviz that was killed
        self._drawn_from: Optional[float] = None        # monotonic time [s] from which rviz shows what there is
        self._ready = threading.Event()
        self._states: List[Tuple[float, str]] = []      # monotonic time [s] of the picture, state
        self._next_period: Optional[float] = None
        self._complained = -math.inf

    def run(self) -> int:
        """Run; returns the exit code: 0 also if there are no pictures, because that must not end a run."""
        self._signals = note_signals()
        register("virtual_display", self._ending, disable_rostime=True)
        try:
            self._config = read_parameters(rospy.get_param)
        except ViewError as error:
            rospy.logfatal("virtual display: %s", error)
            rospy.signal_shutdown("a parameter is invalid")
            return 1
        try:
            self._loop(self._start())
        except (ViewError, OSError) as error:
            rospy.logerr("virtual display: %s. The run continues without pictures of rviz.", error)
        finally:
            self._stop()
        rospy.signal_shutdown("shutdown requested")
        return 0

    # ---- beginning and end -----------------------------------------------------------------------------------

    def _ending(self) -> bool:
        return bool(self._signals) or rospy.core.is_shutdown_requested()

    def _start(self) -> Xvfb:
        config = self._config
        with open(config.config, encoding="utf-8") as stream:
            self._text = for_pictures(stream.read(), config.config, config.size, config.frame_rate, config.view,
                                      config.follow, config.distance)
        try:
            self._shots = Screenshots(config.out)
        except ViewError as error:
            rospy.logerr("virtual display: %s. No pictures are saved; the run continues.", error)
        self._display = display = Xvfb(config.size)
        rospy.loginfo("virtual display: %s, %d x %d; pictures go to %s", display.name, config.size[0],
                      config.size[1], config.out)
        self._start_rviz(display)
        if config.state_topic:
            rospy.Subscriber(config.state_topic, String, self._on_state, queue_size=10)
        rospy.Service("~screenshot", Trigger, self._on_request)
        return display

    def _start_rviz(self, display: Xvfb) -> None:
        self._ready.clear()
        self._drawn_from, self._born = None, time.monotonic()
        self._stale = self._rviz_service()      # of one that was killed
        self._rviz = start_rviz(display, self._text, rospy.get_name().rsplit("/", 1)[-1] + "_rviz")

    def _stop(self) -> None:
        with self._lock:
            pending = max([at for at, _ in self._states], default=-math.inf)
        if self._ready.is_set():        # a run often ends with a change of state, which rviz has yet to draw
            time.sleep(max(0.0, pending - time.monotonic()))
        with self._lock:
            if self._ready.is_set() and all(part is not None and part.alive() for part in (self._rviz, self._display)):
                self._shoot("end")
            for part in (self._rviz, self._display):
                if part is not None:
                    part.stop()
            self._ready.clear()
            self._rviz = self._display = None
        if self._shots is not None and self._shots.count:
            rospy.loginfo("virtual display: %d pictures in %s", self._shots.count, self._shots.folder)

    # ---- main loop -------------------------------------------------------------------------------------------

    def _loop(self, display: Xvfb) -> None:
        told = False
        while not self._ending():
            time.sleep(_LOOP)
            now = time.monotonic()
            if not display.alive():
                raise ViewError("display %s has ended with %s" % (display.name, display.end()))
            if self._rviz is not None and not self._rviz.alive():
                self._revive(display, self._rviz.end())
            if not self._ready.is_set():
                self._look_for_rviz(now)
                if not told and now - self._born > _READY_PATIENCE:
                    told = True
                    rospy.logwarn("virtual display: rviz is not ready after %g s; it may be missing OpenGL "
                                  "(apt install libgl1-mesa-dri)", _READY_PATIENCE)
                continue
            self._take_pictures(now)

    def _revive(self, display: Xvfb, how: str) -> None:
        """Start rviz again after it has ended; ViewError if that happened too often."""
        self._ready.clear()
        if time.monotonic() - self._born > _SOON:
            self._restarts = 0
        if self._restarts == _RESTARTS:
            raise ViewError("rviz has ended again, with %s" % how)
        self._restarts += 1
        rospy.logwarn("virtual display: rviz ended with %s; starting it again (%d of %d times)", how,
                      self._restarts, _RESTARTS)
        self._start_rviz(display)

    def _look_for_rviz(self, now: float) -> None:
        """Find out whether rviz has set up its window and drawn it."""
        if self._drawn_from is None:
            if self._rviz_service() in (None, self._stale):
                return
            self._drawn_from = now + _DRAW_TIME
        if now >= self._drawn_from:
            self._ready.set()
            if self._next_period is None:
                self._next_period = now + self._config.period
                self._states = []
                with self._lock:
                    self._shoot("start")

    @staticmethod
    def _rviz_service() -> Optional[str]:
        """Return the address of the service that rviz advertises last, or None."""
        try:
            return rosgraph.Master(rospy.get_name()).lookupService(rospy.get_name() + "_rviz/load_config")
        except (rosgraph.MasterException, OSError):
            return None

    def _take_pictures(self, now: float) -> None:
        with self._lock:
            due = [state for at, state in self._states if at <= now]
            self._states = [entry for entry in self._states if entry[0] > now]
            if due:
                self._shoot(due[-1])
            if self._config.period and self._next_period is not None and now >= self._next_period:
                self._next_period = now + self._config.period
                self._shoot("period")

    def _on_state(self, message: String) -> None:
        with self._lock:
            self._states.append((time.monotonic() + _STATE_DELAY, message.data))

    def _on_request(self, _: Any) -> TriggerResponse:
        if not self._ready.wait(_READY_PATIENCE):
            return TriggerResponse(False, "rviz is not ready")
        with self._lock:
            if self._display is None or self._rviz is None:
                return TriggerResponse(False, "the display is closing")
            if not self._rviz.alive():
                return TriggerResponse(False, "rviz has just ended")
            if self._shots is None:
                return TriggerResponse(False, "%s cannot be written to" % self._config.out)
            path, problem = self._shoot("asked")
        return TriggerResponse(problem is None, path or problem)

    def _shoot(self, why: str) -> Tuple[Optional[str], Optional[str]]:
        """Save a picture; returns its path and None, or None and what went wrong."""
        if self._shots is None:
            return None, "no folder"
        if self._display is None:
            return None, "no display"
        try:
            return self._shots.save(self._display.picture(), why), None
        except ViewError as error:
            if time.monotonic() - self._complained > _QUIET:
                self._complained = time.monotonic()
                rospy.logerr("virtual display: %s. The run continues.", error)
            return None, str(error)


def main() -> int:
    """Entry point; returns the exit code."""
    answer_help("virtual_display", "Run rviz on a virtual display and save screenshots.", {
        "config": "rviz configuration file, required", "out": "folder of the pictures (screenshots)",
        "period": "seconds between two pictures; 0: no periodic pictures (10)",
        "size": "[width, height] in pixels ([1280, 720])",
        "frame_rate": "[Hz] (10)", "view": "one of %s (orbit)" % ", ".join(VIEWS),
        "follow": "frame that the camera keeps above", "distance": "of the camera [m] (10)",
        "state_topic": "topic; each change is saved as a picture; empty: none (bug2/state)"})
    return VirtualDisplay().run()
