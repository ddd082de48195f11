# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the shapes of the ray scene where the engine has their links."""
from __future__ import annotations

from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.geometry import compose
from m2wr_sim.model.types import Plane

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.physics.engine import Engine
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.sensors.ray_scene import RayScene

#: Row of the scene, the engine's number of the link, pose of the shape in the link frame.
Part = Tuple[int, int, "Pose"]


class SceneRows:
    """Rows of the ray scene, and how to update them.

    Parameters
    ----------
    parts : sequence of (int, int, pose)
        Row, the engine's number of the link, pose of the shape in the link frame.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = parts
        self._read: Optional[Callable[[], None]] = None
        self._move: Optional[Callable[[], None]] = None

    def functions(self, engine: Engine, scene: RayScene) -> Tuple[Callable[[], None], Callable[[], None]]:
        """Return the functions that read the present poses, and that write them into the scene.

        Parameters
        ----------
        engine : Engine
        scene : RayScene
        """
        if self._read is None or self._move is None:
            poses = np.zeros((len(self.parts), 7))
            self._read = engine.pose_reader([part[1:] for part in self.parts], poses)
            self._move = scene.mover(np.array([part[0] for part in self.parts], dtype=np.int64), poses)
        return self._read, self._move

    def refresh(self, engine: Engine, scene: RayScene) -> None:
        """Write the present poses into the scene.

        Parameters
        ----------
        engine : Engine
        scene : RayScene
        """
        read, move = self.functions(engine, scene)
        read()
        move()


class SceneUpdate:
    """The shapes of all models in the ray scene.

    The shapes of moving links are updated together.  Those of a static link are updated only after it was moved from
    outside.  Infinite planes never move.

    Parameters
    ----------
    engine : Engine
    scene : RayScene
    """

    def __init__(self, engine: Engine, scene: RayScene) -> None:
        self._engine, self._scene = engine, scene
        self._shown: Optional[int] = None               # the engine's version that the scene shows
        self._moving: Dict[str, List[Part]] = {}        # model -> parts on its moving links, in load order
        self._moving_rows: Optional[SceneRows] = None   # all of these, None after a change
        self._resting: Dict[int, SceneRows] = {}        # static link -> rows of its shapes

    def add(self, model: LiveModel) -> None:
        """Add the shapes of a model that the engine has."""
        moving: List[Part] = []
        resting: Dict[int, List[Part]] = {}
        parts = self._engine.collisions(model.handle)
        poses = {link: self._engine.link_pose(link) for link, _, _ in parts}
        rows = self._scene.add_all([(collision.geometry, compose(poses[link], collision.pose), collision.laser_retro)
                                    for link, collision, _ in parts], model.name)
        for row, (link, collision, moves) in zip(rows, parts):
            if moves:
                moving.append((row, link, collision.pose))
            elif model.record.static and not isinstance(collision.geometry, Plane):
                resting.setdefault(link, []).append((row, link, collision.pose))
        self._moving[model.name] = moving
        if moving:
            self._scene.mark_moving([part[0] for part in moving])
        self._resting.update((link, SceneRows(parts)) for link, parts in resting.items())
        self._moving_rows = None

    def hide(self, name: str) -> None:
        """Remove the shapes of a model whose links the engine keeps for now; :meth:`remove` must follow."""
        self._scene.remove_owner(name)
        self._moving[name] = []
        self._moving_rows = None

    def remove(self, model: LiveModel) -> None:
        """Remove the shapes of a model."""
        self._scene.remove_owner(model.name)
        self._moving.pop(model.name, None)
        for link in model.handle.links.values():
            self._resting.pop(link, None)
        self._moving_rows = None

    def moving_shapes(self) -> Optional[Tuple[Callable[[], None], Callable[[], None]]]:
        """Return the functions for all shapes of moving links, see :meth:`SceneRows.functions`; None if there are none.

        The scene is up to date afterwards.
        """
        self.refresh()
        rows = self._moving_rows
        return rows.functions(self._engine, self._scene) if rows is not None and rows.parts else None

    def refresh(self) -> None:
        """Update the poses in the scene if a link may have moved."""
        engine, shown = self._engine, self._shown
        if self._moving_rows is None:
            self._moving_rows = SceneRows([part for parts in self._moving.values() for part in parts])
        elif shown == engine.version:
            return
        for link in engine.placed_since(-1 if shown is None else shown):
            rows = self._resting.get(link)
            if rows is not None:
                rows.refresh(engine, self._scene)
        self._moving_rows.refresh(engine, self._scene)
        self._shown = engine.version
