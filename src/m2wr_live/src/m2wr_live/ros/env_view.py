# SPDX-License-Identifier: BSD-3-Clause
"""The live view of a Gymnasium environment: ``render_mode="human"`` of m2wr_sim. No ROS master is needed."""
from __future__ import annotations

import functools
import logging
import sys
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, List, Optional, Tuple

import numpy as np
from visualization_msgs.msg import MarkerArray

from m2wr_live.ros.node import find_mesh, make_pages
from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.scene.robot_model import RobotModel, read_looks
from m2wr_sim.geometry import compose
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_sim.ros.visual_markers import has_looks, visual_markers
from m2wr_sim.ros.world_markers import WorldMarkers, is_robot

if TYPE_CHECKING:
    from m2wr_sim.api import Sim, StepResult
    from m2wr_sim.geometry import Pose

WORLD, LASER = "world", "laser of the environment"      # frames; the first is fixed
MEASURE = 0.25              # s of wall time between two updates of the status
LATE = 0.5                  # s of wall time; a run that is later than this does not try to catch up


class EnvView:
    """Serves pages that watch an environment, which runs in real time at most.

    Parameters
    ----------
    sim : Sim
        Of the environment.
    name : str
        Of its robot.

    Raises
    ------
    ViewError
        If no address can be used or viser cannot be imported.
    """

    def __init__(self, sim: Sim, name: str) -> None:
        self._sim, self._name = sim, name
        self._scene = LiveScene()
        self._laser = _laser_of(sim.simulator.models[name].record)
        self._models: List[Any] = []
        self._contacts = 0
        self._due, self._measured = 0.0, 0.0
        _log_to_stderr()
        self._pages = make_pages("127.0.0.1", 0, "", self._scene, None, None)
        self._obstacles = obstacle_outlines(sim.world)
        self._markers = WorldMarkers(sim.simulator, self, WORLD, 0.0)       # type: ignore[arg-type]

    @property
    def pages(self) -> Any:
        """The pages."""
        return self._pages

    def publish(self, message: MarkerArray) -> None:
        """Take the markers of the world; called by its publisher.

        Parameters
        ----------
        message : visualization_msgs.msg.MarkerArray
        """
        self._scene.markers.update(message.markers)

    def begin(self, goal: Tuple[float, float]) -> None:
        """Start an episode.

        Parameters
        ----------
        goal : (2,) float
            Place that is marked [m].
        """
        self._scene.forget_run()
        self._scene.now = 0.0           # or the next step would forget the run again
        self._contacts, self._due = 0, 0.0
        self._scene.hits = [(float(goal[0]), float(goal[1]))]
        self._scene.state = "the mark is at ({:.2f}, {:.2f})".format(*goal)

    def take(self, result: StepResult) -> None:
        """Show the result of a step or a reset, and wait until it is due.

        Parameters
        ----------
        result : StepResult
        """
        scene = self._scene
        scene.take_time(result.time)
        self._markers.look()
        self._take_links()
        scene.update()
        scan = result.scan
        if scan is not None and self._laser is not None:
            link, mount = self._laser
            engine, robot = self._sim.simulator.engine, self._sim.simulator.models[self._name]
            scene.frames.set_pose(WORLD, LASER, *compose(engine.link_pose(robot.handle.links[link]), mount))
            scene.take_scan("/scan", SimpleNamespace(
                header=SimpleNamespace(frame_id=LASER), ranges=scan.ranges, angle_min=scan.angle_min,
                angle_increment=scan.angle_increment, range_min=scan.range_min, range_max=scan.range_max))
        self._contacts += len(result.contacts)
        scene.values = {"touches of " + self._name: str(self._contacts)}
        self._show(result.time)

    def _take_links(self) -> None:
        """Take the poses of all links, and the looks of models that are new."""
        engine, models = self._sim.simulator.engine, list(self._sim.simulator.models.values())
        if models != self._models:
            self._models = models
            shown = [model for model in models if has_looks(model.record)]
            self._scene.take_looks({model.name: _looks(model.name, model.record) for model in shown},
                                   [model.name for model in shown if is_robot(model.record)])
        names, poses = [], []
        for model in models:
            for link, handle in model.handle.links.items():
                position, orientation = engine.link_pose(handle)
                names.append("{}::{}".format(model.name, link))
                poses.append((*position, *orientation))
        self._scene.take_links(names, np.array(poses, float).reshape(-1, 7))

    def _show(self, simulated: float) -> None:
        """Draw, and wait until wall time has passed as simulated time has."""
        now = time.monotonic()
        if self._pages.server.pages:
            self._pages.draw()
        if now - self._measured > MEASURE:
            self._measured = now
            self._pages.measure(now, self._obstacles, False, [], {})
        begun = self._due or now - simulated
        ahead = begun + simulated - time.monotonic()
        self._due = begun if ahead > -LATE else now - simulated
        if ahead > 0.0:
            time.sleep(ahead)

    def draw(self) -> None:
        """Return None: pages show what :meth:`take` has taken."""

    def close(self) -> None:
        """Close all pages."""
        self._pages.server.stop()


def _looks(name: str, record: Any) -> Any:
    """Return a function that reads the looks of a model when they are first needed."""
    def read() -> RobotModel:
        return read_looks(name, visual_markers(name, record), find_mesh)
    return functools.lru_cache(maxsize=None)(read)


def _laser_of(record: Any) -> Optional[Tuple[str, Pose]]:
    """Return the link of a robot's first laser and its pose there, or None."""
    for link in record.links:
        for sensor in link.sensors:
            if sensor.ray is not None:
                return link.name, sensor.pose
    return None


def _log_to_stderr() -> None:
    """Show the address, and what goes wrong, in a program that has no log of its own."""
    own = logging.getLogger("m2wr_live")
    if not own.handlers and not logging.getLogger().handlers:
        own.addHandler(logging.StreamHandler(sys.stderr))
        own.setLevel(logging.INFO)
