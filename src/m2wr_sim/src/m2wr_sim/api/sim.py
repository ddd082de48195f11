# SPDX-License-Identifier: BSD-3-Clause
"""One world with its robots, stepped by calls; the same numbers as the node, without ROS running."""
import math
import threading
from dataclasses import replace

import numpy as np

from m2wr_sim.api.devices import SENSING, DirectDrive, DirectLaser, DirectSimulator, SilentPorts, said_once
from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.api.records import Contact, Observation, StepResult
from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.errors import ModelError, NotFoundError, ParameterError
from m2wr_sim.geometry import compose, quaternion_from_rpy
from m2wr_sim.model.types import RayScan
from m2wr_sim.physics.engine import FARTHEST, settings_from_physics, whole_step
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.runtime.entities import list_names
from m2wr_sim.runtime.once_logger import OnceLogger
from m2wr_sim.runtime.simulator import SimConfig
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene

_NO_CLOCK = 1e-9                # Hz; no subscriber needs a clock, and its ticks would interrupt sequences of steps
_STANDING = 0.1                 # m: height of m2wr's chassis when it stands on the floor
_CLEARANCE_RAYS = 360

_ONCE_LOGGER = OnceLogger()          # what is to be said of a robot is said once, however many simulations it drives in

# libode steps all worlds of a process through one set of thread bookkeeping: two at once end in its assertion
_ONE_STEPS = threading.Lock()


class Sim:
    """A world in which robots drive and sense.

    The methods of one simulation must be called from one thread at a time; steps of several simulations in one process
    wait for one another, so what is to run in parallel runs in processes.

    The same world, robots, seed, commands and durations give the same numbers, to the last bit, after every
    :meth:`reset` and in every process, whichever engine steps.  They are the numbers that the node publishes.

    Parameters
    ----------
    world : World, str or Path
        See :func:`~m2wr_sim.api.loading.read_world`.
    robot : Model, str or Path, optional
        A robot to begin with, see :meth:`spawn`.
    pose : tuple, optional
        Where: (x, y, yaw) [m, rad], or as :meth:`spawn` takes it.
    seed : int
        Of all sensor noise.
    sensing : str
        ``due``: odometry and scans at the rates of the robot's description, as the node publishes them;
        ``now``: both are measured at the end of each step and at a reset, lasers at no other time;
        ``off``: no scans, odometry as in ``due``.
    step : float, optional
        Physics step [s]; the world's own where None.
    engine, solver : str
        As the node's parameters: ``auto``, ``native`` or ``pyode``; ``step`` or ``quick``.  With ``quick``, simulations
        of one process draw from one random sequence: they repeat only all together.
    wheel_convention : str
        Which wheel is left: ``rep103`` (by where the wheels are: positive angular commands turn left), ``noetic`` or
        ``kinetic``, see docs/explanation/turning.md.
    command_timeout : float
        A robot stops when its commands have ceased for so long [s]; 0: the last command holds.

    Attributes
    ----------
    simulator : DirectSimulator
        The simulation underneath, for whatever has no method here.

    Raises
    ------
    WorldError, ModelError
        If the world or the robot cannot be used.
    ParameterError
        If an option has an unusable value.
    """

    def __init__(self, world="empty", robot=None, pose=(0.0, 0.0, 0.0), seed=0, sensing="due", step=None,
                 engine="auto", solver="step", wheel_convention="rep103", command_timeout=0.0):
        _check_choice("sensing", sensing, SENSING)
        _check_choice("wheel_convention", wheel_convention, CONVENTIONS)
        _check_choice("solver", solver, ("step", "quick"))
        if not 0.0 <= command_timeout < math.inf:
            raise ParameterError("command_timeout is %r s; expected a finite number of at least 0" % (command_timeout,))
        self.world, self.sensing, self._simulator = read_world(world), sensing, None
        step = self.world.physics.max_step_size if step is None else step
        config = SimConfig(seed=_checked_seed(seed), clock_rate=_NO_CLOCK, wheel_convention=wheel_convention,
                           command_timeout_ns=int(round(command_timeout * 1e9)), once_logger=_ONCE_LOGGER,
                           loss_ends=True)
        settings = settings_from_physics(self.world.physics, whole_step(step, "world %s" % self.world.name), solver)
        self._simulator = DirectSimulator(make_engine(engine, settings), RayScene(), SilentPorts(), config)
        self._robots, self._start_ns, self._spawned = {}, 0, []
        self._surveyor = None
        try:
            self._simulator.engine.reseed(config.seed)
            self._simulator.load_world(self.world)
            self._start_ns = self._simulator.now_ns
            if robot is not None:
                self.spawn(robot, pose)
        except Exception:
            self.close()
            raise

    # ---- what is there -----------------------------------------------------------------------------------------

    @property
    def simulator(self):
        """The simulation underneath."""
        if self._simulator is None:
            raise RuntimeError("this simulation is closed")
        return self._simulator

    @property
    def time(self):
        """Simulated time [s]."""
        return self.simulator.now_ns / 1e9

    @property
    def step_size(self):
        """Physics step [s]."""
        return self.simulator.step_ns / 1e9

    @property
    def robots(self):
        """Names of the spawned models, in the order of spawning."""
        return tuple(self._robots)

    @property
    def models(self):
        """Names of all models, the world's own first."""
        return tuple(self.simulator.models)

    def spawn(self, robot="m2wr", pose=(0.0, 0.0, 0.0), name=None):
        """Put a robot, or any other model, into the world; a reset will put it there again.

        Parameters
        ----------
        robot : Model, str or Path
            See :func:`~m2wr_sim.api.loading.read_robot`.
        pose : tuple
            (x, y, yaw) or (x, y, z, yaw) [m, rad], or a full pose ((x, y, z), (x, y, z, w)); z is 0.1 m where it is
            not given, the height at which m2wr stands.
        name : str, optional
            The model's own where None.

        Returns
        -------
        str
            The name, by which all other methods know it.

        Raises
        ------
        ModelError
            If it cannot be read or built, or the name is taken.
        """
        record = read_robot(robot)
        with said_once(record in self._spawned):
            model = self.simulator.spawn(record, compose(_full_pose(pose), record.pose), name)
        self._spawned.append(record)
        drives, lasers = (self.simulator.devices(model.name, kind) for kind in (DirectDrive, DirectLaser))
        for laser in lasers:
            laser.enabled = self.sensing == "due"
        self._robots[model.name] = (drives[0] if drives else None, tuple(lasers))
        if self.sensing == "now":
            self.measure(model.name)            # as after a reset, so that the noise is the same
        return model.name

    def delete(self, name):
        """Take a model out of the world, also one of the world's own; NotFoundError if there is none of that name."""
        self.simulator.delete(name)
        self._robots.pop(name, None)

    def drive(self, name=None):
        """Return the :class:`~m2wr_sim.api.devices.DirectDrive` of a robot, by default of the only one."""
        name = self._name(name)
        if self._robots[name][0] is None:
            raise NotFoundError("\"%s\" has no differential drive that can be commanded" % name)
        return self._robots[name][0]

    def lasers(self, name=None):
        """Return the :class:`~m2wr_sim.api.devices.DirectLaser` objects of a robot, by default of the only one."""
        return self._robots[self._name(name)][1]

    def _name(self, name):
        if name is None and len(self._robots) == 1:
            return next(iter(self._robots))
        if name not in self._robots:
            raise NotFoundError("%s; robots: %s" % ("which robot is meant?" if name is None
                                                    else "there is no robot \"%s\"" % name, list_names(self._robots)))
        return name

    # ---- time --------------------------------------------------------------------------------------------------

    def step(self, command=None, duration=0.05):
        """Drive on for a while.

        Parameters
        ----------
        command : (float, float), dict or array_like, optional
            Linear [m/s] and angular [rad/s] velocity for the only robot; ``{name: (linear, angular)}`` for some; or
            (robots, 2) for all with a drive, in the order of spawning.  None: the last command of each holds.  A
            command takes effect at the next tick of the robot's drive; one that is not finite is refused.
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
            If a command is for a robot that is not there or has no drive.
        """
        simulator = self.simulator
        count = duration * 1e9 / simulator.step_ns
        if not 0.5 < count < math.inf:
            raise ValueError("step of %r s; expected at least one physics step of %g s" % (duration, self.step_size))
        if command is not None:
            self._take(command)
        end_ns = simulator.now_ns + int(round(count)) * simulator.step_ns
        with _ONE_STEPS:
            while simulator.now_ns < end_ns:
                simulator.advance(end_ns)
        if self.sensing == "now":
            self.measure()
        return self.observe()

    def _take(self, command):
        if isinstance(command, dict):
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

    def measure(self, name=None):
        """Measure odometry and scan of one robot, or of all, at this instant instead of when they are due."""
        now_ns = self.simulator.now_ns
        for drive, lasers in ([self._robots[self._name(name)]] if name is not None else self._robots.values()):
            if drive is not None:
                drive.measure_now(now_ns)
            for laser in lasers:
                laser.measure_now(now_ns)

    def observe(self):
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

    def reset(self, seed=None, poses=None):
        """Start over with the models that are there now: time, poses, joints, motors, noise, all as at the beginning.

        Parameters
        ----------
        seed : int, optional
            A new seed; the old one where None.
        poses : dict or tuple, optional
            New places to start from, ``{name: pose}`` or the pose of the only robot; as :meth:`spawn` takes them.

        Returns
        -------
        StepResult

        Raises
        ------
        NotFoundError, ModelError, ParameterError
            If a robot is not there, a pose is too far out for the engine, or the seed is none; all stays as it was.
        """
        simulator = self.simulator
        places = {} if poses is None else poses if isinstance(poses, dict) else {None: poses}
        models = [(simulator.models[self._name(name)], _full_pose(pose)) for name, pose in places.items()]
        seed = simulator.config.seed if seed is None else _checked_seed(seed)
        for model, pose in models:
            if not all(abs(value) <= FARTHEST for value in pose[0]):
                raise ModelError("position %s for \"%s\": expected at most %g m from the origin"
                                 % (pose[0], model.name, FARTHEST))
        for model, pose in models:
            model.reset_pose = compose(pose, model.record.pose)
        simulator.config = replace(simulator.config, seed=seed)
        simulator.reset_simulation()
        if self.world.state is not None:
            simulator.apply_state(self.world.state)
        if self.sensing == "now":
            self.measure()
        return self.observe()

    # ---- asking and changing -----------------------------------------------------------------------------------

    def pose(self, name=None):
        """Return a model's ``((x, y, z), (x, y, z, w))`` in the world [m]; by default of the only robot."""
        name = self._name(None) if name is None else name
        state = self.simulator.model_state(name)
        return state.position, state.orientation

    def velocity(self, name=None):
        """Return a model's linear [m/s] and angular [rad/s] velocity in world axes; by default of the only robot."""
        name = self._name(None) if name is None else name
        state = self.simulator.model_state(name)
        return state.linear, state.angular

    def set_pose(self, pose, name=None):
        """Put a model somewhere, at rest; ``pose`` as in :meth:`spawn`.  The command of a robot stays."""
        name = self._name(None) if name is None else name
        self.simulator.set_model_state(name, _full_pose(pose), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def joint_positions(self, name=None):
        """Return ``{joint: position}`` of a model [rad or m]; by default of the only robot."""
        name = self._name(None) if name is None else name
        self.simulator.model_state(name)        # tells if there is no such model
        handle = self.simulator.models[name].handle
        return {joint: self.simulator.engine.joint_angle(number) for joint, number in handle.joints.items()}

    def contact_count(self, name=None):
        """Return how many contacts a robot has begun since the start, other than standing on the ground."""
        return self.simulator.contact_counts.get(self._name(name), 0)

    def clearance(self, x, y, height=0.2, reach=10.0, ignore=None):
        """Return the distance [m] from a point to what is nearest in the horizontal plane, robots included.

        Measured by 360 rays; ``reach`` where nothing is nearer.  A point inside a shape gives the distance to its far
        sides.  ``ignore`` is the name of a model to look through.
        """
        if self._surveyor is None or self._surveyor.range_max != reach:
            half = math.pi * (1.0 - 1.0 / _CLEARANCE_RAYS)
            self._surveyor = LaserSensor(RayScan(samples=_CLEARANCE_RAYS, min_angle=-half, max_angle=half,
                                                 range_max=float(reach)), np.random.default_rng(0))
        self.simulator.refresh_scene()
        ranges, _ = self._surveyor.cast(self.simulator.scene, ((x, y, height), (0.0, 0.0, 0.0, 1.0)), ignore)
        return min(float(ranges.min()), float(reach))

    # ---- end ---------------------------------------------------------------------------------------------------

    def close(self):
        """Free the world; nothing but this may be called afterwards."""
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def _check_choice(name, value, choices):
    if value not in choices:
        raise ParameterError("%s is %r; expected one of %s" % (name, value, ", ".join(choices)))


def _checked_seed(seed):
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ParameterError("seed is %r; expected a whole number, not below 0" % (seed,))
    return int(seed)


def _full_pose(pose):
    """Return ((x, y, z), (x, y, z, w)) of any of the forms that :meth:`Sim.spawn` takes."""
    try:
        parts = tuple(pose)
        if len(parts) == 2:
            full = tuple(float(value) for value in parts[0]), tuple(float(value) for value in parts[1])
        else:
            values = [float(value) for value in parts]
            if len(values) == 3:
                values.insert(2, _STANDING)
            x, y, z, yaw = values
            full = (x, y, z), quaternion_from_rpy(0.0, 0.0, yaw)
        if len(full[0]) == 3 and len(full[1]) == 4 and all(map(math.isfinite, full[0] + full[1])):
            return full
    except (TypeError, ValueError):
        pass
    raise ValueError("pose %r; expected finite numbers (x, y, yaw), (x, y, z, yaw) or ((x, y, z), (x, y, z, w))"
                     % (pose,))
