"""The state topics of the world itself: all models, all links."""
from gazebo_msgs.msg import LinkStates, ModelStates
from geometry_msgs.msg import Pose, Twist

from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.runtime.schedule import StrictSchedule


class WorldStates(Plugin):
    """Publishes ``~model_states`` and ``~link_states`` while somebody listens.

    Parameters
    ----------
    simulator : Simulator
    models_port, links_port : ports
        Where to publish.
    rate : float
        Hz of simulated time; 0 publishes with every step, as Gazebo does.
    """

    def __init__(self, simulator, models_port, links_port, rate):
        self._simulator, self._models_port, self._links_port = simulator, models_port, links_port
        self._schedule = StrictSchedule(rate, simulator.now_ns)

    def configure(self, spec, ctx):
        """Nothing to configure: this plugin stands for no tag."""

    def next_before(self, now_ns):
        if not (self._models_port.wanted() or self._links_port.wanted()):
            return NEVER
        due_ns = self._schedule.next_due(self._simulator.step_ns)
        if due_ns <= now_ns:                    # woke up after a pause without listeners: no catching up
            self._schedule.restart(now_ns - self._schedule.period_ns)
        return max(due_ns, now_ns + self._simulator.step_ns)

    def before_step(self, now_ns):
        if not self._schedule.due(now_ns):
            return
        simulator = self._simulator
        simulator.ports.moment(now_ns)
        if self._models_port.wanted():
            message = ModelStates()
            for model in simulator.models.values():
                self._append(message, model.name, model.state(simulator.engine))
            self._models_port.publish(message)
        if self._links_port.wanted():
            message = LinkStates()
            for model in simulator.models.values():
                for name, link in model.handle.links.items():
                    self._append(message, "%s::%s" % (model.name, name), simulator.engine.link_state(link))
            self._links_port.publish(message)

    @staticmethod
    def _append(message, name, state):
        pose, twist = Pose(), Twist()
        pose.position.x, pose.position.y, pose.position.z = state.position
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = state.orientation
        twist.linear.x, twist.linear.y, twist.linear.z = state.linear_velocity
        twist.angular.x, twist.angular.y, twist.angular.z = state.angular_velocity
        message.name.append(name)
        message.pose.append(pose)
        message.twist.append(twist)

    def reset(self, now_ns, rewound):
        self._schedule.restart(now_ns)
