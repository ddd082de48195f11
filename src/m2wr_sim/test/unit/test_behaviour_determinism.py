# SPDX-License-Identifier: BSD-3-Clause
"""The same seed gives the same bytes on every topic, in another process too; another seed gives other noise only."""
import json
import os
import subprocess
import sys

import pytest

import conftest
from conftest import SOURCE

RUN = """
import hashlib, json, sys
import conftest
from m2wr_sim.api.loading import read_robot
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.sensors.ray_scene import RayScene

seed, kind, solver = int(sys.argv[1]), sys.argv[2], sys.argv[3]
robot = read_robot("m2wr")
engine = conftest.factory.make_engine(kind, EngineSettings(step_ns=int(sys.argv[4]) * 1000000, solver=solver))
engine.reseed(seed)
rig = conftest.Rig(Simulator(engine, RayScene(), LocalPorts(conftest.copied), SimConfig(seed=seed)))
for model in (conftest.ground(), conftest.box("wall", 3, 0, 0.5, size=(0.2, 6, 1)),
              conftest.cylinder("post", 2, 1, 0.5),
              conftest.box("crate", 1, 0, 0.2, size=(0.3, 0.3, 0.3), static=False),
              conftest.box("crate2", 1, 0, 0.6, size=(0.2, 0.2, 0.2), static=False)):
    rig.simulator.spawn(model, model.pose)
for name, noise, library in (("camera", "<noise><type>gaussian</type><stddev>0.02</stddev></noise>", "camera"),
                             ("depth", "", "openni_kinect")):
    eye, = load_sdf_models('''<sdf version="1.6"><model name="eye"><static>1</static><link name="l"><sensor name="s"
        type="%s"><update_rate>10</update_rate><camera><image><width>64</width><height>48</height></image>%s</camera>
        <plugin name="p" filename="libgazebo_ros_%s.so"><cameraName>%s</cameraName><frameName>eye</frameName></plugin>
        </sensor></link></model></sdf>''' % (name, noise, library, name))
    rig.simulator.spawn(eye, conftest.at(-2.5, 0.2, 0.6), name, "/")
rig.simulator.spawn(robot, conftest.at(z=0.1), "one", "/")
rig.simulator.spawn(robot, conftest.at(-1.5, 0.3, 0.1), "two", "/two")
for linear, angular in ((0.5, 0.1), (-0.2, 0.9), (0.4, -0.3)):
    rig.send(linear, angular).send(angular, linear, "/two/cmd_vel").run(0.5)
rig.simulator.delete("crate2")
rig.run(0.3)
hashes = {}
for topic, port in rig.ports.topics.items():
    assert port.messages, topic
    hashes[topic] = hashlib.sha256("".join(map(str, port.messages)).encode()).hexdigest()
for name, value in (("tf", rig.ports.transforms), ("clock", rig.ports.clock_ns), ("contacts", rig.simulator.contacts),
                    ("crate", rig.pose("crate"))):
    assert value, name
    hashes[name] = hashlib.sha256(repr(value).encode()).hexdigest()
rig.simulator.close()
print(json.dumps(hashes))
"""


def run(seed, kind=conftest.ENGINES[0], solver="step", hash_seed="0", step_ms=2):
    """Run the program in a process of its own; Python's own hash seed must not matter."""
    result = subprocess.run([sys.executable, "-c", RUN, str(seed), kind, solver, str(step_ms)],
                            cwd=str(SOURCE.parent / "test" / "unit"),
                            env=dict(os.environ, PYTHONHASHSEED=hash_seed), stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, universal_newlines=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.parametrize("solver, step_ms", [("step", 1), ("step", 5), ("quick", 2)])
def test_the_same_seed_gives_the_same_bytes(solver, step_ms):
    first = run(3, conftest.ENGINES[0], solver, "1", step_ms)
    assert first == run(3, conftest.ENGINES[0], solver, "2", step_ms)
    assert first == run(3, "pyode", solver, "3", step_ms)        # the slower engine gives the very same numbers
    assert {"/odom", "/two/odom", "/m2wr/laser/scan", "/joint_states", "/two/joint_states", "tf"} < set(first)
    if len(conftest.ENGINES) > 1:           # pictures need numba
        assert {"/camera/image_raw", "/depth/depth/image_raw", "/depth/points"} < set(first)


def test_another_seed_gives_other_noise_and_the_same_motion():
    one, two = run(3), run(4)
    noisy = {"/m2wr/laser/scan", "/camera/image_raw"} & set(one)
    assert {name for name in one if one[name] != two[name]} == noisy
