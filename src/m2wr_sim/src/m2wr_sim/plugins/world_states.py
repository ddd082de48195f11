# SPDX-License-Identifier: BSD-3-Clause
"""The topics with the states of all models and all links."""
from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Set, Tuple

import numpy as np

from m2wr_sim.messages import Pose, Twist
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import StrictSchedule

if TYPE_CHECKING:
    from m2wr_sim.model.types import Model
    from m2wr_sim.physics.engine import Engine

_Row = Tuple[str, int, Callable[[Any], Any]]


class StateTable:
    """The states of models or links; ports accept it instead of a message.

    Attributes
    ----------
    names : list of str
    poses : (n, 7) float64
        Position x y z [m] and orientation x y z w in world.
    twists : (n, 6) float64
        Linear [m/s] and angular [rad/s] velocity in world axes.
    """

    def __init__(self, names: List[str]) -> None:
        self.names = names
        self.poses, self.twists = np.zeros((len(names), 7)), np.zeros((len(names), 6))

    def message(self, message_class: Callable[..., Any]) -> Any:
        """Return a ModelStates or LinkStates."""
        made = message_class(name=list(self.names))
        for numbers in self.poses.tolist():
            pose = Pose()
            pose.position.x, pose.position.y, pose.position.z = numbers[:3]
            pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = numbers[3:]
            made.pose.append(pose)
        for numbers in self.twists.tolist():
            twist = Twist()
            twist.linear.x, twist.linear.y, twist.linear.z = numbers[:3]
            twist.angular.x, twist.angular.y, twist.angular.z = numbers[3:]
            made.twist.append(twist)
        return made


class _StateReader:
    """Fills a table row by row; rows of static models are updated only after a model was placed.

    Parameters
    ----------
    rows : list of (str, int, callable)
        Name, the engine's number of the link, and a function that returns the LinkState.
    resting : set of int
        Links of static models.
    """

    def __init__(self, rows: List[_Row], resting: Set[int]) -> None:
        self._rows = [(index, state) for index, (_, _, state) in enumerate(rows)]
        self._moving = [(index, state) for index, (_, link, state) in enumerate(rows) if link not in resting]
        self._placements = -1
        self.table = StateTable([name for name, _, _ in rows])

    def read(self, engine: Engine) -> StateTable:
        poses, twists, rows = self.table.poses, self.table.twists, self._moving
        if engine.placements != self._placements:       # a static model may have been placed
            self._placements, rows = engine.placements, self._rows
        for index, state in rows:
            position, orientation, linear, angular = state(engine)
            poses[index] = tuple(position) + tuple(orientation)
            twists[index] = tuple(linear) + tuple(angular)
        return self.table


def _link_state(engine: Engine, link: int) -> Any:
    return engine.link_state(link)


class WorldStates(Plugin):
    """Publishes ``~model_states`` and ``~link_states`` while subscribers take them.

    Parameters
    ----------
    simulator : Simulator
    models_port, links_port : ports
        Topics; they get a :class:`StateTable`.
    rate : float
        Hz of simulated time; 0 publishes with every step, as Gazebo does.
    wanted : callable, optional
        Returns whether to publish the states of a Model record; all by default.
    """

    def __init__(self, simulator: Any, models_port: Any, links_port: Any, rate: float,
                 wanted: Optional[Callable[[Model], bool]] = None) -> None:
        self._simulator, self._models_port, self._links_port = simulator, models_port, links_port
        self._models_due: Callable[[], bool] = getattr(models_port, "due", models_port.wanted)
        self._links_due: Callable[[], bool] = getattr(links_port, "due", links_port.wanted)
        self._audiences = [getattr(port, "audience", tuple) for port in (models_port, links_port)]
        self._shown: Any = None                 # what was published last, and to whom
        self._schedule = StrictSchedule(rate, simulator.now_ns)
        self._seen: Optional[List[Any]] = None
        self._models, self._links = self._readers([])
        self._chosen = wanted or (lambda record: True)

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        pass                # this plugin has no tags

    def next_before(self, now_ns: int) -> Optional[int]:
        if not (self._models_due() or self._links_due()):
            return NEVER
        due_ns = self._schedule.next_due(now_ns, self._simulator.step_ns)
        if due_ns <= now_ns:                    # first subscriber after a pause: skip what was due in it
            self._schedule.restart(now_ns - self._schedule.period_ns)
        return max(due_ns, now_ns + self._simulator.step_ns)

    def before_step(self, now_ns: int) -> None:
        if self._schedule.due(now_ns):
            self._publish(now_ns)

    def rest(self) -> None:
        """Publish the present states if they or the subscribers are new, in a simulation that does not advance."""
        if self._shown != self._present() and (self._models_due() or self._links_due()):
            self._publish(self._simulator.now_ns)

    def _present(self) -> Tuple[Any, ...]:
        """Return what tells apart states and subscribers: time, models, places, who subscribes."""
        simulator = self._simulator
        return (simulator.now_ns, simulator.model_changes, simulator.engine.placements,
                [audience() for audience in self._audiences])

    def _publish(self, now_ns: int) -> None:
        simulator, self._shown = self._simulator, self._present()
        simulator.ports.moment(now_ns)
        models = [model for model in simulator.models.values() if self._chosen(model.record)]
        if models != self._seen:                # a model remains the same object until it is deleted
            self._seen = models
            self._models, self._links = self._readers(models)
        if self._models_due():
            self._models_port.publish(self._models.read(simulator.engine))
        if self._links_due():
            self._links_port.publish(self._links.read(simulator.engine))

    @staticmethod
    def _readers(models: List[Any]) -> Tuple[_StateReader, _StateReader]:
        links: List[_Row] = [
            ("%s::%s" % (model.name, name), link, partial(_link_state, link=link))
            for model in models for name, link in model.handle.links.items() if "::" not in name]   # not nested
        resting = {link for model in models if model.record.static for link in model.handle.links.values()}
        return _StateReader([(model.name, model.root, model.state) for model in models], resting), _StateReader(
            links, resting)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
