# SPDX-License-Identifier: BSD-3-Clause
"""Physics and scans without ROS: measures the time for a simulated second and its parts."""
from __future__ import annotations

import contextlib
import gc
import logging
import statistics
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Optional, Tuple

import numpy as np

from m2wr_sim.control.diff_drive import wheel_speeds
from m2wr_sim.errors import SimError
from m2wr_sim.geometry import compose
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.physics.engine import settings_from_physics
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.physics.native_engine import NativeEngine
from m2wr_sim.plugins.base import Plugin
from m2wr_sim.process_memory import memory_mb
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.schedule import SensorSchedule
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_tools.benchmark import reference

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array
    from m2wr_sim.geometry import Vector
    from m2wr_sim.model.types import Model, Sensor, World
    from m2wr_sim.physics.engine import EngineSettings

FORCE = 5.0                     # N m
_CLOCK_RATE = 1.0               # Hz; without a subscriber
_PARTS = 10                     # number of parts of a run that are timed
_SETTLING_NS = 500000000


@dataclass(frozen=True)
class Case:
    """A case to measure; times in seconds."""

    world: World
    robots: int = 1
    step: float = 0.001
    beams: int = 720
    duration: float = 20.0
    engine: str = "auto"

    @property
    def step_ns(self) -> int:
        """The step in whole nanoseconds."""
        return int(round(self.step * 1e9))


def robot_model(beams: int) -> Model:
    """Return the record of the reference robot."""
    return load_sdf_models(reference.robot_sdf(beams))[0]


def motor_rates() -> Dict[str, float]:
    """Return the rotation rate of each wheel [rad/s] for the circle."""
    left, right = wheel_speeds(reference.LINEAR, reference.ANGULAR, reference.TRACK, False)
    return {"left": left / reference.WHEEL_RADIUS, "right": right / reference.WHEEL_RADIUS}


def reading_cost() -> float:
    """Return the processor time [s] between two successive readings of the clock."""
    readings = [time.process_time() for _ in range(201)]
    return statistics.median(later - earlier for earlier, later in zip(readings, readings[1:]))


class Stopwatch:
    """Sums up the processor time spent in a method of ``owner``, which it replaces.

    The time for reading the clock, a twentieth of a scan, is subtracted.
    """

    def __init__(self, owner: object, name: str) -> None:
        self.seconds, self.calls, self._cost = 0.0, 0, reading_cost()
        self._owner, self._name, self._function = owner, name, getattr(owner, name)
        setattr(owner, name, self._timed)

    def _timed(self, *arguments: Any) -> Any:
        start = time.process_time()
        try:
            return self._function(*arguments)
        finally:
            self.seconds += time.process_time() - start - self._cost
            self.calls += 1

    def remove(self) -> None:
        """Restore the method."""
        delattr(self._owner, self._name)


class _Scanner(Plugin):
    """One robot's laser: casts rays at its rate and stores the last scan."""

    def __init__(self, simulator: Simulator, model: Any, sensor: Sensor, seed: int) -> None:
        self._simulator = simulator
        if sensor.ray is None:
            raise SimError("sensor \"%s\" of the robot has no rays" % sensor.name)
        self.laser = LaserSensor(sensor.ray, np.random.default_rng(seed))
        link = model.handle.links[model.record.links[0].name]
        self._look = simulator.engine.pose_reader([(link, sensor.pose)], self.laser.pose)
        self._schedule = SensorSchedule(sensor.update_rate)
        self.ranges: Optional[Float32Array] = None

    def configure(self, spec: Any, ctx: Any) -> None:
        """Do nothing: there is no tag for this plugin."""

    def next_after(self, now_ns: int) -> Optional[int]:
        return self._schedule.next_due(now_ns, self._simulator.step_ns)

    def after_step(self, now_ns: int) -> None:
        if self._schedule.due(now_ns):
            simulator = self._simulator
            simulator.refresh_scene()
            self._look()
            self.ranges = self.laser.cast(simulator.scene)[0]


def build(case: Case) -> Tuple[Simulator, List[_Scanner]]:
    """Return a simulator with driving robots, and their lasers; no plugin of the robots runs."""
    engine = make_engine(case.engine, settings_from_physics(case.world.physics, case.step_ns))
    engine.reseed(0)
    simulator = Simulator(engine, RayScene(), LocalPorts(), SimConfig(clock_rate=_CLOCK_RATE, joint_states=False))
    simulator.load_world(case.world)
    record = robot_model(case.beams)
    scanners: List[_Scanner] = []
    sensor = record.links[0].sensors[0]
    chassis = replace(record.links[0], sensors=(replace(sensor, plugins=()),))
    record = replace(record, links=(chassis,) + record.links[1:], plugins=())
    for index, place in enumerate(reference.robot_places(case.robots)):
        model = simulator.spawn(record, (place, (0.0, 0.0, 0.0, 1.0)), "robot%d" % index)
        for joint, rate in motor_rates().items():
            engine.set_joint_motor(model.handle.joints[joint], rate, FORCE)
        scanners.append(_Scanner(simulator, model, sensor, index))
        simulator.add_observer(scanners[-1], "scanner of robot%d" % index)
    return simulator, scanners


def time_engine(case: Case, steps: int, bounds: bool = True) -> Tuple[float, Vector, EngineSettings]:
    """Measure the engine alone, as the loop in C is measured.

    Parameters
    ----------
    case : Case
        The case; its world is loaded.
    steps : int
        Number of steps.
    bounds : bool
        Whether to use broad-phase bounds, which the loop in C does not have.

    Returns
    -------
    float, tuple, EngineSettings
        Processor time of a step [us]; where the centre of mass of the first robot's first link ends; the settings.
    """
    settings = settings_from_physics(case.world.physics, case.step_ns)
    engine, record = make_engine(case.engine, settings), robot_model(case.beams)
    if isinstance(engine, NativeEngine):
        engine.broad_phase_bounds = bounds
    try:
        for model in case.world.models:
            engine.add_model(model, model.pose)
        handles = []
        for index, place in enumerate(reference.robot_places(case.robots)):
            handles.append(engine.add_model(record, (place, (0.0, 0.0, 0.0, 1.0)), "robot%d" % index))
            for joint, rate in motor_rates().items():
                engine.set_joint_motor(handles[-1].joints[joint], rate, FORCE)
        engine.step(1)                          # prepares the arrays of the loop
        start = time.process_time()
        engine.step(steps - 1)
        seconds = time.process_time() - start
        link = record.links[0]
        position = compose(engine.link_pose(handles[0].links[link.name]), link.inertial.pose)[0]
        return 1e6 * seconds / (steps - 1), position, settings
    finally:
        engine.close()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the warnings while a world is loaded."""
    logger = logging.getLogger("m2wr_sim")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def run_until(simulator: Simulator, until_ns: int) -> None:
    """Advance the simulation by whole steps.

    Parameters
    ----------
    simulator : m2wr_sim.runtime.simulator.Simulator
        Not paused.
    until_ns : int
        Simulated time not to be exceeded [ns].
    """
    while simulator.now_ns + simulator.step_ns <= until_ns:
        simulator.advance(until_ns)


def measure(case: Case, progress: Callable[[float], object] = lambda share: None) -> Dict[str, Any]:
    """Measure a case.

    Parameters
    ----------
    case : Case
    progress : callable
        Called with the completed share, 0 to 1.

    Returns
    -------
    dict
        ``factor``: simulated seconds per second of processor time, median of the parts; ``wall_factor``: the same for
        wall time; ``step_us``, ``scan_us``: one physics step (all robots) and one scan (one robot);
        ``physics_share``, ``scan_share``: of the time; ``messages``: of the solver; ``contacts``; ``memory_mb``: peak
        of the process.
    """
    with _quiet():
        simulator, scanners = build(case)
    try:
        run_until(simulator, _SETTLING_NS)
        messages, part_ns = simulator.engine.solver_messages, int(case.duration * 1e9 / _PARTS)
        cpu, wall = [], []
        gc.collect()
        for part in range(_PARTS):
            start = time.process_time(), time.perf_counter()
            first_ns = simulator.now_ns
            run_until(simulator, first_ns + part_ns)
            seconds = (simulator.now_ns - first_ns) * 1e-9
            cpu.append(seconds / max(1e-9, time.process_time() - start[0]))
            wall.append(seconds / max(1e-9, time.perf_counter() - start[1]))
            progress(0.7 * (part + 1) / _PARTS)
        result = _split(simulator, scanners, int(0.3 * case.duration * 1e9))
        progress(1.0)
        result.update(factor=statistics.median(cpu), wall_factor=statistics.median(wall),
                      messages=simulator.engine.solver_messages - messages,
                      contacts=sum(simulator.contact_counts.values()),
                      memory_mb=memory_mb("VmHWM"))
        return result
    finally:
        simulator.close()


def _split(simulator: Simulator, scanners: List[_Scanner], span_ns: int) -> Dict[str, Any]:
    """Continue with stopwatches on the engine and the rays; return the time for each."""
    physics = Stopwatch(simulator.engine, "step")
    rays = [Stopwatch(scanner.laser, "cast") for scanner in scanners]
    steps, start = simulator.steps, time.process_time()
    run_until(simulator, simulator.now_ns + max(span_ns, 200000000))
    total, steps = time.process_time() - start, simulator.steps - steps
    for watch in [physics] + rays:
        watch.remove()
    seconds, scans = sum(watch.seconds for watch in rays), sum(watch.calls for watch in rays)
    return {"step_us": 1e6 * physics.seconds / steps, "scan_us": 1e6 * seconds / max(1, scans),
            "physics_share": physics.seconds / total, "scan_share": seconds / total}
