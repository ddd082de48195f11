# SPDX-License-Identifier: BSD-3-Clause
"""What a plugin is, and what it is given.

A plugin works at two places of a step.  ``before_step`` runs when simulated time has already advanced but the bodies
have not: there commands become motor targets and odometry is published, as Gazebo's model plugins do.  ``after_step``
runs on the state the step produced: there sensors measure.  Each place is asked beforehand for the next time it wants
to run; between those times the engine steps without looking back.
"""
import abc

from m2wr_sim.errors import PluginError
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE

NEVER = None


class Plugin(abc.ABC):
    """Base of all plugins; see the module docstring for the order of calls."""

    @abc.abstractmethod
    def configure(self, spec, ctx):
        """Read parameters and take what is needed from the context.

        Parameters
        ----------
        spec : PluginReader
            The plugin's tags.
        ctx : PluginContext
            The plugin's model, the physics, and the world outside.

        Raises
        ------
        PluginError
            If the plugin cannot work; the simulation goes on without it.
        """

    def next_before(self, now_ns):
        """Return the time [ns] of the next step that must not be taken without ``before_step``, or NEVER."""
        return NEVER

    def before_step(self, now_ns):
        """Act at the beginning of the step that ends at ``now_ns``."""

    def next_after(self, now_ns):
        """Return the time [ns], later than ``now_ns``, of the next ``after_step``, or NEVER."""
        return NEVER

    def after_step(self, now_ns):
        """Act on the state at ``now_ns``."""

    def period_ns(self):
        """Return the simulated time [ns] between two messages, 0 for one a step; NEVER if it has no rhythm."""
        return getattr(getattr(self, "_schedule", None), "period_ns", NEVER)

    def reset(self, now_ns, rewound):
        """Forget the past; ``rewound`` tells that simulated time has gone back to zero."""

    def close(self):
        """Let go of everything outside; called before the model disappears."""


class LazySensor(Plugin):
    """A sensor that reads only while somebody listens, and begins anew whenever somebody comes.

    A subclass says who listens (:meth:`wanted`), what beginning anew means (:meth:`wake`) and when it reads next; its
    ``after_step`` does nothing unless it is ``awake``.
    """

    awake = False

    @abc.abstractmethod
    def wanted(self):
        """Tell whether anybody listens."""

    @abc.abstractmethod
    def wake(self, now_ns):
        """Forget what was before nobody listened."""

    @abc.abstractmethod
    def next_reading(self, now_ns):
        """Return the time [ns], later than ``now_ns``, of the next reading."""

    def next_after(self, now_ns):
        if not self.wanted():
            self.awake = False
            return NEVER
        if not self.awake:
            self.awake = True
            self.wake(now_ns)
        return self.next_reading(now_ns)


class PluginReader:
    """Typed access to the tags of a :class:`~m2wr_sim.model.types.PluginSpec`, remembering which ones were read."""

    def __init__(self, spec, known=()):
        self.spec = spec
        self._read = {"robotNamespace", "alwaysOn", "rosDebugLevel"} | set(known)
        self.problems = []                  # sentences on values that were not understood
        self.defaults = []                  # (tag, default) of what was missing, for one line in the log

    def text(self, tag, default=None):
        """Return the text of a tag; without a default a missing tag is an error."""
        self._read.add(tag)
        found = self.spec.find(tag)
        if found is not None and found != "":
            return found
        if default is None:
            raise PluginError("%s: needs a <%s> element" % (self.spec.where, tag))
        self.defaults.append((tag, default))
        return default

    def number(self, tag, default=None, minimum=None):
        """Return a finite number, at least ``minimum``."""
        text = self.text(tag, default)
        try:
            value = float(text)
        except (TypeError, ValueError):
            value = float("nan")
        if not abs(value) < float("inf") or (minimum is not None and value < minimum):
            raise PluginError("%s: <%s> holds \"%s\"; expected a finite number%s"
                              % (self.spec.where, tag, text, "" if minimum is None else " of at least %g" % minimum))
        return value

    def length(self, tag, default):
        """Return a length [m] between the smallest and the largest size of a shape; PluginError for any other value."""
        text = self.text(tag, default)
        try:
            value = float(text)
        except (TypeError, ValueError):
            value = float("nan")
        if not LEAST_SIZE <= value <= FARTHEST:
            raise PluginError("%s: <%s> holds \"%s\"; expected a length from %g to %g m"
                              % (self.spec.where, tag, text, LEAST_SIZE, FARTHEST))
        return value

    def pass_over(self, *tags):
        """Note tags as known although they have no effect, in Gazebo neither."""
        self._read.update(tags)

    def vector(self, tag):
        """Return three finite numbers; zeros where the tag is missing."""
        text = self.text(tag, "0 0 0")
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        if len(values) != 3 or not all(abs(value) < float("inf") for value in values):
            raise PluginError("%s: <%s> holds \"%s\"; expected three finite numbers" % (self.spec.where, tag, text))
        return values

    def flag(self, tag, default):
        """Return a boolean (true, false, 1, 0 in any case); anything else keeps the default, as in Gazebo."""
        text = self.text(tag, "true" if default else "false").strip()
        values = {"true": True, "1": True, "false": False, "0": False}
        if text.lower() not in values:
            self.problems.append("<%s> must be either true or false but is \"%s\"; %s is taken"
                                 % (tag, text, str(default).lower()))
        return values.get(text.lower(), default)

    def choice(self, tag, values, default):
        """Return one of ``values``; anything else keeps the default, as in Gazebo."""
        text = self.text(tag, default)
        if text not in values:
            self.problems.append("<%s> must be one of %s but is \"%s\"; %s is taken"
                                 % (tag, ", ".join(values), text, default))
        return text if text in values else default

    def known(self):
        """Return the tags that have been asked for or passed over."""
        return frozenset(self._read)

    def unread(self):
        """Return the tags nobody has asked for, in document order, without repeats."""
        seen = []
        for tag, _ in self.spec.parameters:
            if tag.split("/")[0] not in self._read and tag not in seen:
                seen.append(tag)
        return seen


def driven_joint(ctx, spec, name):
    """Return the engine's number of a joint that is to be driven; PluginError where a motor cannot drive it."""
    number, kind = ctx.joint(name), ctx.joint_record(name).kind
    if kind in ("fixed", "ball"):
        raise PluginError("%s: joint \"%s\" of type %s cannot be driven; expected one that turns about an axis"
                          % (spec.spec.where, name, kind))
    return number


class PluginContext(abc.ABC):
    """The world as one plugin sees it; the simulator provides the inner part, the ROS edge the outer one."""

    model_name = ""
    sensor = None               # Sensor record, for sensor plugins
    sensor_link = None          # engine's number of the link that carries the sensor
    sensor_collisions = ()      # names of that link's collisions, without model and link
    step_ns = 0
    now_ns = 0                  # simulated time at configuration
    physics = None              # Engine
    scene = None                # what rays see
    log = None                  # a standard logger
    wheel_convention = "noetic"
    command_timeout_ns = 0      # 0: the last command holds for ever, as in Gazebo

    def tell_once(self, level, text, *values):
        """Log a line of the configuration, unless it was logged before of another model like this one."""
        self.log.log(level, text, *values)

    @abc.abstractmethod
    def link(self, name):
        """Return the engine's number of a link of this model; PluginError names the links there are."""

    @abc.abstractmethod
    def joint(self, name):
        """Return the engine's number of a joint of this model; PluginError names the joints there are."""

    @abc.abstractmethod
    def joint_record(self, name):
        """Return the :class:`~m2wr_sim.model.types.Joint` of that name."""

    @abc.abstractmethod
    def joint_position(self, name):
        """Return where a joint's anchor is in the model frame, ``(x, y, z)``, in the initial configuration."""

    @abc.abstractmethod
    def model_state(self):
        """Return the LinkState of the model: its canonical link's frame."""

    @abc.abstractmethod
    def pose_in_model(self, link):
        """Return ``(position, orientation)`` of a link relative to the model's own frame, now."""

    @abc.abstractmethod
    def link_record(self, name):
        """Return the :class:`~m2wr_sim.model.types.Link` of that name, with the mass and inertia that act."""

    @abc.abstractmethod
    def collision_name(self, name):
        """Return the ``model::link::collision`` name of a collision of the sensor's link."""

    @abc.abstractmethod
    def set_motion(self, linear, angular):
        """Set the velocity of the whole model: that of its frame's origin, and the angular one, in the world frame.

        Every link gets the velocity it has in that motion; what turns or rolls in a joint goes on doing so.
        """

    @abc.abstractmethod
    def refresh_scene(self):
        """Bring the poses of all moving obstacles in ``scene`` up to date."""

    @abc.abstractmethod
    def rng(self, name):
        """Return a random generator of this plugin's own, made from the seed and ``name``."""

    @abc.abstractmethod
    def moment(self, now_ns):
        """Return a message time stamp."""

    @abc.abstractmethod
    def frame(self, name, namespace=""):
        """Return a frame name with the tf prefix that is set for the plugin's namespace, or above it."""

    @abc.abstractmethod
    def advertise(self, topic, message_class, queue_size=10, namespace=None):
        """Return a port with ``publish(message)`` and ``wanted()``, which tells whether anybody listens."""

    @abc.abstractmethod
    def subscribe(self, topic, message_class, callback, namespace=None):
        """Deliver messages to ``callback`` at step boundaries, in the simulation's own thread."""

    @abc.abstractmethod
    def serve(self, name, service_class, handler, namespace=None):
        """Offer a service; ``handler(request)`` returns the response, in the simulation's own thread."""

    @abc.abstractmethod
    def send_transform(self, stamp, parent, child, position, orientation):
        """Publish one transform on ``/tf``."""
