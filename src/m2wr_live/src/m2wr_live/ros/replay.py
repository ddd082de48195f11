# SPDX-License-Identifier: BSD-3-Clause
"""Shows a recorded run in pages, with a slider for the time."""
from __future__ import annotations

import argparse
import bisect
import logging
import os
import tempfile
import threading
import time
from typing import Any, Dict, List, Tuple

from m2wr_live.ros.inbox import Inbox, kind_of
from m2wr_live.ros.recorder import LARGEST, draw_film
from m2wr_live.scene.live_scene import LiveScene
from m2wr_view.bag_file import messages_of, open_bag, topic_types
from m2wr_view.errors import ViewError
from m2wr_view.solids import read_robot

log = logging.getLogger("m2wr_live")

MOST_MESSAGES = 500000      # of a bag that are shown; a longer one is cut off, and the log says so
RATE = 30.0                 # pictures a second
_RECENT = 2.0               # s of transforms and scans that are read after a jump
_HISTORY = 10.0             # samples a second that are read after a jump for the trail
#: Topics of which only the newest message before a moment counts.
_NEWEST = ("visualization_msgs/MarkerArray", "nav_msgs/OccupancyGrid", "nav_msgs/Path", "geometry_msgs/PoseArray")


class Recording:
    """The messages of a bag that pages show, in the order of time.

    Parameters
    ----------
    path : str
        Of the bag.

    Attributes
    ----------
    path : str
    messages : list of (float, str, object)
        Time since the bag's beginning [s], topic, message.
    kinds : dict of str to str
        Types of the topics.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        with open_bag(path) as bag:
            self.kinds = {topic: kind for topic, kind in topic_types(bag).items()
                          if kind_of(topic, kind) and topic != "/clock"}
            if not self.kinds:
                raise ViewError("bag %s: none of its topics is shown; expected /tf, /gazebo/world_markers, scans or "
                                "maps" % path)
            self.messages: List[Tuple[float, str, Any]] = []
            begin = bag.get_start_time()
            for topic, message, recorded in messages_of(bag, path, list(self.kinds)):
                if len(self.messages) >= MOST_MESSAGES:
                    log.warning("bag %s: only its first %d messages are shown", path, MOST_MESSAGES)
                    break
                self.messages.append((recorded.to_sec() - begin, topic, message))
        self.messages.sort(key=lambda entry: entry[0])
        self._times = [entry[0] for entry in self.messages]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return self._times[-1] if self._times else 0.0

    def between(self, begin: float, end: float) -> List[Tuple[float, str, Any]]:
        """Return the messages after ``begin`` and not after ``end`` [s].

        Parameters
        ----------
        begin, end : float
            Times since the bag's beginning.
        """
        return self.messages[bisect.bisect_right(self._times, begin):bisect.bisect_right(self._times, end)]

    def up_to(self, moment: float) -> List[Tuple[float, str, Any]]:
        """Return the messages that a picture of a moment depends on: the newest, and enough for the trail.

        Parameters
        ----------
        moment : float
            Time since the bag's beginning [s].
        """
        chosen: List[Tuple[float, str, Any]] = []
        newest: Dict[str, Tuple[float, str, Any]] = {}
        sampled: Dict[str, float] = {}
        for entry in self.between(-1.0, moment):
            stamp, topic, _ = entry
            kind = self.kinds[topic]
            if kind in _NEWEST:
                newest[topic] = entry
            elif kind == "sensor_msgs/LaserScan":
                if stamp > moment - _RECENT:
                    chosen.append(entry)
            elif topic == "/tf" and stamp < moment - _RECENT:
                if stamp - sampled.get(topic, -1e9) >= 1.0 / _HISTORY:
                    sampled[topic] = stamp
                    chosen.append(entry)
            else:
                chosen.append(entry)
        return sorted(chosen + list(newest.values()), key=lambda entry: entry[0])


class Player:
    """Shows a recording at the time of the slider.

    Parameters
    ----------
    recording : Recording
    options : argparse.Namespace
        ``host``, ``port`` and ``token``.
    """

    def __init__(self, recording: Recording, options: argparse.Namespace) -> None:
        from m2wr_live.ros.node import find_mesh, make_pages
        self._recording, self._find_mesh = recording, find_mesh
        self._scene = LiveScene()
        self._pages = make_pages(options.host, options.port, options.token, self._scene, None, None)
        self._inbox = self._new_inbox()
        self._film, self._filming = b"", threading.Lock()
        gui = self._pages.viser.gui
        with gui.add_folder("Recording", order=0):
            self._slider = gui.add_slider("Time [s]", min=0.0, max=max(0.1, round(recording.end, 1)), step=0.1,
                                          initial_value=0.0)
            self._playing = gui.add_checkbox("Play", True)
            self._speed = gui.add_dropdown("Playback speed", ("0.25", "0.5", "1", "2", "5", "10"), initial_value="1")
        self._pages.viser.on_client_connect(self._connected)
        self._now, self._shown = 0.0, -1.0

    def _connected(self, client: Any) -> None:
        """Add the downloads to the panel of a page; viser drops clicks of a page on shared buttons before this call."""
        from m2wr_live.web.panel import add_downloads
        try:
            with client.gui.add_folder("Files", order=1):
                add_downloads(client.gui, self.bag, self.film)
        except Exception as error:      # the page was closed meanwhile
            log.debug("page %d: %s", client.client_id, error)

    def _new_inbox(self) -> Inbox:
        inbox = Inbox(self._scene, self._pages.solids, self._find_mesh)
        for topic, kind in self._recording.kinds.items():
            inbox.add(topic, kind)
        return inbox

    def run(self) -> None:
        """Play until the program is interrupted."""
        before, measured = time.monotonic(), 0.0
        try:
            while True:
                wall = time.monotonic()
                self.advance(wall - before)
                before = wall
                self._pages.draw()
                if wall - measured > 0.25:
                    measured = wall
                    self._pages.measure(wall, self._pages.solids.blocking, not self._playing.value, [], {})
                time.sleep(max(0.002, 1.0 / RATE - (time.monotonic() - wall)))
        finally:
            self._pages.server.stop()

    def bag(self) -> bytes:
        """Return the bag.

        Raises
        ------
        ViewError
            If it is too large for a page, or not there any more.
        """
        path = self._recording.path
        try:
            size = os.path.getsize(path)
            if size > LARGEST:
                raise ViewError("bag %s has %d MB; pages get at most %d MB" % (path, size >> 20, LARGEST >> 20))
            with open(path, "rb") as stream:
                return stream.read()
        except OSError as error:
            raise ViewError("bag %s: %s" % (path, error.strerror or error)) from error

    def film(self) -> bytes:
        """Return a film of the bag, a GIF; drawn at the first call.

        Raises
        ------
        ViewError
            If it cannot be drawn.
        """
        with self._filming:
            if not self._film:
                with tempfile.TemporaryDirectory(prefix="m2wr_live_") as folder:
                    path = os.path.join(folder, "run.gif")
                    draw_film(self._recording.path, path)
                    with open(path, "rb") as stream:
                        self._film = stream.read()
            return self._film

    def advance(self, elapsed: float) -> None:
        """Bring the scene to the slider's time, or forward by wall time [s]."""
        wanted = float(self._slider.value)
        if abs(wanted - round(self._now, 1)) > 0.051:       # a page has moved the slider
            self._now = wanted
        elif self._playing.value:
            self._now = min(self._recording.end, self._now + elapsed * float(self._speed.value))
            if self._now >= self._recording.end:
                self._playing.value = False
        if self._now == self._shown:
            return
        if self._shown <= self._now < self._shown + 2.0:
            entries = self._recording.between(self._shown, self._now)
        else:
            entries = self._jump()
        for stamp, topic, message in entries:
            self._scene.take_time(stamp)
            try:
                self._inbox.take(topic, message)
            except ViewError as error:
                log.warning("%s", error)
            if topic in ("/tf", "/gazebo/robot_states"):
                self._scene.update()
        self._scene.take_time(self._now)
        self._shown = self._now
        self._slider.value = round(self._now, 1)
        self._footprint()

    def _jump(self) -> List[Tuple[float, str, Any]]:
        """Begin again with an empty run; return the messages up to now."""
        self._scene.forget_run()
        self._pages.forget_run()
        self._scene.now = 0.0
        self._scene.grids, self._scene.paths, self._scene.particles = {}, {}, {}
        self._scene.annotations = {}
        return self._recording.up_to(self._now)

    def _footprint(self) -> None:
        text = self._inbox.description
        if text is not None and self._pages.footprint_of != text:
            self._pages.footprint_of = text
            self._pages.footprint = read_robot(text).footprint or self._pages.footprint


def replay(options: argparse.Namespace) -> int:
    """Show a bag until the program is interrupted; return the exit code.

    Parameters
    ----------
    options : argparse.Namespace
        ``bag``, ``host``, ``port`` and ``token``.

    Raises
    ------
    ViewError
        If the bag or the address cannot be used.
    """
    recording = Recording(options.bag)
    log.info("bag %s: %d messages, %.1f s", options.bag, len(recording.messages), recording.end)
    try:
        Player(recording, options).run()
    except KeyboardInterrupt:
        return 0
    return 0
