# SPDX-License-Identifier: BSD-3-Clause
"""Robots, models and worlds as texts: read, spawned, and driven for a short time."""
import glob
import os

import mutations
from harness import ROOT, Target

CORPUS = os.path.join(ROOT, "test", "fuzz", "corpus")
FEW_STEPS, MORE_STEPS = 12, 150


def corpus(*patterns):
    """Return the texts of the files of the corpus that match, in the order of their names."""
    found = []
    for pattern in patterns:
        for path in sorted(glob.glob(os.path.join(CORPUS, pattern))):
            with open(path, encoding="utf-8") as stream:
                found.append(stream.read())
    if not found:
        raise LookupError("no file of %s is in %s" % (", ".join(patterns), CORPUS))
    return found


class _Document(Target):
    """A document that is changed mostly as a tree, otherwise as text or bytes."""

    patterns = ()
    cpu = 2.0

    def prepare(self):
        import worlds
        from m2wr_sim.errors import SimError
        from m2wr_sim.warm_up import warm_up
        self.worlds, self.foreseen = worlds, (SimError,)
        self.texts = corpus(*self.patterns)
        self.trees = mutations.Trees(self.texts)
        warm_up("auto")
        for text in self.texts:
            self.run(text)

    def make(self, rng):
        kind = rng.randrange(20)
        if kind < 17:
            return self.trees.change(rng)
        text = rng.choice(self.texts)
        if kind < 19:
            return mutations.change_text(rng, text)
        data = mutations.change_bytes(rng, text.encode(), [other.encode() for other in self.texts])
        return data.decode("utf-8", "replace")

    def smaller(self, case):
        return mutations.smaller_trees(case)

    def run(self, case):
        try:
            read = self.read(case)
        except self.foreseen:
            return
        self.use(read)

    def _drive(self, simulator):
        self.worlds.send_commands(simulator, 0.5, 0.3)
        self.worlds.run(simulator, FEW_STEPS)
        if len(simulator.models) < 8:
            self.worlds.run(simulator, MORE_STEPS)

    def use(self, record):
        simulator = self.worlds.make_simulator()
        try:
            try:
                simulator.spawn(record, self.worlds.upright(), "thing", "/")
            except self.foreseen:
                return
            self._drive(simulator)
            simulator.reset_simulation()
            self.worlds.run(simulator, 2)
            if "thing" in simulator.models:         # a model that diverged is removed
                simulator.delete("thing")
        finally:
            simulator.close()


class Urdf(_Document):
    """URDF with Gazebo's tags, as the service spawn_urdf_model takes it."""

    name, patterns, weight = "urdf", ("*.urdf",), 3.0

    def read(self, text):
        from m2wr_sim.model.urdf.loader import load_urdf
        return load_urdf(text, source="case.urdf")


class Sdf(_Document):
    """A model in SDF, as the service spawn_sdf_model takes it."""

    name, patterns, weight = "sdf", ("*.sdf",), 3.0

    def read(self, text):
        from m2wr_sim.model.sdf.loader import load_sdf
        models, _ = load_sdf(text, source="case.sdf", most_parts=10000)
        return models

    def use(self, models):
        for model in models[:3]:
            super().use(model)


class World(_Document):
    """A world file with a stored state."""

    name, patterns, weight = "world", ("*.world",), 3.0

    def read(self, text):
        from m2wr_sim.model.sdf.loader import load_world
        return load_world(text, source="case.world")

    def use(self, world):
        try:
            simulator = self.worlds.make_simulator(world)
        except self.foreseen:
            return
        try:
            self._drive(simulator)
            simulator.reset_world()
            self.worlds.run(simulator, 2)
        finally:
            simulator.close()


class Spawn(Target):
    """The beginning of a text selects its reader; the service may receive any text."""

    name, cpu, weight = "spawn_text", 1.0, 1.0

    def prepare(self):
        import rospy

        import worlds
        from m2wr_sim.errors import SimError
        from m2wr_sim.ros.gazebo_services.spawning import Spawner
        self.worlds, self.spawner_class, self.foreseen = worlds, Spawner, (SimError, rospy.ServiceException)
        self.texts = [text for text in corpus("*.urdf", "*.sdf") if len(text) < 2500]
        self.pieces = ("<!--", "-->", "<?", "?>", "<!DOCTYPE", "[", "]", ">", "<", " ", "\n", "\ufeff", "<robot",
                       "<sdf",
                       "<!--->", "<?xml", "]]>", "<![CDATA[", "&#0;", "</robot>", "xmlns:xacro=", "${", "}", "'", '"')

    def make(self, rng):
        rough = "".join(rng.choice(self.pieces) * rng.choice((1, 1, 1, 2, 25)) for _ in range(rng.randrange(1, 40)))
        text = rng.choice(self.texts)
        kind = rng.randrange(4)
        return (rough + text if kind < 2 else rough if kind == 2 else mutations.change_text(rng, rough + text))[:20000]

    def run(self, case):
        from gazebo_msgs.srv import SpawnModelRequest
        simulator = self.worlds.make_simulator()
        try:
            spawner = self.spawner_class(simulator)
            request = SpawnModelRequest(model_name="thing", model_xml=case)
            for handler in (spawner.spawn_urdf_model, spawner.spawn_sdf_model):
                try:
                    handler(request)
                except self.foreseen:
                    pass
                self.worlds.run(simulator, 2)
        finally:
            simulator.close()
