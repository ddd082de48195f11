# SPDX-License-Identifier: BSD-3-Clause
"""Decides when to draw and handles errors: the part of image_dump without ROS."""
from __future__ import annotations

import logging
import math
from collections import defaultdict
from functools import partial
from typing import TYPE_CHECKING, Any, Callable, DefaultDict, List, Optional, Sequence, Set, Tuple, TypeVar

from m2wr_view.errors import ViewError
from m2wr_view.renderer import Renderer
from m2wr_view.scene import TOPICS, Scene

if TYPE_CHECKING:
    from PIL import Image

    from m2wr_view.writers import Writer

Result = TypeVar("Result")

log = logging.getLogger("rosout.m2wr_view")
_TICK = 1e-6            # s; sums of periods and stamps differ in their last bits
_MOST_BEHIND = 1000     # periods; after a longer jump of the clock, counting starts again


class Dump:
    """Feeds messages to a scene and draws it at a rate of simulated time, and when the state changes.

    Parameters
    ----------
    renderer : Renderer
    rate : float
        Pictures a second of simulated time [Hz].
    writers : list
        See :mod:`m2wr_view.writers`; one that fails is logged and not used any more.
    show : callable, optional
        Called with (image, time [s]) of each picture.
    limit : int
        Number of pictures written at most; ``show`` is called for later ones too.  0: no limit.
    clock : callable, optional
        Returns seconds; measures the time for pictures, see :meth:`timing`.
    """

    def __init__(self, renderer: Renderer, rate: float, writers: Sequence[Writer],
                 show: Optional[Callable[[Image.Image, float], object]] = None,
                 clock: Optional[Callable[[], float]] = None, limit: int = 0) -> None:
        self.scene, self.count, self._limit = Scene(), 0, limit
        self._clock = clock
        self._times: DefaultDict[str, List[float]] = defaultdict(list)
        self._renderer, self._period, self._writers, self._show = renderer, 1.0 / rate, list(writers), show
        self._due: Optional[float] = None       # time of the next picture [s]
        self._state: Optional[str] = None
        self._complained: Set[Tuple[str, str]] = set()

    @property
    def failed(self) -> bool:
        """Whether all writers have failed."""
        return not self._writers

    def take(self, topic: str, message: Any) -> None:
        """Process a message, and draw if a picture is due; an invalid message is logged once.

        Parameters
        ----------
        topic : str
            One of ``TOPICS``.
        message : message
            Of the topic's type.
        """
        try:
            getattr(self.scene, TOPICS[topic][1])(message)
        except ViewError as error:
            self._complain(topic, str(error))
        except Exception as error:      # no message may end the program
            self._complain(topic, "%s: %s" % (type(error).__name__, error))
        now = self.scene.now
        if now is None:
            return
        if self._due is None or now < self._due - 2.0 * self._period or now > self._due + _MOST_BEHIND * self._period:
            self._due = now
        due, changed = now >= self._due - _TICK, self.scene.state != self._state
        if due or changed:
            self._state = self.scene.state
            self.draw()
        if due:
            self._due += self._period * (1 + math.floor((now - self._due + _TICK) / self._period))

    def draw(self) -> None:
        """Draw a picture and pass it to writers and ``show``."""
        self._timed("a picture", self._draw)

    def _draw(self) -> None:
        try:
            image = self._timed("drawing", self._renderer.draw, self.scene)
        except Exception as error:
            self._complain("drawing", "%s: %s" % (type(error).__name__, error))
            return
        self.count += 1
        if self._limit and self.count == self._limit + 1 and self._writers:
            log.warning("%d pictures written, the limit (max_pictures; 0: no limit); no more are written",
                        self._limit)
        for writer in list(self._writers) if not self._limit or self.count <= self._limit else ():
            self._guarded(writer, partial(self._timed, writer.path, writer.write, image))
        if self._show is not None:
            self._timed("topic", self._show, image, self.scene.now or 0.0)

    def _timed(self, what: str, action: Callable[..., Result], *arguments: Any) -> Result:
        if self._clock is None:
            return action(*arguments)
        began = self._clock()
        result = action(*arguments)
        self._times[what].append(self._clock() - began)
        return result

    def timing(self) -> List[str]:
        """Return lines of text with the time for each part of a picture, and for the whole, by the given clock."""
        lines = []
        for what, seconds in self._times.items():
            ordered = sorted(1e3 * second for second in seconds)
            lines.append("%s: %d times, median %.1f ms, 95 of 100 within %.1f ms, longest %.1f ms" % (
                what, len(ordered), ordered[len(ordered) // 2], ordered[(len(ordered) * 95 - 1) // 100], ordered[-1]))
        return lines

    def close(self) -> str:
        """Draw the last state and finish all files; returns the names of the files, as text."""
        if self.scene.now is not None:
            self.draw()
        for writer in list(self._writers):
            self._guarded(writer, writer.close)
        return ", ".join("%s (%d pictures)" % (writer.path, writer.count) for writer in self._writers)

    def _guarded(self, writer: Writer, action: Callable[[], object]) -> None:
        try:
            action()
        except ViewError as error:
            self._writers.remove(writer)
            log.error("%s. No more pictures are written there; earlier ones are kept.", error)

    def _complain(self, topic: str, text: str) -> None:
        if (topic, text) not in self._complained and len(self._complained) < 100:
            self._complained.add((topic, text))
            log.warning("%s: %s; left out of the pictures", topic, text)


def make_dump(rate: float, size: Tuple[int, ...], bounds: Optional[Sequence[float]], writers: Sequence[Writer],
              show: Optional[Callable[[Image.Image, float], object]] = None,
              clock: Optional[Callable[[], float]] = None, limit: int = 0) -> Dump:
    """Return a :class:`Dump` for numbers as users give them.

    Parameters
    ----------
    rate : float
        Pictures a second of simulated time [Hz].
    size : (int, int)
        Width and height of the pictures [pixels].
    bounds : (4,) floats, optional
        Least x, least y, greatest x, greatest y to show [m]; default: everything is shown.
    writers : sequence of Writer
        See :mod:`m2wr_view.writers`.
    show : callable, optional
        Called with (image, time [s]) of each picture.
    clock : callable, optional
        Returns seconds; measures the time for pictures.
    limit : int
        Number of pictures written at most; 0: no limit.

    Raises
    ------
    ViewError
        If a number makes no sense.
    """
    if not (math.isfinite(rate) and 0.0 < rate <= 1000.0):
        raise ViewError("rate %r: expected more than 0 and at most 1000 pictures a second of simulated time" % rate)
    if len(size) != 2 or not all(isinstance(side, int) and 200 <= side <= 4000 for side in size):
        raise ViewError("size %r: expected two whole numbers from 200 to 4000 [pixels]" % (size,))
    if bounds is not None and not (len(bounds) == 4 and all(map(math.isfinite, bounds)) and bounds[0] < bounds[2]
                                   and bounds[1] < bounds[3]):
        raise ViewError("view %r: expected least x, least y, greatest x, greatest y [m]" % (bounds,))
    if limit < 0:
        raise ViewError("max_pictures %r: expected a whole number, 0 for no limit" % limit)
    return Dump(Renderer(size[0], size[1], bounds), rate, writers, show, clock, limit)
