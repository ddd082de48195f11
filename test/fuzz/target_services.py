# SPDX-License-Identifier: BSD-3-Clause
"""All of Gazebo's services and topics, called in this process with extreme values, in long sequences between steps."""
import io
import zlib
from unittest import mock

import mutations
from harness import Target, Wrong
from messages import Filler, finite_floats
from target_documents import corpus

_STEPS = (0, 0, 1, 1, 3, 20, 100)
_STATES = ("get_model_state", "get_link_state")     # their answers must be finite


class _Registrar:
    """Replaces rospy.Service and rospy.Subscriber: stores the handlers."""

    def __init__(self):
        self.services, self.topics = {}, {}

    def service(self, name, kind, handler):
        self.services[name.lstrip("~")] = (kind, handler)
        return mock.Mock()

    def subscriber(self, name, kind, callback, arguments=None, **_):
        self.topics[name.lstrip("~")] = (kind, lambda message: callback(message, arguments))
        return mock.Mock()


class _Loop:
    """The node's loop without a thread: a request is served at once, as at the end of a batch of steps."""

    def __init__(self, simulator):
        self._simulator = simulator

    def call(self, function, *_, **__):
        self._simulator.settle()
        return function()

    def __getattr__(self, _):
        return lambda *arguments, **options: None


class Services(Target):
    """A case is a list of operations: ``("service", name, seed)``, the same of ``topic`` and ``plugin``, and steps.

    The values of a request come from its seed and from what is in the world when it is made, so that a sequence stays
    valid when parts of it are removed.
    """

    name, cpu, weight = "services", 4.0, 4.0
    extremes = 0.15

    def prepare(self):
        import rospy

        import worlds
        from m2wr_sim.errors import SimError
        from m2wr_sim.ros.gazebo_services import gazebo_api
        from m2wr_sim.ros.gazebo_services.spawning import Spawner
        from m2wr_sim.ros.gazebo_services.table import SERVICES
        from m2wr_sim.warm_up import warm_up
        warm_up("auto")
        self.rospy, self.worlds, self.gazebo_api, self.spawner_class = rospy, worlds, gazebo_api, Spawner
        self.foreseen = (SimError, rospy.ServiceException)
        self.names = sorted(SERVICES)
        self.changing = [name for name in self.names if name.startswith(("apply_", "set_", "spawn_"))]
        self.texts = {"spawn_urdf_model": corpus("*.urdf"), "spawn_sdf_model": corpus("*.sdf")}
        self.trees = {name: mutations.Trees(texts) for name, texts in self.texts.items()}
        gazebo_api._DRAIN = 0.0             # s of waiting for the network, which does not exist here

    def make(self, rng):
        case = []
        for _ in range(rng.randrange(3, 24)):
            kind = rng.randrange(10)
            if kind < 5:
                names = self.names if rng.randrange(4) == 0 else self.changing
                case.append(("service", rng.choice(names), rng.randrange(2 ** 32)))
            elif kind == 5:
                case.append(("topic", rng.choice(("set_model_state", "set_link_state")), rng.randrange(2 ** 32)))
            elif kind == 6:
                case.append(("plugin", rng.randrange(100), rng.randrange(2 ** 32)))
            else:
                case.append(("step", rng.choice(_STEPS), 0))
        return case + [("step", 20, 0)]

    def describe(self, case):
        return "\n".join(map(str, case)).encode()

    def run(self, case):
        world = self.worlds.load_world(corpus("stored.world")[0])
        simulator = self.worlds.make_simulator(world)
        try:
            registrar = _Registrar()
            with mock.patch.object(self.rospy, "Service", registrar.service), \
                    mock.patch.object(self.rospy, "Subscriber", registrar.subscriber), \
                    mock.patch.object(self.gazebo_api, "make_reconfigure", lambda *_: None):
                spawner = self.spawner_class(simulator)
                self.gazebo_api.GazeboApi(simulator, _Loop(simulator), spawner, True, lambda _: None)
            spawn = registrar.services["spawn_urdf_model"]
            spawn[1](spawn[0]._request_class(model_name="cart", model_xml=self.texts["spawn_urdf_model"][0]))
            for operation in case:
                self._operate(simulator, registrar, *operation)
            simulator.paused = False
            self.worlds.run(simulator, 20)
        finally:
            simulator.close()

    def _operate(self, simulator, registrar, kind, what, seed):
        if kind == "step":
            self.worlds.run(simulator, what)
            return
        rng = mutations.generator(seed, kind, zlib.crc32(str(what).encode()))
        filler = Filler(lambda field: _names_in(simulator, field), self.extremes)
        if kind == "plugin":
            topics = sorted(simulator.ports.subscriptions)
            if topics:
                topic = topics[what % len(topics)]
                message = filler.fill(rng, simulator.ports.subscriptions[topic].message_class())
                simulator.ports.send(topic, _over_the_wire(message))
            return
        if kind == "topic":
            message_class, handler = registrar.topics[what]
            handler(_over_the_wire(filler.fill(rng, message_class())))
            return
        service, handler = registrar.services[what]
        request = filler.fill(rng, service._request_class())
        if what in self.trees:
            text = rng.choice(self.texts[what])
            request.model_xml = self.trees[what].change(rng) if rng.randrange(3) == 0 else text
            request.model_name = "new%d" % rng.randrange(4) if rng.randrange(4) else request.model_name
        try:
            response = handler(_over_the_wire(request))
        except self.foreseen:
            return
        response.serialize(io.BytesIO())
        if what in _STATES and response.success:
            for name in finite_floats(response):
                raise Wrong("%s answers with %s that is not finite" % (what, name))


def _over_the_wire(message):
    """Return a message as a receiver gets it."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


def _names_in(simulator, field):
    """Return the names that are valid at present in a field of that name."""
    links = ["%s::%s" % (name, link) for name, model in simulator.models.items() for link in model.handle.links]
    if "frame" in field or "relative" in field:
        return ["", "world", "map"] + links + list(simulator.models)
    if "joint" in field:
        return [joint for model in simulator.models.values() for joint in model.handle.joints]
    if "link" in field or "body" in field:
        return links
    if "light" in field:
        return list(simulator.lights)
    return list(simulator.models)[1:] + ["ground_plane"]
