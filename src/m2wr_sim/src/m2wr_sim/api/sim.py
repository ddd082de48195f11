# SPDX-License-Identifier: BSD-3-Clause
"""One world with its robots, stepped by calls; the same numbers as the node, without ROS running."""
from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.api.devices import SENSING, DirectCamera, DirectDrive, DirectLaser, DirectSimulator, SilentPorts
from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.api.records import Contact, Observation, Picture, StepResult
from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.errors import NotFoundError, ParameterError
from m2wr_sim.geometry import compose, quaternion_from_rpy
from m2wr_sim.model.types import RayScan
from m2wr_sim.physics.engine import settings_from_physics, whole_step
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.runtime.entities import list_names
from m2wr_sim.runtime.limits import check_pose
from m2wr_sim.runtime.once_logger import OnceLogger, suppress_warnings
from m2wr_sim.runtime.simulator import SimConfig
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene

if TYPE_CHECKING:
    import os

    import numpy.typing as npt

    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.types import Model, World

#: (x, y, yaw) or (x, y, z, yaw) [m, rad], or ((x, y, z), (x, y, z, w)).
PoseInput = Union[Sequence[float], Tuple[Sequence[float], Sequence[float]]]

_NO_CLOCK = 1e-9                # Hz; no subscriber needs a clock, and its ticks would interrupt sequences of steps
_STANDING = 0.1                 # m: height of m2wr's chassis when it stands on the floor
_CLEARANCE_RAYS = 360

_ONCE_LOGGER = OnceLogger()     # of all simulations of the process, so that remarks on a robot are logged once

# libode shares its thread data between all worlds of a process; two steps at a time end in a failed assertion
ONE_STEPS = threading.Lock()


class Sim:
    """A world in which robots drive and sense.

    The methods of one simulation must be called from one thread at a time.  Steps of several simulations in one process
    wait for one another; to run simulations in parallel, use processes.

    The same world, robots, seed, commands and durations give the same numbers, to the last bit, after every
    :meth:`reset`, in every process and with both engines.  They are the numbers that the node publishes.

    Parameters
    ----------
    world : World, str or Path
        See :func:`~m2wr_sim.api.loading.read_world`.
    robot : Model, str or Path, optional
        A robot that is spawned at once, see :meth:`spawn`.
    pose : tuple, optional
        Its pose: (x, y, yaw) [m, rad], or as in :meth:`spawn`.
    seed : int
        Of all sensor noise.
    sensing : str
        ``due``: odometry and scans at the rates of the robot's description, as the node publishes them;
        ``now``: both are measured at the end of each step and at a reset, lasers at no other time;
        ``off``: no scans, odometry as in ``due``.
    step : float, optional
        Physics step [s]; None: that of the world.
    engine, solver : str
        As the node's parameters: ``auto``, ``native`` or ``pyode``; ``step`` or ``quick``.  With ``quick``, all
        simulations of a process share one random sequence; only all of them together can be repeated.
    wheel_convention : str
        Which wheel is left: ``rep103`` (by the positions of the wheels: positive angular commands turn left),
        ``noetic`` or ``kinetic``, see docs/explanation/turning.md.
    command_timeout : float
        A robot stops when it has received no command for this time [s]; 0: the last command stays active.

    Attributes
    ----------
    simulator : DirectSimulator
        The underlying simulation, for everything that has no method here.

    Raises
    ------
    WorldError, ModelError
        If the world or the robot cannot be used.
    ParameterError
        If an option has an unusable value.
    """

    def __init__(self, world: Union[World, str, os.PathLike[str]] = "empty",
                 robot: Optional[Union[Model, str, os.PathLike[str]]] = None, pose: PoseInput = (0.0, 0.0, 0.0),
                 seed: int = 0, sensing: str = "due", step: Optional[float] = None, engine: str = "auto",
                 solver: str = "step", wheel_convention: str = "rep103", command_timeout: float = 0.0) -> None:
        _check_choice("sensing", sensing, SENSING)
        _check_choice("wheel_convention", wheel_convention, CONVENTIONS)
        _check_choice("solver", solver, ("step", "quick"))
        if not 0.0 <= command_timeout < math.inf:
            raise ParameterError("command_timeout is %r s; expected a finite number of at least 0" % (command_timeout,))
        self.world, self.sensing = read_world(world), sensing
        self._simulator: Optional[DirectSimulator] = None
        step = self.world.physics.max_step_size if step is None else step
        config = SimConfig(seed=_checked_seed(seed), clock_rate=_NO_CLOCK, wheel_convention=wheel_convention,
                           command_timeout_ns=int(round(command_timeout * 1e9)), once_logger=_ONCE_LOGGER,
                           loss_ends=True)
        settings = settings_from_physics(self.world.physics, whole_step(step, "world %s" % self.world.name), solver)
        self._simulator = DirectSimulator(make_engine(engine, settings), RayScene(), SilentPorts(), config)
        self._robots: Dict[str, Tuple[Optional[DirectDrive], Tuple[DirectLaser, ...]]] = {}
        self._start_ns = 0
        self._spawned: List[Model] = []
        self._surveyor: Optional[LaserSensor] = None            # measures clearances
        try:
            self._simulator.engine.reseed(config.seed)
            self._simulator.load_world(self.world)
            self._start_ns = self._simulator.now_ns
            if robot is not None:
                self.spawn(robot, pose)
        except Exception:
            self.close()
            raise

    # ---- robots and models --------------------------------------------------------------------------------------

    @property
    def simulator(self) -> DirectSimulator:
        """The underlying simulation; RuntimeError after :meth:`close`."""
        if self._simulator is None:
            raise RuntimeError("this simulation is closed")
        return self._simulator

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.simulator.now_ns / 1e9

    @property
    def step_size(self) -> float:
        """Physics step [s]."""
        return self.simulator.step_ns / 1e9

    @property
    def robots(self) -> Tuple[str, ...]:
        """Names of the spawned models, in the order of spawning."""
        return tuple(self._robots)

    @property
    def models(self) -> Tuple[str, ...]:
        """Names of all models, those of the world file first."""
        return tuple(self.simulator.models)

    def spawn(self, robot: Union[Model, str, os.PathLike[str]] = "m2wr", pose: PoseInput = (0.0, 0.0, 0.0),
              name: Optional[str] = None) -> str:
        """Add a robot, or any other model, to the world; a reset moves it to the same pose.

        Parameters
        ----------
        robot : Model, str or Path
            See :func:`~m2wr_sim.api.loading.read_robot`.
        pose : tuple
            (x, y, yaw) or (x, y, z, yaw) [m, rad], or a full pose ((x, y, z), (x, y, z, w)).  The default of z is
            0.1 m, the height at which m2wr stands.
        name : str, optional
            None: that of the model.

        Returns
        -------
        str
            Its name, for all other methods.

        Raises
        ------
        ModelError
            If it cannot be read or built, or the name is taken.
        """
        record = read_robot(robot)
        with suppress_warnings(record in self._spawned):
            model = self.simulator.spawn(record, compose(_full_pose(pose), record.pose), name)
        self._spawned.append(record)
        drives = self.simulator.devices(model.name, DirectDrive)
        lasers = self.simulator.devices(model.name, DirectLaser)
        for drive in drives:
            drive.timely = self.sensing != "now"
        for laser in lasers:
            laser.enabled = self.sensing == "due"
        self._robots[model.name] = (drives[0] if drives else None, tuple(lasers))
        if self.sensing == "now":
            self.measure(model.name)            # as after a reset, so that the noise is the same
        return model.name

    def delete(self, name: str) -> None:
        """Remove a model, also one of the world file; NotFoundError if there is none of that name."""
        self.simulator.delete(name)
        self._robots.pop(name, None)

    def drive(self, name: Optional[str] = None) -> DirectDrive:
        """Return the :class:`~m2wr_sim.api.devices.DirectDrive` of a robot, by default of the only one."""
        name = self._name(name)
        drive = self._robots[name][0]
        if drive is None:
            raise NotFoundError("\"%s\" has no differential drive that can be commanded" % name)
        return drive

    def lasers(self, name: Optional[str] = None) -> Tuple[DirectLaser, ...]:
        """Return the :class:`~m2wr_sim.api.devices.DirectLaser` objects of a robot, by default of the only one."""
        return self._robots[self._name(name)][1]

    def cameras(self, name: Optional[str] = None) -> Tuple[DirectCamera, ...]:
        """Return the :class:`~m2wr_sim.api.devices.DirectCamera` objects of a robot, by default of the only one."""
        return tuple(self.simulator.devices(self._name(name), DirectCamera))

    def picture(self, name: Optional[str] = None, camera: int = 0) -> Picture:
        """Take a picture now.

        Parameters
        ----------
        name : str, optional
            None: the only robot.
        camera : int
            Which of the robot's cameras.

        Returns
        -------
        Picture

        Raises
        ------
        NotFoundError
            If there is no such robot or camera.
        """
        cameras = self.cameras(name)
        if not 0 <= camera < len(cameras):
            raise NotFoundError("\"%s\" has no camera %d; cameras: %s" % (
                self._name(name), camera, list_names(each.name for each in cameras)))
        return cameras[camera].measure_now(self.simulator.now_ns)

    def _name(self, name: Optional[str]) -> str:
        if name is None and len(self._robots) == 1:
            return next(iter(self._robots))
        if name is None or name not in self._robots:
            raise NotFoundError("%s; robots: %s" % ("which robot is meant?" if name is None
                                                    else "there is no robot \"%s\"" % name, list_names(self._robots)))
        return name

    # ---- time --------------------------------------------------------------------------------------------------

    def step(self, command: Optional[Union[Mapping[str, Sequence[float]], npt.ArrayLike]] = None,
             duration: float = 0.05) -> StepResult:
        """Drive for some simulated time.

        Parameters
        ----------
        command : (float, float), dict or array_like, optional
            Linear [m/s] and angular [rad/s] velocity for the only robot; ``{name: (linear, angular)}`` for some; or
            (robots, 2) for all with a drive, in the order of spawning.  None: the last commands stay active.  A
            command takes effect at the next update of the robot's drive; one that is not finite is rejected.
        duration : float
            Simulated time [s], rounded to whole physics steps.

        Returns
        -------
        StepResult

        Raises
        ------
        ValueError
            If the duration is not at least one physics step, or commands and robots do not match in number.
        NotFoundError
            If a command is for a robot that does not exist or has no drive.
        """
        simulator = self.simulator
        count = duration * 1e9 / simulator.step_ns
        if not 0.5 < count < math.inf:
            raise ValueError("step of %r s; expected at least one physics step of %g s" % (duration, self.step_size))
        if command is not None:
            self._take(command)
        end_ns = simulator.now_ns + int(round(count)) * simulator.step_ns
        lazily = self.sensing == "now" and not self._has_callbacks()
        with ONE_STEPS:
            while simulator.now_ns < end_ns:
                simulator.advance(end_ns, lazily)
            if lazily:
                simulator.settle()
        if self.sensing == "now":
            self.measure()
        return self.observe()

    def _has_callbacks(self) -> bool:
        """Return whether code of the user, which may change the world, runs between two physics steps."""
        return any(drive is not None and drive.callbacks or any(laser.callbacks for laser in lasers)
                   for drive, lasers in self._robots.values())

    def _take(self, command: Union[Mapping[str, Sequence[float]], npt.ArrayLike]) -> None:
        if isinstance(command, Mapping):
            for name, (linear, angular) in command.items():
                self.drive(name).command(float(linear), float(angular))
            return
        values = np.asarray(command, dtype=float)
        drives = [drive for drive, _ in self._robots.values() if drive is not None]
        if values.shape == (2,):
            values = values[None, :]
        if values.shape != (len(drives), 2):
            raise ValueError("commands of shape %s for %d robots with a drive; expected one pair (linear, angular) for "
                             "each" % (np.shape(command), len(drives)))
        for drive, (linear, angular) in zip(drives, values.tolist()):
            drive.command(linear, angular)

    def measure(self, name: Optional[str] = None) -> None:
        """Measure odometry and scan of one robot, or of all, now instead of when they are due."""
        now_ns = self.simulator.now_ns
        for drive, lasers in ([self._robots[self._name(name)]] if name is not None else self._robots.values()):
            if drive is not None:
                drive.measure_now(now_ns)
            for laser in lasers:
                laser.measure_now(now_ns)

    def observe(self) -> StepResult:
        """Return the state of all robots; each contact is reported once."""
        simulator = self.simulator
        contacts, simulator.contacts = simulator.contacts, []
        begun = tuple(Contact((self._start_ns + contact.step * simulator.step_ns) / 1e9, contact.first, contact.second,
                              contact.position, contact.depth) for contact in contacts)
        robots = {}
        for name, (drive, lasers) in self._robots.items():
            position, orientation = simulator.models[name].pose(simulator.engine)
            robots[name] = Observation(
                position, orientation, None if drive is None else drive.odometry, lasers[0].scan if lasers else None,
                tuple(contact for contact in begun if contact.concerns(name)) if begun else ())
        return StepResult(simulator.now_ns / 1e9, robots)

    def reset(self, seed: Optional[int] = None,
              poses: Optional[Union[Mapping[str, PoseInput], PoseInput]] = None) -> StepResult:
        """Restart with the present models; time, poses, joints, motors and noise have their initial state.

        Parameters
        ----------
        seed : int, optional
            A new seed; None: the old one.
        poses : dict or tuple, optional
            New initial poses, ``{name: pose}`` or the pose of the only robot; as in :meth:`spawn`.

        Returns
        -------
        StepResult

        Raises
        ------
        NotFoundError, ModelError, ParameterError
            If a robot does not exist, a pose is too far from the origin, or the seed is invalid.  Then nothing
            changes.
        """
        simulator = self.simulator
        if isinstance(poses, Mapping):
            given = [(self._name(name), pose) for name, pose in poses.items()]
        else:
            given = [] if poses is None else [(self._name(None), poses)]
        models = [(simulator.models[name], _full_pose(pose)) for name, pose in given]
        seed = simulator.config.seed if seed is None else _checked_seed(seed)
        for model, pose in models:
            check_pose(model.name, pose)
        for model, pose in models:
            model.reset_pose = compose(pose, model.record.pose)
        simulator.config = replace(simulator.config, seed=seed)
        simulator.reset_simulation()
        if self.world.state is not None:
            simulator.apply_state(self.world.state)
        if self.sensing == "now":
            self.measure()
        return self.observe()

    # ---- state of models ---------------------------------------------------------------------------------------

    def pose(self, name: Optional[str] = None) -> Pose:
        """Return a model's ``((x, y, z), (x, y, z, w))`` in the world [m]; by default of the only robot."""
        name = self._name(None) if name is None else name
        state = self.simulator.model_state(name)
        return state.position, state.orientation

    def velocity(self, name: Optional[str] = None) -> Tuple[Vector, Vector]:
        """Return a model's linear [m/s] and angular [rad/s] velocity in world axes; by default of the only robot."""
        name = self._name(None) if name is None else name
        state = self.simulator.model_state(name)
        return state.linear, state.angular

    def set_pose(self, pose: PoseInput, name: Optional[str] = None) -> None:
        """Move a model to a pose, at rest.  The command of a robot stays active.

        Parameters
        ----------
        pose : tuple
            As in :meth:`spawn`.
        name : str, optional
            None: the only robot.
        """
        name = self._name(None) if name is None else name
        self.simulator.set_model_state(name, _full_pose(pose), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def joint_positions(self, name: Optional[str] = None) -> Dict[str, float]:
        """Return ``{joint: position}`` of a model [rad or m]; by default of the only robot."""
        name = self._name(None) if name is None else name
        self.simulator.model_state(name)        # NotFoundError if there is no such model
        handle = self.simulator.models[name].handle
        return {joint: self.simulator.engine.joint_angle(number) for joint, number in handle.joints.items()}

    def contact_count(self, name: Optional[str] = None) -> int:
        """Return how many contacts of a robot have begun since the start, except with the ground."""
        return self.simulator.contact_counts.get(self._name(name), 0)

    def clearance(self, x: float, y: float, height: float = 0.2, reach: float = 10.0,
                  ignore: Optional[str] = None) -> float:
        """Return the distance [m] from a point to the nearest shape in the horizontal plane, robots included.

        It is measured by 360 rays.  Inside a shape the rays end at its far sides.

        Parameters
        ----------
        x, y, height : float
            The point in the world [m].
        reach : float
            Greatest distance [m]; returned if nothing is nearer.
        ignore : str, optional
            Name of a model that the rays do not hit.
        """
        if self._surveyor is None or self._surveyor.range_max != reach:
            half = math.pi * (1.0 - 1.0 / _CLEARANCE_RAYS)
            self._surveyor = LaserSensor(RayScan(samples=_CLEARANCE_RAYS, min_angle=-half, max_angle=half,
                                                 range_max=float(reach)), np.random.default_rng(0))
        self.simulator.refresh_scene()
        ranges, _ = self._surveyor.cast(self.simulator.scene, ((x, y, height), (0.0, 0.0, 0.0, 1.0)), ignore)
        return min(float(ranges.min()), float(reach))

    # ---- end ---------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Free the world; afterwards only this method may be called."""
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def __enter__(self) -> Sim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    if value not in choices:
        raise ParameterError("%s is %r; expected one of %s" % (name, value, ", ".join(choices)))


def _checked_seed(seed: Any) -> int:
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ParameterError("seed is %r; expected a whole number, not below 0" % (seed,))
    return int(seed)


def _full_pose(pose: PoseInput) -> Pose:
    """Return ((x, y, z), (x, y, z, w)) of any of the forms that :meth:`Sim.spawn` takes."""
    try:
        parts: Tuple[Any, ...] = tuple(pose)
        if len(parts) == 2:
            x, y, z = map(float, parts[0])
            qx, qy, qz, qw = map(float, parts[1])
            orientation = (qx, qy, qz, qw)
        else:
            x, y, *height, yaw = map(float, parts)
            (z,) = height or (_STANDING,)
            orientation = quaternion_from_rpy(0.0, 0.0, yaw)
        if all(map(math.isfinite, (x, y, z) + orientation)):
            return (x, y, z), orientation
    except (TypeError, ValueError):
        pass
    raise ValueError("pose %r; expected finite numbers (x, y, yaw), (x, y, z, yaw) or ((x, y, z), (x, y, z, w))"
                     % (pose,))
