# SPDX-License-Identifier: BSD-3-Clause
"""The simulation: a world, its models and plugins, and the order of events in a step.

A step that ends at time t has this order.  The time becomes t.  Commands are delivered.  Plugins act *before* the
bodies move (clock, odometry, motor targets); they publish the state before the step with stamp t, as in Gazebo.  The
engine steps.  Sensors measure the new state.  Between two such events no plugin reads the state, so the engine makes
several steps in one call.  With lazy stepping this call is delayed until the state is read.
"""
import logging
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from typing import Dict

from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.errors import LostError, ModelError, NotFoundError, SimError
from m2wr_sim.geometry import compose, normalise_quaternion, rotate
from m2wr_sim.model.types import Physics, Plane, PluginSpec
from m2wr_sim.physics.engine import FARTHEST, FASTEST
from m2wr_sim.plugins.base import PluginReader
from m2wr_sim.plugins.registry import find_plugin
from m2wr_sim.plugins.unsupported import UnsupportedPlugins
from m2wr_sim.runtime.context import ModelContext
from m2wr_sim.runtime.entities import LiveModel, SceneRows, find_frame, list_names, relative
from m2wr_sim.runtime.event_queue import EventQueue
from m2wr_sim.runtime.once_logger import OnceLogger
from m2wr_sim.runtime.schedule import first_step, misfit, period_of

log = logging.getLogger(__name__)

_JOINT_STATES = "builtin joint states"
_CONTACTS_KEPT = 1000
_HOLD_NS = 50000000             # greatest delay of the engine, and validity of plugins' answers, in lazy stepping
_RATE_TAGS = ("updaterate", "updateratehz", "update_rate")


def _within_reach(name, pose):
    """Return a pose; ModelError if it is beyond the range of the engine."""
    if not all(abs(value) <= FARTHEST for value in pose[0]):
        raise ModelError("position %s for \"%s\": expected at most %g m from the origin" % (pose[0], name, FARTHEST))
    return pose


def _check_speed(name, linear, angular):
    """Raise ModelError for velocities [m/s, rad/s] beyond the range of the engine."""
    if not all(abs(value) <= FASTEST for value in tuple(linear) + tuple(angular)):
        raise ModelError("velocity %s, %s for \"%s\": expected at most %g m/s and rad/s"
                         % (tuple(linear), tuple(angular), name, FASTEST))


@dataclass(frozen=True)
class SimConfig:
    """Options of a simulation.

    ``wheel_conventions`` overrides ``wheel_convention`` for models by name; see
    :func:`m2wr_sim.control.diff_drive.is_swapped`.  ``command_timeout_ns`` stops a robot that has received no command
    for that time; with 0 the last command stays valid.  ``joint_states`` publishes joint states also for robots without
    a plugin for them.  A model that leaves the world is removed and logged; with ``loss_ends`` LostError is raised
    instead.  ``once_logger`` logs each remark on models once.
    """

    seed: int = 0
    clock_rate: float = 100.0
    wheel_convention: str = "noetic"
    wheel_conventions: Dict[str, str] = field(default_factory=dict)
    command_timeout_ns: int = 0
    joint_states: bool = True
    joint_state_rate: float = 50.0
    loss_ends: bool = False
    once_logger: OnceLogger = field(default_factory=OnceLogger, repr=False, compare=False)

    def wheel_convention_of(self, model_name, described=None):
        """Return the wheel convention of a model: the one for its name, that of its description, or the general one.

        Parameters
        ----------
        model_name : str
        described : str, optional
            Text of a ``<wheelConvention>`` element; a text that is no convention is ignored.

        Returns
        -------
        str
        """
        general = described if described in CONVENTIONS else self.wheel_convention
        return self.wheel_conventions.get(model_name, general)


class Simulator:
    """See the module docstring; every method must be called from one thread.

    Parameters
    ----------
    engine : Engine
    scene : RayScene
        Shapes that lasers see.
    ports : Ports
    config : SimConfig
    """

    def __init__(self, engine, scene, ports, config=None):
        self.engine, self.scene, self.ports = engine, scene, ports
        self.config = config or SimConfig()
        self.step_ns = engine.settings.step_ns
        self.now_ns, self.steps = 0, 0
        self.paused = False
        self.models, self.lights = OrderedDict(), OrderedDict()
        self.physics = Physics(max_step_size=self.step_ns * 1e-9, gravity=engine.settings.gravity)  # as last asked for
        self.observers = []             # plugins of the world itself: state publishers and the like
        self.contacts, self.contact_counts = [], {}
        self._clock_period_ns, self._clock_due_ns = period_of(self.config.clock_rate), 0
        self._active = []               # (plugin, context, label) of all models, in load order
        self._scene_version = self._moving_sight = None     # the engine's version that the scene shows
        self._resting_sights = {}       # static link -> SceneRows of its shapes
        self._event_queue = EventQueue(self._failed, self._catch_up)
        self._unsupported = UnsupportedPlugins()
        self._misfits = set()           # logged messages about rates that do not fit into the steps
        self._lost = []                 # names of models that left the world and are still listed
        self._pending, self._hold_ns = 0, 0     # steps by which time is ahead of the engine; validity of answers

    # ---- world -------------------------------------------------------------------------------------------------

    def load_world(self, world):
        """Add every model of a :class:`~m2wr_sim.model.types.World` and apply its stored state.

        A model that the engine cannot build is logged and omitted.
        """
        for note in world.notes:
            self.config.once_logger.log(logging.WARNING, "", "%s", note)
        for remark in world.remarks:
            self.config.once_logger.log(logging.INFO, "", "%s", remark)
        self.physics = replace(world.physics, max_step_size=self.step_ns * 1e-9)
        self.lights.update((light.name, light) for light in world.lights)
        for record in world.models:
            try:
                self.spawn(record, record.pose, namespace=None)
            except ModelError as error:
                log.error("%s; model \"%s\" is left out", error, record.name)
        for spec in world.plugins:
            self._unsupported.report("the world", spec, None)
        if world.state is not None:
            self.apply_state(world.state)

    def apply_state(self, state):
        """Set time, poses and velocities from the ``<state>`` of a world file; a reset does not restore it."""
        self.now_ns = state.sim_time_ns // self.step_ns * self.step_ns
        for entry in state.models:
            model = self.models.get(entry.name)
            if model is None:
                log.warning("the world's <state> has model \"%s\", which is not in the world", entry.name)
                continue
            try:
                self._apply_entry(model, entry)
            except ModelError as error:
                log.error("the world's <state>: %s; the rest of the state of model \"%s\" is ignored", error,
                          entry.name)
        self._restart_plugins(rewound=False)

    def _apply_entry(self, model, entry):
        """Apply the stored state of one model; ModelError if it is beyond the range of the engine."""
        if entry.pose is not None:
            model.place(self.engine, _within_reach(entry.name, entry.pose))
        for name, pose, velocity in entry.links:
            link = model.handle.links.get(name)
            if link is None:
                log.warning("the world's <state> has link \"%s::%s\", which is not in the world", entry.name, name)
                continue
            if pose is not None:
                self.engine.set_link_pose(link, _within_reach(entry.name + "::" + name, pose))
            if velocity is not None:
                _check_speed(entry.name + "::" + name, *velocity)
                self.engine.set_link_velocity(link, *velocity)

    def spawn(self, record, pose, name=None, namespace=None):
        """Add a model to the world.

        Parameters
        ----------
        record : m2wr_sim.model.types.Model
        pose : pose
            Pose of the model frame in the world, also after a reset.
        name : str, optional
            Name in the world; default: that of the model.
        namespace : str, optional
            ROS namespace of plugins that do not define one; default: that of the plugin.

        Returns
        -------
        LiveModel

        Raises
        ------
        ModelError
            If the name is taken or the engine cannot build the model.
        """
        name = name or record.name
        if name in self.models:
            raise ModelError("a model called \"%s\" is already in the world" % name)
        if "::" in name or not name:
            raise ModelError("\"%s\" cannot be the name of a model; expected a name without \"::\", which separates a "
                             "model from its links" % name)
        if not record.links:
            raise ModelError("model \"%s\" has no links" % name)
        for note in record.notes:
            self.config.once_logger.log(logging.WARNING, name, "%s: %s", name, note)
        for remark in record.remarks:
            self.config.once_logger.log(logging.INFO, name, "%s: %s", name, remark)
        pose = _within_reach(name, (tuple(pose[0]), normalise_quaternion(pose[1])))
        for link in record.links:
            for part in (link,) + link.collisions:
                _within_reach("%s::%s" % (name, part.name), part.pose)
        handle = self.engine.add_model(record, pose, name)
        model = LiveModel(record, handle, pose)
        self.models[name] = model
        try:
            self._add_to_scene(model)
            for spec, sensor, link in self._plugin_specs(record):
                self._start_plugin(model, spec, sensor, link, namespace)
        except Exception:
            self.delete(name)           # remove the incomplete model
            raise
        return model

    def _plugin_specs(self, record):
        """Yield ``(spec, sensor, link name)`` of a model's plugins; adds joint states if no plugin publishes them."""
        for spec in record.plugins:
            yield spec, None, None
        for link in record.links:
            for sensor in link.sensors:
                for spec in sensor.plugins:
                    yield spec, sensor, link.name
        moving = [joint.name for joint in record.joints if joint.kind in ("revolute", "prismatic")]
        given = any("joint_state" in spec.filename or spec.find("publishWheelJointState") in ("true", "1")
                    for spec in record.plugins)
        if self.config.joint_states and record.plugins and moving and not given and not record.static:
            parameters = (("jointName", ",".join(moving)), ("updateRate", str(self.config.joint_state_rate)))
            library = "libgazebo_ros_joint_state_publisher.so"
            yield PluginSpec(_JOINT_STATES, library, parameters, where=_JOINT_STATES), None, None

    @staticmethod
    def plugin_class(filename):
        """Return the class that implements a plugin library, or None; a subclass may have others."""
        return find_plugin(filename)

    def _start_plugin(self, model, spec, sensor, link, namespace):
        plugin_class = self.plugin_class(spec.filename)
        if plugin_class is None:
            self._unsupported.report(model.name, spec, namespace)
            return
        if namespace and spec.find("robotNamespace") is None:
            spec = replace(spec, parameters=spec.parameters + (("robotNamespace", namespace),))
        plugin, context, reader = plugin_class(), ModelContext(self, model, spec, sensor, link), PluginReader(spec)
        label = "%s: plugin %s (%s)" % (model.name, spec.name, spec.filename)
        try:
            plugin.configure(reader, context)
        except SimError as error:
            context.close()
            log.error("%s. This plugin will not run.", error)
            return
        except Exception:
            context.close()
            log.exception("%s failed to start and will not run", label)
            return
        self.config.once_logger.log_parameters(model.name, label, reader)
        self._log_misfits(label, spec, sensor)
        entry = (plugin, context, label)
        model.plugins.append(entry)
        self._active.append(entry)
        self._event_queue.stale = True

    def _log_misfits(self, label, spec, sensor):
        """Log the intervals of each rate that does not fit into whole steps, once."""
        rates = [text for tag, text in spec.parameters if tag.lower() in _RATE_TAGS]
        for rate in rates + ([] if sensor is None else [sensor.update_rate]):
            try:
                message = misfit(float(rate), self.step_ns)
            except (ValueError, OverflowError):         # not a rate, which the plugin has logged
                continue
            if message is not None and message not in self._misfits:
                self._misfits.add(message)
                log.info("%s: %s", label, message)

    def delete(self, name):
        """Remove a model from the world; its plugins close their topics."""
        model = self._model(name)
        for entry in model.plugins:
            self._stop_plugin(entry)
        model.plugins = []              # breaks a reference cycle, which the collector does not free if it was frozen
        self.engine.remove_model(model.handle)
        del self.models[name]
        self.contact_counts.pop(name, None)
        self.scene.remove_owner(name)
        for link in model.handle.links.values():
            self._resting_sights.pop(link, None)
        self._moving_sight = None

    def _stop_plugin(self, entry):
        """Close a plugin, unless it was closed when it was switched off."""
        if entry not in self._active:
            return
        self._active.remove(entry)
        self._event_queue.stale = True
        plugin, context, label = entry
        try:
            plugin.close()
        except Exception:
            log.exception("%s failed while closing", label)
        context.close()

    def switched_off(self):
        """Return the labels of plugins that were switched off after an exception."""
        return [entry[2] for model in self.models.values() for entry in model.plugins if entry not in self._active]

    def _model(self, name):
        if name not in self.models:
            raise NotFoundError("model \"%s\" does not exist; models: %s" % (name, list_names(self.models)))
        return self.models[name]

    def add_observer(self, plugin, label):
        """Add a plugin of the world, which takes part in every step; it must be configured already.

        Parameters
        ----------
        plugin : Plugin
        label : str
            Name for messages.
        """
        self.observers.append((plugin, None, label))
        self._event_queue.stale = True

    # ---- ray scene ---------------------------------------------------------------------------------------------

    def _add_to_scene(self, model):
        moving, resting = [], {}
        for link, collision, moves in self.engine.collisions(model.handle):
            pose = compose(self.engine.link_pose(link), collision.pose)
            row = self.scene.add(collision.geometry, pose, model.name, collision.laser_retro)
            if moves:
                moving.append((row, link, collision.pose))
            elif model.record.static and not isinstance(collision.geometry, Plane):
                resting.setdefault(link, []).append((row, link, collision.pose))
        model.sight = SceneRows(moving)
        self._resting_sights.update((link, SceneRows(parts)) for link, parts in resting.items())
        self._moving_sight = None

    def refresh_scene(self):
        """Update the poses in the scene if a link may have moved."""
        engine, shown = self.engine, self._scene_version
        if self._moving_sight is None:
            self._moving_sight = SceneRows([part for model in self.models.values() for part in model.sight.parts])
        elif shown == engine.version:
            return
        for link in engine.placed_since(-1 if shown is None else shown):
            sight = self._resting_sights.get(link)
            if sight is not None:
                sight.refresh(engine, self.scene)
        self._moving_sight.refresh(engine, self.scene)
        self._scene_version = engine.version

    # ---- time --------------------------------------------------------------------------------------------------

    def advance(self, until_ns, lazily=False):
        """Advance the simulated time to the next event, but not beyond ``until_ns``. Does nothing while paused.

        Parameters
        ----------
        until_ns : int
            Simulated time [ns].
        lazily : bool
            Whether the engine may be behind the simulated time, by at most 50 ms, while no plugin reads its state.
            Call :meth:`settle` before reading it from outside.  All published messages are the same.

        Returns
        -------
        int
            The time reached [ns].
        """
        step_ns, now_ns = self.step_ns, self.now_ns
        first_ns = now_ns + step_ns
        if self._lost:
            self._delete_lost()
        if self.paused or until_ns < first_ns:
            return now_ns
        events = self._event_queue
        query_all = not lazily or first_ns > self._hold_ns or events.stale or self.ports.waiting()
        if query_all:
            if self._pending:
                self._catch_up()
            self.ports.deliver()
            # without lazy stepping the caller may change the world between this call and the next
            self._hold_ns = first_ns + _HOLD_NS if lazily else 0
        if first_ns >= self._clock_due_ns:
            self.ports.clock(first_ns)
            self._clock_due_ns = first_step(first_ns + self._clock_period_ns, first_ns, step_ns)
        if events.stale:
            events.fill(self._active + self.observers)
        if query_all or first_ns > events.calm_ns:
            events.act(now_ns, step_ns, query_all)
        stop_ns = self._clock_due_ns - step_ns          # the least of these; comparisons are faster than min
        if until_ns < stop_ns:
            stop_ns = until_ns
        if events.calm_ns < stop_ns:
            stop_ns = events.calm_ns
        if events.sample_ns < stop_ns:
            stop_ns = events.sample_ns
        if lazily and self._hold_ns < stop_ns:
            stop_ns = self._hold_ns
        count = (stop_ns - now_ns) // step_ns if stop_ns > first_ns else 1
        self._pending += count
        self.steps += count
        self.now_ns = now_ns = now_ns + count * step_ns
        if not lazily or now_ns >= events.sample_ns:
            if events.stale:
                events.fill(self._active + self.observers)
            events.measure(now_ns, lazily)
            if self._hold_ns - now_ns < _HOLD_NS // 2:
                self._hold_ns = 0           # query all plugins next, which is cheap now that the engine is up to date
        return now_ns

    def settle(self):
        """Let the engine catch up with the simulated time; all plugins are queried before the next step."""
        self._hold_ns = 0
        self._catch_up()
        self._delete_lost()

    def _catch_up(self):
        if self._pending:
            pending, self._pending = self._pending, 0
            while pending:
                try:
                    self.engine.step(pending)
                    pending = 0
                except LostError as error:
                    if self.config.loss_ends:
                        raise
                    pending = error.left
                    self._abandon(error)
            contacts = self.engine.drain_contact_events()
            if contacts:
                self._collect(contacts)

    def _abandon(self, error):
        """Remove models that left the world from physics and scene; their plugins end later.

        A plugin may be running now and may still read its model.
        """
        log.error("%s. Removed: %s; the simulation continues with the others (parameter ~loss_ends: end instead)",
                  error, ", ".join("model \"%s\"" % name for name in error.models))
        for name in error.models:
            model = self.models[name]
            self.engine.abandon_model(model.handle)
            self.scene.remove_owner(name)
            model.sight = SceneRows([])
            self._lost.append(name)
        self._moving_sight = None

    def _delete_lost(self):
        """Delete the models that left the world; called while no plugin is running."""
        while self._lost:
            self.delete(self._lost.pop())

    def hand_over(self, context, function, message):
        """Pass a message to a plugin.

        Parameters
        ----------
        context : ModelContext
            Context of the plugin.
        function : callable
            Its callback.
        message : object
        """
        for entry in self._active:
            if entry[1] is context:
                self._guarded(entry, function, message)
                break

    def _guarded(self, entry, function, argument):
        """Call a plugin; if it raises an exception, it is logged and switched off, and the simulation continues."""
        try:
            function(argument)
        except Exception:
            self._failed(entry)

    def _failed(self, entry):
        log.exception("%s failed and is switched off", entry[2])
        self._event_queue.stale = True
        self._hold_ns = 0               # query all others
        if entry in self.observers:
            self.observers.remove(entry)
        else:
            self._stop_plugin(entry)

    def _collect(self, contacts):
        for contact in contacts:
            for name in {side.split("::")[0] for side in (contact.first, contact.second)}:
                if name in self.models and not self.models[name].record.static:
                    self.contact_counts[name] = self.contact_counts.get(name, 0) + 1
            if len(self.contacts) < _CONTACTS_KEPT:
                self.contacts.append(contact)

    # ---- state services ----------------------------------------------------------------------------------------

    def frame_state(self, name):
        """Return the LinkState of a reference frame, None for the world; NotFoundError if there is none."""
        return find_frame(self.models.values(), self.engine, name)

    def model_state(self, name, frame=""):
        """Return the state of a model in a reference frame; see :func:`~m2wr_sim.runtime.entities.relative`.

        Parameters
        ----------
        name : str
        frame : str
            Name of a model or link; empty for the world.

        Returns
        -------
        Relative
        """
        return relative(self._model(name).state(self.engine), self.frame_state(frame))

    def pose_in_world(self, pose, frame):
        """Transform a pose from a reference frame to the world.

        Parameters
        ----------
        pose : pose
            The quaternion need not be normalised.
        frame : str
            Name of a model or link; empty for the world.

        Returns
        -------
        pose
        """
        pose = (tuple(pose[0]), normalise_quaternion(pose[1]))
        reference = self.frame_state(frame)
        return pose if reference is None else compose((reference.position, reference.orientation), pose)

    def set_model_state(self, name, pose, linear, angular, frame=""):
        """Set the pose of a model and the velocities of all its links.

        Parameters
        ----------
        name : str
        pose : pose
            Pose of the model frame, in ``frame``.
        linear, angular : (3,) sequences of float
            In ``frame`` [m/s, rad/s].
        frame : str
            Name of a model or link; empty for the world.
        """
        model = self._model(name)
        _check_speed(name, linear, angular)
        reference = self.frame_state(frame)
        if reference is not None:
            linear, angular = rotate(reference.orientation, linear), rotate(reference.orientation, angular)
        model.place(self.engine, _within_reach(name, self.pose_in_world(pose, frame)))
        model.set_velocity(self.engine, linear, angular)

    def set_joint_positions(self, name, positions):
        """Set joint positions of a model.

        Parameters
        ----------
        name : str
        positions : dict
            Name of a joint -> position [rad or m]; unknown names and fixed joints are ignored.
        """
        model = self._model(name)
        for joint in model.record.joints:
            if joint.name in positions and joint.kind in ("revolute", "prismatic"):
                model.set_joint_position(self.engine, joint.name, positions[joint.name])

    # ---- resets ------------------------------------------------------------------------------------------------

    def reset_world(self):
        """Move models to their initial poses, at rest; the time continues, and joints do not move."""
        for model in self.models.values():
            model.place(self.engine, model.reset_pose)
            model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._restart_plugins(rewound=False)

    def reset_simulation(self):
        """Restart the simulation: time zero, random sequences from the seed, initial poses and joints, at rest."""
        self.now_ns, self.steps = 0, 0
        self._clock_due_ns = 0
        self.engine.forget()
        self.engine.reseed(self.config.seed)
        for model in self.models.values():
            model.restore(self.engine)
            model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.contacts, self.contact_counts = [], {}
        self._restart_plugins(rewound=True)

    def _restart_plugins(self, rewound):
        for entry in self._active + self.observers:
            self._guarded(entry, lambda now_ns, plugin=entry[0]: plugin.reset(now_ns, rewound), self.now_ns)

    def close(self):
        """Stop all plugins and free the world."""
        for entry in list(self._active):
            self._stop_plugin(entry)
        self.observers = []
        self._event_queue.stale = True
        self.engine.close()
