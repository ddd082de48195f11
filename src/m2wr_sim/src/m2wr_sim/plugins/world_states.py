# SPDX-License-Identifier: BSD-3-Clause
"""The state topics of the world itself: all models, all links."""
import numpy as np
from geometry_msgs.msg import Pose, Twist

from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.runtime.schedule import StrictSchedule


class StateTable:
    """The states of many things, as a record that ports take in place of a message.

    Attributes
    ----------
    names : list of str
    poses : (n, 7) float64
        Position x y z [m] and orientation x y z w in world.
    twists : (n, 6) float64
        Linear [m/s] and angular [rad/s] velocity in world axes.
    """

    def __init__(self, names):
        self.names = names
        self.poses, self.twists = np.zeros((len(names), 7)), np.zeros((len(names), 6))

    def message(self, message_class):
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


class _Reader:
    """Fills a table row by row; what stands still is written again only after somebody has moved it.

    Parameters
    ----------
    rows : list of (str, int, callable)
        Name, the engine's number of the link, and what returns the LinkState to tell.
    resting : set of int
        Links of static models.
    """

    def __init__(self, rows, resting):
        self._rows = [(index, link, state) for index, (_, link, state) in enumerate(rows)]
        self._resting = {link: None for link in resting}
        self.table = StateTable([name for name, _, _ in rows])

    def read(self, engine):
        poses, twists, resting = self.table.poses, self.table.twists, self._resting
        for index, link, state in self._rows:
            if link in resting:
                pose = engine.link_pose(link)
                if pose == resting[link]:
                    continue
                resting[link] = pose
            position, orientation, linear, angular = state(engine)
            poses[index] = tuple(position) + tuple(orientation)
            twists[index] = tuple(linear) + tuple(angular)
        return self.table


class WorldStates(Plugin):
    """Publishes ``~model_states`` and ``~link_states`` while somebody listens.

    Parameters
    ----------
    simulator : Simulator
    models_port, links_port : ports
        Where to publish, as :class:`StateTable`.
    rate : float
        Hz of simulated time; 0 publishes with every step, as Gazebo does.
    wanted : callable, optional
        Tells of a Model record whether it is to be told of; all are by default.
    """

    def __init__(self, simulator, models_port, links_port, rate, wanted=None):
        self._simulator, self._models_port, self._links_port = simulator, models_port, links_port
        self._schedule = StrictSchedule(rate, simulator.now_ns)
        self._seen, self._models, self._links = None, None, None
        self._chosen = wanted or (lambda record: True)

    def configure(self, spec, ctx):
        """Nothing to configure: this plugin stands for no tag."""

    def next_before(self, now_ns):
        if not (self._models_port.wanted() or self._links_port.wanted()):
            return NEVER
        due_ns = self._schedule.next_due(now_ns, self._simulator.step_ns)
        if due_ns <= now_ns:                    # woke up after a pause without listeners: no catching up
            self._schedule.restart(now_ns - self._schedule.period_ns)
        return max(due_ns, now_ns + self._simulator.step_ns)

    def before_step(self, now_ns):
        if not self._schedule.due(now_ns):
            return
        simulator = self._simulator
        simulator.ports.moment(now_ns)
        models = [model for model in simulator.models.values() if self._chosen(model.record)]
        if models != self._seen:                # each model is one object from spawn to end
            self._seen = models
            self._models, self._links = self._readers(models)
        if self._models_port.wanted():
            self._models_port.publish(self._models.read(simulator.engine))
        if self._links_port.wanted():
            self._links_port.publish(self._links.read(simulator.engine))

    @staticmethod
    def _readers(models):
        links = [("%s::%s" % (model.name, name), link, lambda engine, link=link: engine.link_state(link))
                 for model in models for name, link in model.handle.links.items() if "::" not in name]  # no nested ones
        resting = {link for model in models if model.record.static for link in model.handle.links.values()}
        return _Reader([(model.name, model.root, model.state) for model in models], resting), _Reader(links, resting)

    def reset(self, now_ns, rewound):
        self._schedule.restart(now_ns)
