# SPDX-License-Identifier: BSD-3-Clause
"""Images of a Gymnasium environment, by the renderer of m2wr_view; no ROS node runs."""
from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_sim.geometry import IDENTITY, compose
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_sim.model.types import World
from m2wr_view.frames import matrix_of
from m2wr_view.renderer import Renderer
from m2wr_view.scene import Scene

if TYPE_CHECKING:
    import numpy.typing as npt

    from m2wr_sim.api.records import StepResult
    from m2wr_sim.api.sim import Sim

_BASE, _LASER = "base", "laser"
SIZE = 800              # pixels, width and height


class EnvPicture:
    """Draws one robot in its world from above: obstacles of the world file, trail, scan and goal.

    Call :meth:`begin` first.

    Parameters
    ----------
    sim : m2wr_sim.api.sim.Sim
    name : str
        Name of the robot.
    """

    def __init__(self, sim: Sim, name: str) -> None:
        self._sim, self._name = sim, name
        self._record = sim.simulator.models[name].record
        self._footprint = obstacle_outlines(World(models=(replace(self._record, pose=IDENTITY, static=True),)),
                                            -math.inf, math.inf)

    def begin(self, goal: Tuple[float, float]) -> None:
        """Start the images of an episode; ``goal`` is (x, y) in the world [m]."""
        self._renderer = Renderer(SIZE, SIZE)           # a new one, because a renderer caches its scene
        scene = self._scene = Scene()
        scene.solids.blocking = obstacle_outlines(self._sim.world)
        scene.footprint = self._footprint or scene.footprint
        scene.line = [(float(goal[0]), float(goal[1]))]
        scene.base_frame = _BASE
        for link in self._record.links:
            for sensor in link.sensors:
                if sensor.ray is not None:
                    scene.frames.set(_BASE, _LASER, matrix_of(*compose(link.pose, sensor.pose)))
                    return

    def take(self, result: StepResult) -> None:
        """Update the image with the result of a step or a reset."""
        self._scene.place(result.time, result.pose)
        scan = result.scan
        if scan is not None:
            stamp = result.time
            self._scene.scan = SimpleNamespace(
                header=SimpleNamespace(stamp=SimpleNamespace(to_sec=lambda: stamp), frame_id=_LASER),
                ranges=scan.ranges.tolist(), angle_min=scan.angle_min, angle_increment=scan.angle_increment,
                range_min=scan.range_min, range_max=scan.range_max)

    def draw(self) -> npt.NDArray[np.uint8]:
        """Return the image, (SIZE, SIZE, 3) uint8, top row first."""
        return np.array(self._renderer.draw(self._scene).convert("RGB"), dtype=np.uint8)

    def close(self) -> None:
        """Do nothing: images need nothing that has to be freed."""
