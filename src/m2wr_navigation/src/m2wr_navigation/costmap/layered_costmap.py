# SPDX-License-Identifier: BSD-3-Clause
"""A costmap made of layers, which may follow the robot."""
from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import FREE, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import half_width, radii
from m2wr_navigation.costmap.layer import Layer, Window
from m2wr_navigation.costmap.obstacle_layer import ObstacleLayer
from m2wr_navigation.costmap.shift import shifted
from m2wr_navigation.costmap.static_layer import StaticLayer

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


class LayeredCostmap:
    """The master grid and its layers.

    One thread calls :meth:`update`; any thread may take a :meth:`snapshot`, which no update changes.

    Parameters
    ----------
    frame : str
        Global frame.
    size : (float, float)
        Width (x) and height (y) [m].
    resolution : float
        [m]
    origin : (float, float)
        Corner of cell (0, 0) [m]; a rolling costmap moves it.
    rolling : bool
        Whether the costmap follows the robot.
    track_unknown : bool
        Whether cells of which no layer knows anything are unknown; otherwise they are free.
    clock : callable, optional
        Gives the time [s] by which the layers are measured; None: they are not.

    Attributes
    ----------
    spent : dict of str to float
        Time that each layer took in the last update, by its name [s]; empty without a clock.
    drives_sideways : bool
        Whether the robot can drive to the side. If not, it needs half its width on each side of a plan: snapshots say
        so where the inscribed radius is less, because the footprint is not centred about the base frame's origin.
    least_clearance : float
        Distance from lethal cells that plans keep where there is no other way [m]; 0: the inscribed radius.
    """

    def __init__(self, frame: str, size: Tuple[float, float], resolution: float, origin: Tuple[float, float],
                 rolling: bool, track_unknown: bool, clock: Optional[Callable[[], float]] = None) -> None:
        self._clock = clock or (lambda: 0.0)
        self.spent: Dict[str, float] = {}
        self.rolling, self._default = rolling, NO_INFORMATION if track_unknown else FREE
        self.layers: List[Layer] = []
        self.lock = threading.RLock()         # of the layers; held during an update
        self._footprint: FloatArray = np.zeros((0, 2))
        shape = (max(1, int(round(size[1] / resolution))), max(1, int(round(size[0] / resolution))))
        self.master = Costmap.filled(shape, resolution, origin, self._default, frame)
        self.inscribed = self.circumscribed = 0.0
        self.drives_sideways, self.least_clearance = True, 0.0
        self._renewed, self._was_updated = True, False
        self._shown_lock = threading.Lock()     # so that a snapshot does not wait for an update
        self._shown, self._handed_out = self.master.copy(), True

    @property
    def footprint(self) -> FloatArray:
        """Padded footprint (K, 2) in the base frame [m]."""
        return self._footprint

    @property
    def is_updated(self) -> bool:
        """Whether there was an update since the start, the last change of size or the last map."""
        return self._was_updated

    def set_footprint(self, corners: FloatArray) -> None:
        """Take the padded footprint (K, 2) of the robot in the base frame [m]."""
        with self.lock:
            self._footprint = np.array(corners, float)
            self.inscribed, self.circumscribed = radii(self._footprint)
            for layer in self.layers:
                layer.set_footprint(self._footprint)

    def add(self, layer: Layer) -> None:
        """Append a layer; layers are updated in the order in which they are added."""
        with self.lock:
            layer.match(self.master)
            if len(self._footprint):
                layer.set_footprint(self._footprint)
            self.layers.append(layer)
            self._renewed = True

    def resize(self, shape: Tuple[int, int], resolution: float, origin: FloatArray) -> None:
        """Take another size, resolution and origin; what obstacle layers held is lost.

        Parameters
        ----------
        shape : (rows, columns)
        resolution : float
            [m]
        origin : (2,) float64
            [m]
        """
        with self.lock:
            self.master = Costmap.filled(shape, resolution, origin, self._default, self.master.frame)
            for layer in self.layers:
                layer.match(self.master)
            self._renewed, self._was_updated = True, False

    def _fit_static_map(self) -> None:
        """Take size, resolution and origin of the map, as costmap_2d does without a rolling window."""
        for layer in self.layers:
            if isinstance(layer, StaticLayer) and layer.map is not None and not self.rolling:
                found = layer.map
                if found.costs.shape != self.master.costs.shape or found.resolution != self.master.resolution \
                        or (found.origin != self.master.origin).any():
                    self.resize(found.shape, found.resolution, found.origin)
                return

    def _follow(self, pose: FloatArray) -> None:
        """Move the origin by whole cells so that the robot is in the middle."""
        master = self.master
        corner = pose[:2] - 0.5 * master.resolution * np.array([master.columns, master.rows])
        columns, rows = (int(math.floor(value + 1e-9)) for value in (corner - master.origin) / master.resolution)
        if rows == 0 and columns == 0:
            return
        self.master = shifted(master, rows, columns, self._default)
        for layer in self.layers:
            layer.shift(rows, columns)
        self._renewed = True

    def update(self, pose: FloatArray, now: float) -> Window:
        """Process what the layers have received.

        Parameters
        ----------
        pose : (3,) float64
            Robot in the global frame [m, m, rad].
        now : float
            [s]

        Returns
        -------
        Window
            Of the cells that were written.
        """
        with self.lock:
            if self.rolling:
                self._follow(pose)
            else:
                self._fit_static_map()
            window, self.spent = Window.empty(), {}
            for layer in self.layers:
                began = self._clock()
                window = layer.update_window(self.master, pose, window, now)
                self.spent[layer.name] = self._clock() - began
            if self._renewed:
                window, self._renewed = Window.whole(self.master), False
            if not window.is_empty:
                self.master.costs[window.slices] = self._default
                for layer in self.layers:
                    began = self._clock()
                    layer.update_costs(self.master, window)
                    self.spent[layer.name] += self._clock() - began
                self._show(window)
            self._was_updated = True
            return window

    def _show(self, window: Window) -> None:
        """Make the changes of a window visible to snapshots."""
        master = self.master
        with self._shown_lock:
            shown, handed_out = self._shown, self._handed_out
            if not handed_out and shown.costs.shape == master.costs.shape and (shown.origin == master.origin).all():
                shown.costs[window.slices] = master.costs[window.slices]
                return
        copy = master.copy()
        with self._shown_lock:
            self._shown, self._handed_out = copy, False

    def snapshot(self) -> Costmap:
        """Return the costmap after the last whole update; it never changes afterwards and must not be written to."""
        with self._shown_lock:
            self._handed_out = True
            return replace(self._shown, beside=self._beside(), least_clearance=self.least_clearance)

    def _beside(self) -> float:
        """Return half the robot's width where plans have to keep it free [m]; less than half a cell does not count."""
        if self.drives_sideways or not len(self._footprint):
            return 0.0
        half = half_width(self._footprint)
        return half if half - self.inscribed > 0.5 * self.master.resolution else 0.0

    def refresh(self) -> None:
        """Let the next update write all cells again, after a change of parameters or a new map."""
        with self.lock:
            self._renewed, self._was_updated = True, False

    def take_remarks(self) -> List[str]:
        """Return what layers want to have told, each sentence with the name of its layer in front, and forget it."""
        found = []
        for layer in self.layers:
            found += ["{}: {}".format(layer.name, sentence) for sentence in layer.remarks]
            layer.remarks.clear()
        return found

    def obstacle_layers(self) -> List[ObstacleLayer]:
        """Return the layers that hold obstacles."""
        return [layer for layer in self.layers if isinstance(layer, ObstacleLayer)]

    def static_layer(self) -> Optional[StaticLayer]:
        """Return the first static layer, or None."""
        return next((layer for layer in self.layers if isinstance(layer, StaticLayer)), None)

    def clear_area(self, names: List[str], pose: FloatArray, side: float, inside: bool) -> int:
        """Forget obstacles in a square around the robot, or outside of it.

        Parameters
        ----------
        names : list of str
            Layers.
        pose : (3,) float64
            Robot [m, m, rad].
        side : float
            Side of the square [m].
        inside : bool

        Returns
        -------
        int
            Number of occupied cells that were cleared.
        """
        with self.lock:
            half = 0.5 * side
            (top, left), (bottom, right) = self.master.cells(np.array([
                [pose[0] - half, pose[1] - half], [pose[0] + half, pose[1] + half]]))
            window = Window(int(top), int(bottom) + 1, int(left), int(right) + 1)
            return sum(layer.clear(window, inside) for layer in self.obstacle_layers() if layer.name in names)

    def reset(self) -> None:
        """Forget what sensors have told, in all layers."""
        with self.lock:
            for layer in self.layers:
                layer.reset()
            self._renewed = True
