# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel, or load it from its cache, in advance: ``python3 -m m2wr_sim.warm_up``."""
from __future__ import annotations

import numpy as np

from m2wr_sim.control import track_kernels as kernels
from m2wr_sim.geometry import IDENTITY
from m2wr_sim.model.types import Box, Collision, Link, Model, Plane, Sphere
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.physics.moved_links import MovedLink
from m2wr_sim.rendering import camera
from m2wr_sim.sensors import laser
from m2wr_sim.sensors.coverage_kernels import mark_crossed


def warm_up(engine_kind: str = "auto") -> None:
    """Run the kernels of rays, pictures and scripts and the loop of an engine once, on a small world."""
    laser.warm_up(np.random.default_rng(0))
    camera.warm_up()
    mark_crossed(np.ones(1), np.ones((1, 2)), 0.5, np.zeros(2), np.zeros((2, 2), bool), np.zeros((1, 1), np.int64))
    spans, tracks, points, motions = (np.zeros((0, columns)) for columns in (
        kernels.SPAN_COLUMNS, kernels.TRACK_COLUMNS, kernels.POINT_COLUMNS, kernels.MOTION_COLUMNS))
    kernels.advance(np.zeros((0, kernels.SCRIPT_COLUMNS), np.int64), spans, tracks, points, 1, 1, 1, 1.0, motions,
                    np.zeros(0, np.int64))
    engine = make_engine(engine_kind, EngineSettings())
    try:
        for name, geometry, static in (("floor", Plane(), True), ("box", Box((1.0, 1.0, 1.0)), False),
                                       ("ball", Sphere(0.5), False)):
            link = Link("link", collisions=(Collision("shape", geometry),))
            handle = engine.add_model(Model(name, (link,), static=static), IDENTITY)
        engine.step(2)
        engine.pose_reader([(handle.links["link"], IDENTITY)], np.zeros((1, 7)))()
        moved = engine.add_model(Model("moved", (Link("link", kinematic=True),), allow_auto_disable=False), IDENTITY)
        engine.link_mover([MovedLink(0, moved.links["link"], IDENTITY, IDENTITY[0])], np.zeros((1, 13)),
                          np.zeros(1, np.int64))()
        engine.motion_reader(handle.links["link"], IDENTITY, np.zeros(13))()
        if engine.compiled:
            _warm_up_batches()
    finally:
        engine.close()


def _warm_up_batches() -> None:
    """Run the kernels of batched environments, which need a compiled engine."""
    from m2wr_sim.api import quiet_kernels
    rows, none, pairs = np.zeros((0, quiet_kernels.QUIET_WORDS), np.uint64), np.zeros(0, np.int64), np.zeros((0, 2))
    quiet_kernels.drive_all(rows, none, pairs.astype(np.int64), pairs, pairs.astype(np.int64))
    quiet_kernels.read_all(rows, none)
    quiet_kernels.scan_all(rows, none)


def main() -> None:
    """Compile all kernels and report the progress."""
    try:
        from m2wr_node.kernel_progress import KernelProgress
    except ImportError:     # m2wr_node may not be built yet
        warm_up()
        return
    with KernelProgress("m2wr_sim"):
        warm_up()


if __name__ == "__main__":
    main()
