# SPDX-License-Identifier: BSD-3-Clause
"""The simulation: a world, what lives in it, and the one order of events in a step.

A step that ends at time t goes: time becomes t; commands that have arrived are taken; plugins act *before* the bodies
move (clock, odometry, motor targets: what they publish is the state before the step, stamped t, as in Gazebo); the
engine steps; sensors act on the new state.  Between two such moments nothing looks at the world, so the engine runs
that stretch in one call; who asks for it lazily has even the call put off until something looks.
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
from m2wr_sim.runtime.entities import LiveModel, SceneRows, find_frame, relative, tell
from m2wr_sim.runtime.event_queue import EventQueue
from m2wr_sim.runtime.once_logger import OnceLogger
from m2wr_sim.runtime.schedule import first_step, misfit, period_of

log = logging.getLogger(__name__)

_JOINT_STATES = "builtin joint states"
_TOUCHES_KEPT = 1000
_HOLD_NS = 50000000             # how long the engine may stay behind, and plugins' answers are relied on
_RATE_TAGS = ("updaterate", "updateratehz", "update_rate")


def _within_reach(name, pose):
    """Return a pose; ModelError if it is farther out than the engine's numbers carry."""
    if not all(abs(value) <= FARTHEST for value in pose[0]):
        raise ModelError("position %s for \"%s\": expected at most %g m from the origin" % (pose[0], name, FARTHEST))
    return pose


def _check_speed(name, linear, angular):
    """Raise ModelError for velocities [m/s, rad/s] that the engine's numbers do not carry."""
    if not all(abs(value) <= FASTEST for value in tuple(linear) + tuple(angular)):
        raise ModelError("velocity %s, %s for \"%s\": expected at most %g m/s and rad/s"
                         % (tuple(linear), tuple(angular), name, FASTEST))


@dataclass(frozen=True)
class SimConfig:
    """What can be chosen about a simulation, apart from the world itself.

    ``wheel_conventions`` overrides ``wheel_convention`` for models by name; see
    :func:`m2wr_sim.control.diff_drive.is_swapped`.  ``command_timeout_ns`` stops a robot whose commands have ceased
    for that long; 0 keeps the last command for ever.  ``joint_states`` gives robots joint states even if their
    description names no plugin for them.  Models that are thrown out of the world are removed and named, and the others
    go on; with ``loss_ends`` what advances the time raises LostError instead.  ``told`` knows what was said of models
    already.
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
        """Return the convention for one model: what is set for its name, what its description says, the general one.

        ``described`` is the text of a ``<wheelConvention>`` element; None, and a text that is no convention, count as
        nothing said.
        """
        general = described if described in CONVENTIONS else self.wheel_convention
        return self.wheel_conventions.get(model_name, general)


class Simulator:
    """See the module docstring; every method must be called from one thread.

    Parameters
    ----------
    engine : Engine
    scene : RayScene
        What rays see.
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
        self.touches, self.touch_counts = [], {}
        self._clock_period_ns, self._clock_due_ns = period_of(self.config.clock_rate), 0
        self._active = []               # (plugin, context, label) of all models, in load order
        self._scene_version = self._moving_sight = None     # the engine's version that the scene shows
        self._resting_sights = {}       # static link -> SceneRows of its shapes
        self._event_queue = EventQueue(self._failed, self._catch_up)
        self._unsupported = UnsupportedPlugins()
        self._misfits = set()           # what was said of rates that do not fit into the steps
        self._lost = []                 # names of models that have been thrown out of the world and are still listed
        self._owed, self._hold_ns = 0, 0        # steps that time is ahead of the engine; until when answers hold

    # ---- world -------------------------------------------------------------------------------------------------

    def load_world(self, world):
        """Add every model of a :class:`~m2wr_sim.model.types.World` and apply its stored state.

        A model that the engine cannot build is named and left out.
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
        """Set time, poses and velocities from a world file's ``<state>``; a reset does not come back to it."""
        self.now_ns = state.sim_time_ns // self.step_ns * self.step_ns
        for entry in state.models:
            model = self.models.get(entry.name)
            if model is None:
                log.warning("the world's <state> speaks of model \"%s\", which is not in the world", entry.name)
                continue
            try:
                self._apply_entry(model, entry)
            except ModelError as error:
                log.error("the world's <state>: %s; the rest of what it says of model \"%s\" is left out", error,
                          entry.name)
        self._restart_plugins(rewound=False)

    def _apply_entry(self, model, entry):
        """Apply what a stored state says of one model; ModelError where that is more than the engine can take."""
        if entry.pose is not None:
            model.place(self.engine, _within_reach(entry.name, entry.pose))
        for name, pose, velocity in entry.links:
            link = model.handle.links.get(name)
            if link is None:
                log.warning("the world's <state> speaks of link \"%s::%s\", which is not in the world",
                            entry.name, name)
                continue
            if pose is not None:
                self.engine.set_link_pose(link, _within_reach(entry.name + "::" + name, pose))
            if velocity is not None:
                _check_speed(entry.name + "::" + name, *velocity)
                self.engine.set_link_velocity(link, *velocity)

    def spawn(self, record, pose, name=None, namespace=None):
        """Put a model into the world; ``pose`` is where its frame goes and where a reset will put it.

        ``namespace`` is the ROS namespace for plugins without one of their own; None keeps each plugin's default.

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
            self.delete(name)           # no half a model stays behind
            raise
        return model

    def _plugin_specs(self, record):
        """Yield ``(spec, sensor, link name)`` of a model's plugins, with joint states where nothing else gives them."""
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
        """Return the class that stands for a plugin library, or None; a subclass may have others."""
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
        self._tell_misfits(label, spec, sensor)
        entry = (plugin, context, label)
        model.plugins.append(entry)
        self._active.append(entry)
        self._event_queue.stale = True

    def _tell_misfits(self, label, spec, sensor):
        """Say of each rate that does not fit into whole steps how it is kept, once."""
        rates = [text for tag, text in spec.parameters if tag.lower() in _RATE_TAGS]
        for rate in rates + ([] if sensor is None else [sensor.update_rate]):
            try:
                told = misfit(float(rate), self.step_ns)
            except (ValueError, OverflowError):         # no rate at all: the plugin has spoken of it
                continue
            if told is not None and told not in self._misfits:
                self._misfits.add(told)
                log.info("%s: %s", label, told)

    def delete(self, name):
        """Take a model out of the world; its plugins close their topics."""
        model = self._model(name)
        for entry in model.plugins:
            self._stop_plugin(entry)
        model.plugins = []              # they know the model: a circle, which nothing collects where it has been frozen
        self.engine.remove_model(model.handle)
        del self.models[name]
        self.touch_counts.pop(name, None)
        self.scene.remove_owner(name)
        for link in model.handle.links.values():
            self._resting_sights.pop(link, None)
        self._moving_sight = None

    def _stop_plugin(self, entry):
        """Close a plugin, once: one that was switched off before is closed already."""
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
        """Return the labels of plugins that have failed while they ran."""
        return [entry[2] for model in self.models.values() for entry in model.plugins if entry not in self._active]

    def _model(self, name):
        if name not in self.models:
            raise NotFoundError("model \"%s\" does not exist; models: %s" % (name, tell(self.models)))
        return self.models[name]

    def add_observer(self, plugin, label):
        """Let a world-level plugin take part in every step; it must already be configured."""
        self.observers.append((plugin, None, label))
        self._event_queue.stale = True

    # ---- what rays see -----------------------------------------------------------------------------------------

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
        """Bring the scene to where the engine has everything now; nothing is done where nothing can have moved."""
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
        """Run to the next moment at which something happens, but not past ``until_ns``; returns the time reached.

        Does nothing while paused.  ``lazily`` lets the engine stay behind, for at most 50 ms, while nobody looks: every
        look from outside must begin with :meth:`settle` then.  What is published, and what it says, is the same.
        """
        step_ns, now_ns = self.step_ns, self.now_ns
        first_ns = now_ns + step_ns
        if self._lost:
            self._bury()
        if self.paused or until_ns < first_ns:
            return now_ns
        events = self._event_queue
        anew = not lazily or first_ns > self._hold_ns or events.stale or self.ports.waiting()
        if anew:
            if self._owed:
                self._catch_up()
            self.ports.deliver()
            # who is not told to look lazily may change things without a word, between this call and the next
            self._hold_ns = first_ns + _HOLD_NS if lazily else 0
        if first_ns >= self._clock_due_ns:
            self.ports.clock(first_ns)
            self._clock_due_ns = first_step(first_ns + self._clock_period_ns, first_ns, step_ns)
        if events.stale:
            events.fill(self._active + self.observers)
        if anew or first_ns > events.calm_ns:
            events.act(now_ns, step_ns, anew)
        stop_ns = self._clock_due_ns - step_ns          # the least of these; to compare costs less than to call min
        if until_ns < stop_ns:
            stop_ns = until_ns
        if events.calm_ns < stop_ns:
            stop_ns = events.calm_ns
        if events.sample_ns < stop_ns:
            stop_ns = events.sample_ns
        if lazily and self._hold_ns < stop_ns:
            stop_ns = self._hold_ns
        count = (stop_ns - now_ns) // step_ns if stop_ns > first_ns else 1
        self._owed += count
        self.steps += count
        self.now_ns = now_ns = now_ns + count * step_ns
        if not lazily or now_ns >= events.sample_ns:
            if events.stale:
                events.fill(self._active + self.observers)
            events.measure(now_ns, lazily)
            if self._hold_ns - now_ns < _HOLD_NS // 2:
                self._hold_ns = 0           # to ask all anew costs least now: the bodies are where they are
        return now_ns

    def settle(self):
        """Bring the bodies to where they are now, and ask all plugins before time passes again."""
        self._hold_ns = 0
        self._catch_up()
        self._bury()

    def _catch_up(self):
        if self._owed:
            owed, self._owed = self._owed, 0
            while owed:
                try:
                    self.engine.step(owed)
                    owed = 0
                except LostError as error:
                    if self.config.loss_ends:
                        raise
                    owed = error.left
                    self._lose(error)
            touches = self.engine.drain_touches()
            if touches:
                self._collect(touches)

    def _lose(self, error):
        """Take models that have been thrown out of the world from physics and lasers, now; their plugins end later.

        This may be in the middle of a plugin's turn, who may still ask for what it knows.
        """
        log.error("%s. Removed: %s; the others go on (parameter ~loss_ends: end instead)", error,
                  ", ".join("model \"%s\"" % name for name in error.models))
        for name in error.models:
            model = self.models[name]
            self.engine.abandon_model(model.handle)
            self.scene.remove_owner(name)
            model.sight = SceneRows([])
            self._lost.append(name)
        self._moving_sight = None

    def _bury(self):
        """Delete the models that have been lost; nobody is in the middle of anything."""
        while self._lost:
            self.delete(self._lost.pop())

    def hand_over(self, context, function, message):
        """Give a plugin, known by its context, a message that has come for it."""
        for entry in self._active:
            if entry[1] is context:
                self._guarded(entry, function, message)
                break

    def _guarded(self, entry, function, argument):
        """Call a plugin; one that fails is named and switched off, and the simulation goes on."""
        try:
            function(argument)
        except Exception:
            self._failed(entry)

    def _failed(self, entry):
        log.exception("%s failed and is switched off", entry[2])
        self._event_queue.stale = True
        self._hold_ns = 0               # the others are asked anew
        if entry in self.observers:
            self.observers.remove(entry)
        else:
            self._stop_plugin(entry)

    def _collect(self, touches):
        for touch in touches:
            for name in {side.split("::")[0] for side in (touch.first, touch.second)}:
                if name in self.models and not self.models[name].record.static:
                    self.touch_counts[name] = self.touch_counts.get(name, 0) + 1
            if len(self.touches) < _TOUCHES_KEPT:
                self.touches.append(touch)

    # ---- state services ----------------------------------------------------------------------------------------

    def frame_state(self, name):
        """Return the LinkState of a reference frame, None for the world; NotFoundError if there is none."""
        return find_frame(self.models.values(), self.engine, name)

    def model_state(self, name, frame=""):
        """Return a model's :class:`~m2wr_sim.runtime.entities.Relative` state in a reference frame.

        Velocities are the difference of the world velocities, turned into the frame, without the term of a turning
        frame, as in Gazebo.
        """
        return relative(self._model(name).state(self.engine), self.frame_state(frame))

    def pose_in_world(self, pose, frame):
        """Express a pose given in a reference frame in the world; the quaternion need not be normalised."""
        pose = (tuple(pose[0]), normalise_quaternion(pose[1]))
        reference = self.frame_state(frame)
        return pose if reference is None else compose((reference.position, reference.orientation), pose)

    def set_model_state(self, name, pose, linear, angular, frame=""):
        """Place a model and set the velocity of all its links; everything is given in ``frame``."""
        model = self._model(name)
        _check_speed(name, linear, angular)
        reference = self.frame_state(frame)
        if reference is not None:
            linear, angular = rotate(reference.orientation, linear), rotate(reference.orientation, angular)
        model.place(self.engine, _within_reach(name, self.pose_in_world(pose, frame)))
        model.set_velocity(self.engine, linear, angular)

    def set_joint_positions(self, name, positions):
        """Set joints of a model, ``{name: position}``; names it does not have, and fixed joints, are passed over."""
        model = self._model(name)
        for joint in model.record.joints:
            if joint.name in positions and joint.kind in ("revolute", "prismatic"):
                model.bend(self.engine, joint.name, positions[joint.name])

    # ---- resets ------------------------------------------------------------------------------------------------

    def reset_world(self):
        """Put models back to their initial poses, at rest; time goes on, joints stay as they are."""
        for model in self.models.values():
            model.place(self.engine, model.reset_pose)
            model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._restart_plugins(rewound=False)

    def reset_simulation(self):
        """Start over: time zero, random sequences from the seed, models and joints as at the beginning, at rest."""
        self.now_ns, self.steps = 0, 0
        self._clock_due_ns = 0
        self.engine.forget()
        self.engine.reseed(self.config.seed)
        for model in self.models.values():
            model.restore(self.engine)
            model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.touches, self.touch_counts = [], {}
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
