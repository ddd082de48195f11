# SPDX-License-Identifier: BSD-3-Clause
"""The simulation: a world, its models and plugins, and the order of events in a step.

A step that ends at time t has this order.  The time becomes t.  Commands are delivered.  Plugins act *before* the
bodies move (clock, odometry, motor targets); they publish the state before the step with stamp t, as in Gazebo.  The
engine steps.  Sensors measure the new state.  Between two such events no plugin reads the state, so the engine makes
several steps in one call.  With lazy stepping this call is delayed until the state is read.
"""
from __future__ import annotations

import logging
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Type

from m2wr_sim.collector import paused_collector
from m2wr_sim.errors import LostError, ModelError, NotFoundError
from m2wr_sim.geometry import compose, rotate, unit_pose
from m2wr_sim.model.types import SECOND_AXIS, Physics, Scene
from m2wr_sim.plugins.registry import find_plugin
from m2wr_sim.runtime.config import SimConfig
from m2wr_sim.runtime.entities import LiveModel, find_frame, kinematic, list_names, relative
from m2wr_sim.runtime.limits import check_pose, check_velocity
from m2wr_sim.runtime.plugin_host import PluginHost
from m2wr_sim.runtime.scene_update import SceneUpdate
from m2wr_sim.runtime.schedule import first_step, period_of

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.types import Light, Model, ModelStateEntry, World, WorldState
    from m2wr_sim.physics.engine import ContactEvent, Engine, LinkState
    from m2wr_sim.plugins.base import Plugin
    from m2wr_sim.rendering.picture_scene import PictureScene
    from m2wr_sim.runtime.entities import Relative
    from m2wr_sim.runtime.event_queue import Entry
    from m2wr_sim.runtime.picture_update import PictureUpdate
    from m2wr_sim.runtime.ports import Ports
    from m2wr_sim.sensors.ray_scene import RayScene

log = logging.getLogger(__name__)

_CONTACTS_KEPT = 1000
_HOLD_NS = 50000000             # greatest delay of the engine, and validity of plugins' answers, in lazy stepping


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

    def __init__(self, engine: Engine, scene: RayScene, ports: Ports, config: Optional[SimConfig] = None) -> None:
        self.engine, self.scene, self.ports = engine, scene, ports
        self.config = config or SimConfig()
        self.step_ns = engine.settings.step_ns
        self.now_ns, self.steps = 0, 0
        self.paused = False
        self.models: Dict[str, LiveModel] = OrderedDict()
        self.model_changes = 0          # how often a model came or went
        self.lights: Dict[str, Light] = OrderedDict()
        self.look = Scene()             # ambient light and background, for cameras
        self._pictures: Optional[PictureUpdate] = None
        self.physics = Physics(max_step_size=self.step_ns * 1e-9, gravity=engine.settings.gravity)  # as last asked for
        self.contacts: List[ContactEvent] = []
        self.contact_counts: Dict[str, int] = {}
        self.plugins = PluginHost(self, self._catch_up)
        self._event_queue = self.plugins.event_queue
        self._scene_update = SceneUpdate(engine, scene)
        self._clock_period_ns, self._clock_due_ns = period_of(self.config.clock_rate), 0
        self._lost: List[str] = []      # names of models that left the world and are still listed
        self._pending = 0               # steps by which time is ahead of the engine

    # ---- world -------------------------------------------------------------------------------------------------

    def load_world(self, world: World) -> None:
        """Add every model of a :class:`~m2wr_sim.model.types.World` and apply its stored state.

        A model that the engine cannot build is logged and omitted.
        """
        for note in world.notes:
            self.config.once_logger.log(logging.WARNING, "", "%s", note)
        for remark in world.remarks:
            self.config.once_logger.log(logging.INFO, "", "%s", remark)
        self.physics = replace(world.physics, max_step_size=self.step_ns * 1e-9)
        self.lights.update((light.name, light) for light in world.lights)
        self.look = world.scene
        with paused_collector():
            for record in world.models:
                try:
                    self.spawn(record, record.pose, namespace=None)
                except ModelError as error:
                    log.error("%s; model \"%s\" is left out", error, record.name)
        for spec in world.plugins:
            self.plugins.unsupported.report("the world", spec, None)
        if world.state is not None:
            self.apply_state(world.state)

    def apply_state(self, state: WorldState) -> None:
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
        self.plugins.restart_all(self.now_ns, rewound=False)

    def _apply_entry(self, model: LiveModel, entry: ModelStateEntry) -> None:
        """Apply the stored state of one model; ModelError if it is beyond the range of the engine."""
        if entry.pose is not None:
            model.place(self.engine, check_pose(entry.name, entry.pose))
        for name, pose, velocity in entry.links:
            link = model.handle.links.get(name)
            if link is None:
                log.warning("the world's <state> has link \"%s::%s\", which is not in the world", entry.name, name)
                continue
            if pose is not None:
                self.engine.set_link_pose(link, check_pose(entry.name + "::" + name, pose))
            if velocity is not None:
                check_velocity(entry.name + "::" + name, *velocity)
                self.engine.set_link_velocity(link, *velocity)

    def spawn(self, record: Model, pose: Pose, name: Optional[str] = None,
              namespace: Optional[str] = None) -> LiveModel:
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
        pose = check_pose(name, unit_pose(pose))
        for link in record.links:
            for part in (link,) + link.collisions:
                check_pose("%s::%s" % (name, part.name), part.pose)
        if record.script is not None or any(getattr(self.plugin_class(spec.filename), "places_model", False)
                                            for spec in record.plugins):
            record = kinematic(record)
        handle = self.engine.add_model(record, pose, name)
        model = LiveModel(record, handle, pose)
        self.models[name] = model
        self.model_changes += 1
        try:
            self._scene_update.add(model)
            self.plugins.start_all(model, namespace)
        except Exception:
            self.delete(name)           # remove the incomplete model
            raise
        return model

    @staticmethod
    def plugin_class(filename: str) -> Optional[Type[Plugin]]:
        """Return the class that implements a plugin library, or None; a subclass may have others."""
        return find_plugin(filename)

    def delete(self, name: str) -> None:
        """Remove a model from the world; its plugins close their topics."""
        model = self._model(name)
        for entry in model.plugins:
            self.plugins.stop(entry)
        model.plugins = []              # breaks a reference cycle, which the collector does not free if it was frozen
        self.engine.remove_model(model.handle)
        del self.models[name]
        self.model_changes += 1
        self.contact_counts.pop(name, None)
        self._scene_update.remove(model)

    def switched_off(self) -> List[str]:
        """Return the labels of plugins that were switched off after an exception."""
        return self.plugins.switched_off()

    def _model(self, name: str) -> LiveModel:
        if name not in self.models:
            raise NotFoundError("model \"%s\" does not exist; models: %s" % (name, list_names(self.models)))
        return self.models[name]

    def add_observer(self, plugin: Plugin, label: str) -> None:
        """Add a plugin of the world, which takes part in every step; it must be configured already.

        Parameters
        ----------
        plugin : Plugin
        label : str
            Name for messages.
        """
        self.plugins.add_observer(plugin, label)

    @property
    def observers(self) -> List[Entry]:
        """The plugins of the world itself."""
        return self.plugins.observers

    @property
    def lost(self) -> Sequence[str]:
        """Names of models that left the world and will be deleted before the next step."""
        return self._lost

    def refresh_pictures(self) -> PictureScene:
        """Return what cameras see, with all poses up to date; the first call reads meshes and textures."""
        if self._pictures is None:
            from m2wr_sim.runtime.picture_update import PictureUpdate  # its kernels are not needed without cameras
            self._pictures = PictureUpdate(self)
        self._pictures.look = self.look
        return self._pictures.refresh()

    def refresh_scene(self) -> None:
        """Update the poses in the ray scene if a link may have moved."""
        self._scene_update.refresh()

    # ---- time --------------------------------------------------------------------------------------------------

    def advance(self, until_ns: int, lazily: bool = False) -> int:
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
        query_all = not lazily or first_ns > events.valid_ns or events.stale or self.ports.waiting()
        if query_all:
            if self._pending:
                self._catch_up()
            self.ports.deliver()
            # without lazy stepping the caller may change the world between this call and the next
            events.valid_ns = first_ns + _HOLD_NS if lazily else 0
        if first_ns >= self._clock_due_ns:
            self.ports.clock(first_ns)
            self._clock_due_ns = first_step(first_ns + self._clock_period_ns, first_ns, step_ns)
        if events.stale:
            events.fill(self.plugins.entries())
        if query_all or first_ns > events.calm_ns:
            events.act(now_ns, step_ns, query_all)
        stop_ns = self._clock_due_ns - step_ns          # the least of these; comparisons are faster than min
        if until_ns < stop_ns:
            stop_ns = until_ns
        if events.calm_ns < stop_ns:
            stop_ns = events.calm_ns
        if events.sample_ns < stop_ns:
            stop_ns = events.sample_ns
        if lazily and events.valid_ns < stop_ns:
            stop_ns = events.valid_ns
        count = (stop_ns - now_ns) // step_ns if stop_ns > first_ns else 1
        self._pending += count
        self.steps += count
        self.now_ns = now_ns = now_ns + count * step_ns
        if not lazily or now_ns >= events.sample_ns:
            if events.stale:
                events.fill(self.plugins.entries())
            events.measure(now_ns, lazily)
            if events.valid_ns - now_ns < _HOLD_NS // 2:
                events.valid_ns = 0         # query all plugins next, which is cheap now that the engine is up to date
        return now_ns

    def moving_shapes(self) -> Optional[Tuple[Callable[[], None], Callable[[], None]]]:
        """Return the functions that read the poses of all moving shapes, and that move them in the ray scene.

        Returns
        -------
        (callable, callable) or None
            None if there is no such shape.
        """
        return self._scene_update.moving_shapes()

    def collect_contacts(self) -> None:
        """Take over the contacts that the engine has found."""
        contacts = self.engine.drain_contact_events()
        if contacts:
            self._collect(contacts)

    def settle(self) -> None:
        """Let the engine catch up with the simulated time; all plugins are queried before the next step."""
        self._event_queue.valid_ns = 0
        self._catch_up()
        self._delete_lost()

    def _catch_up(self) -> None:
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
            self.collect_contacts()

    def _abandon(self, error: LostError) -> None:
        """Remove models that left the world from physics and scene; their plugins end later.

        A plugin may be running now and may still read its model.
        """
        log.error("%s. Removed: %s; the simulation continues with the others (parameter ~loss_ends: end instead)",
                  error, ", ".join("model \"%s\"" % name for name in error.models))
        for name in error.models:
            model = self.models[name]
            self.engine.abandon_model(model.handle)
            self._scene_update.hide(name)
            self._lost.append(name)
            self.model_changes += 1

    def _delete_lost(self) -> None:
        """Delete the models that left the world; called while no plugin is running."""
        while self._lost:
            self.delete(self._lost.pop())

    def _collect(self, contacts: Sequence[ContactEvent]) -> None:
        for contact in contacts:
            for name in {side.split("::")[0] for side in (contact.first, contact.second)}:
                if name in self.models and not self.models[name].record.static:
                    self.contact_counts[name] = self.contact_counts.get(name, 0) + 1
            if len(self.contacts) < _CONTACTS_KEPT:
                self.contacts.append(contact)

    # ---- state services ----------------------------------------------------------------------------------------

    def frame_state(self, name: str) -> Optional[LinkState]:
        """Return the LinkState of a reference frame, None for the world; NotFoundError if there is none."""
        return find_frame(self.models.values(), self.engine, name)

    def model_state(self, name: str, frame: str = "") -> Relative:
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

    def pose_in_world(self, pose: Pose, frame: str) -> Pose:
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
        pose = unit_pose(pose)
        reference = self.frame_state(frame)
        return pose if reference is None else compose((reference.position, reference.orientation), pose)

    def set_model_state(self, name: str, pose: Pose, linear: Sequence[float], angular: Sequence[float],
                        frame: str = "") -> None:
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
        check_velocity(name, linear, angular)
        reference = self.frame_state(frame)
        if reference is not None:
            linear, angular = rotate(reference.orientation, linear), rotate(reference.orientation, angular)
        model.place(self.engine, check_pose(name, self.pose_in_world(pose, frame)))
        model.set_velocity(self.engine, linear, angular)

    def set_joint_positions(self, name: str, positions: Mapping[str, float]) -> None:
        """Set joint positions of a model.

        Parameters
        ----------
        name : str
        positions : dict
            Name of a joint -> position [rad or m]; unknown names and fixed joints are ignored.
        """
        model = self._model(name)
        for joint in model.record.joints:
            for name in [joint.name + suffix for suffix in ("", SECOND_AXIS)[:len(joint.axes())]]:
                if name in positions:
                    model.set_joint_position(self.engine, name, positions[name])

    # ---- resets ------------------------------------------------------------------------------------------------

    def reset_world(self) -> None:
        """Move models to their initial poses, at rest; the time continues, and joints do not move."""
        for model in self.models.values():
            model.place(self.engine, model.reset_pose)
            model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.plugins.restart_all(self.now_ns, rewound=False)

    def reset_simulation(self) -> None:
        """Restart the simulation: time zero, random sequences from the seed, initial poses and joints, at rest."""
        self.now_ns, self.steps = 0, 0
        self._clock_due_ns = 0
        self.engine.forget()
        self.engine.reseed(self.config.seed)
        for model in self.models.values():
            model.restore(self.engine)
            if not model.record.static:
                model.set_velocity(self.engine, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.contacts, self.contact_counts = [], {}
        self.plugins.restart_all(self.now_ns, rewound=True)

    def close(self) -> None:
        """Stop all plugins and free the world."""
        self.plugins.stop_all()
        self.engine.close()
