# SPDX-License-Identifier: BSD-3-Clause
"""Both IMU plugins, compared with closed forms: at rest, on a circle, accelerating, in free fall."""
import math
from dataclasses import replace

import numpy as np
import pytest
from std_srvs.srv import EmptyRequest, EmptyResponse

from conftest import at, box
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Noise, PluginSpec, Sensor
from m2wr_sim.physics.engine import LinkState
from m2wr_sim.sensors.imu import GaussMarkovBias, ImuSensor

ORIGIN = (0.0, 0.0, 0.0)
GRAVITY = (0.0, 0.0, -9.8)
BODY, SENSOR = "libgazebo_ros_imu.so", "libgazebo_ros_imu_sensor.so"


def values(vector):
    return (vector.x, vector.y, vector.z)


def crate(library, pose=at(z=0.25), sensor=(), **tags):
    """Return a crate of 10 kg that carries an inertial unit, and the name of its topic."""
    model = box("crate", 0, 0, 0, static=False, mass=10.0)
    spec = PluginSpec("imu", library, tuple(tags.items()), where="crate: plugin \"imu\"")
    if library == BODY:
        return replace(model, pose=pose, plugins=(spec,))
    unit = Sensor("imu", "imu", plugins=(spec,), **dict({"update_rate": 100.0}, **dict(sensor)))
    return replace(model, pose=pose, links=(replace(model.links[0], sensors=(unit,)),))


@pytest.fixture(params=[BODY, SENSOR])
def library(request):
    return request.param


@pytest.fixture
def carried(make_rig):
    """Return a function that makes a rig with such a crate in it, and the name of the unit's topic there."""
    def make(library, pose=at(z=0.25), sensor=(), **tags):
        more = ({"bodyName": "link", "topicName": "/imu", "updateRate": "100"} if library == BODY else
                {"frameName": "unit", "topicName": "imu", "updateRateHZ": "100", "robotNamespace": "/"})
        rig = make_rig(joint_states=False)
        rig.simulator.spawn(crate(library, pose, sensor, **dict(more, **tags)), pose)
        return rig
    return make


def test_only_sensor_imu_includes_gravity_at_rest(carried, library):
    message = carried(library).run(1.0).messages("/imu")[-1]
    assert values(message.angular_velocity) == pytest.approx((0, 0, 0), abs=1e-6)
    expected = (0.0, 0.0, 9.8 if library == SENSOR else 0.0)
    assert values(message.linear_acceleration) == pytest.approx(expected, abs=1e-3)
    assert message.header.frame_id == ("unit" if library == SENSOR else "link")


def test_only_body_imu_measures_free_fall(carried, library):
    message = carried(library, at(z=50.0)).run(1.0).messages("/imu")[-1]
    expected = (0.0, 0.0, 0.0 if library == SENSOR else -9.8)
    assert values(message.linear_acceleration) == pytest.approx(expected, abs=1e-6)


def test_first_message_follows_one_period_after_subscription(carried, library):
    rig = carried(library)
    rig.ports.topics["/imu"].listening = False
    rig.run(1.0)
    rig.ports.topics["/imu"].listening = True
    first = rig.run(0.05).stamps_ms("/imu")[0]
    assert first == (1010 if library == SENSOR else 1001)
    assert values(rig.messages("/imu")[-1].linear_acceleration)[2] == pytest.approx(
        9.8 if library == SENSOR else 0.0, abs=0.05)


def test_rates_are_in_the_axes_of_the_body(carried, library):
    turn = quaternion_from_rpy(0.5 * math.pi, 0.0, 0.0)         # the body's y axis points up
    rig = carried(library, ((0.0, 0.0, 80.0), turn))
    rig.simulator.set_model_state("crate", rig.pose("crate"), ORIGIN, (0.0, 0.0, 2.0))
    message = rig.run(0.1).messages("/imu")[-1]
    assert values(message.angular_velocity) == pytest.approx((0.0, 2.0, 0.0), abs=1e-3)


def test_acceleration_is_in_the_axes_of_the_body(carried, library):
    rig = carried(library, ((0.0, 0.0, 80.0), quaternion_from_rpy(0.0, 0.0, 0.5 * math.pi)))
    rig.simulator.engine.set_gravity((1.0, 0.0, 0.0))
    for _ in range(20):
        rig.run(0.01)
    acceleration = values(rig.messages("/imu")[-1].linear_acceleration)
    assert acceleration == pytest.approx((0.0, -1.0 if library == BODY else 0.0, 0.0), abs=1e-3)


def test_variance_overflow_gives_infinity(carried, library):
    message = carried(library, gaussianNoise="1e200").run(0.1).messages("/imu")[-1]
    assert message.angular_velocity_covariance[0] == math.inf


def test_variances_are_the_squared_noise(carried, library):
    messages = carried(library, gaussianNoise="0.2").run(5.0).messages("/imu")[50:]
    for name in ("orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance"):
        assert np.allclose(np.reshape(getattr(messages[0], name), (3, 3)), 0.04 * np.eye(3))
    for name in ("angular_velocity", "linear_acceleration"):
        scatter = np.std([values(getattr(message, name)) for message in messages], axis=0)
        assert scatter == pytest.approx(0.2, rel=0.2)
    spread = np.std([message.orientation.x for message in messages])
    assert spread == pytest.approx(0.2, rel=0.2) if library == SENSOR else spread < 1e-4


def test_offset_rotates_the_orientation(carried, library):
    message = carried(library, at(z=0.25, yaw=0.4), rpyOffset="0 0 0.2").run(0.5).messages("/imu")[-1]
    assert 2.0 * math.atan2(message.orientation.z, message.orientation.w) == pytest.approx(0.6, abs=1e-4)


# -- what only one of them has ------------------------------------------------------------------------------------

def test_body_imu_offers_calibration_service(carried):
    rig = carried(BODY, serviceName="imu/calibrate", robotNamespace="bot")
    service = rig.ports.services["/bot/imu/calibrate"]
    assert isinstance(service.callback(EmptyRequest()), EmptyResponse)
    rig.simulator.delete("crate")
    assert not service.open


def test_body_imu_defaults(make_rig):
    rig = make_rig(joint_states=False)
    rig.simulator.spawn(crate(BODY, bodyName="link"), at(z=0.25))
    assert rig.run(0.005).stamps_ms("/default_imu") == [1, 2, 3, 4, 5] and "/default_imu" in rig.ports.services


@pytest.mark.parametrize("namespace, topic", [(None, "/crate/imu"), ("/", "/imu"), ("/bot", "/bot/imu")])
def test_sensor_imu_prefixes_absolute_topics_too(make_rig, namespace, topic):
    rig = make_rig(joint_states=False)
    tags = {} if namespace is None else {"robotNamespace": namespace}
    rig.simulator.spawn(crate(SENSOR, frameName="unit", topicName="/imu", **tags), at(z=0.25))
    assert topic in rig.ports.topics


def test_plugin_rate_selects_readings_of_the_sensor(make_rig):
    rig = make_rig(joint_states=False)
    rig.simulator.spawn(crate(SENSOR, frameName="unit", robotNamespace="/"), at(z=0.25))
    assert rig.run(3.2).stamps_ms("/imu_data") == [1000, 2000, 3000]        # 1 Hz where the tag is missing


def test_first_orientation_can_be_the_reference(carried):
    message = carried(SENSOR, at(z=0.25, yaw=0.4), initialOrientationAsReference="true").run(0.5).messages("/imu")[-1]
    assert (message.orientation.z, message.orientation.w) == pytest.approx((0.0, 1.0), abs=1e-5)


def test_the_sensors_own_noise(carried):
    quiet, loud = Noise(), Noise("gaussian", mean=0.5, stddev=0.1)
    rig = carried(SENSOR, sensor={"imu_noise": (quiet, quiet, loud, loud, quiet, quiet)})
    messages = rig.run(5.0).messages("/imu")[50:]
    rates = np.array([values(message.angular_velocity) for message in messages])
    accelerations = np.array([values(message.linear_acceleration) for message in messages])
    assert rates.std(axis=0) == pytest.approx([0.0, 0.0, 0.1], abs=0.02)
    assert rates[:, 2].mean() == pytest.approx(0.5, abs=0.03)
    assert accelerations.std(axis=0) == pytest.approx([0.1, 0.0, 0.0], abs=0.02)


@pytest.mark.parametrize("library, model, words", [
    (SENSOR, {}, "needs a <frameName>"), (BODY, {}, "needs a <bodyName>"),
    (BODY, {"bodyName": "x"}, "is no link of crate")])
def test_missing_elements_are_logged(make_rig, caplog, library, model, words):
    rig = make_rig(joint_states=False)
    rig.simulator.spawn(crate(library, **model), at(z=0.25))
    assert not rig.ports.topics and words in caplog.text


def test_plugin_outside_an_imu_sensor_is_rejected(make_rig, m2wr, caplog):
    rig = make_rig(joint_states=False)
    spec = PluginSpec("imu", SENSOR, (("frameName", "x"),), where="here")
    rig.simulator.spawn(replace(m2wr, plugins=(spec,)), at(z=0.1))
    assert "must be in a <sensor type=\"imu\">" in caplog.text


# -- the sensor without a plugin ----------------------------------------------------------------------------------

def test_imu_off_the_axis_measures_centripetal_acceleration():
    arm, rate = 0.5, 2.0
    unit = ImuSensor(((arm, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), (), np.random.default_rng(0))
    for step in range(200):
        turn = (0.0, 0.0, math.sin(0.0005 * rate * step), math.cos(0.0005 * rate * step))
        state = LinkState(ORIGIN, turn, ORIGIN, (0.0, 0.0, rate))
        if step == 0:
            unit.start(state, 0)
        else:
            _, rates, acceleration = unit.read(state, step * 1000000, GRAVITY)
    assert rates == pytest.approx((0.0, 0.0, rate))
    assert acceleration == pytest.approx((-arm * rate ** 2, 0.0, 9.8), abs=0.005)


def test_rotated_imu_measures_gravity_in_its_axes():
    unit = ImuSensor((ORIGIN, quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0)), (), np.random.default_rng(0))
    state = LinkState(ORIGIN, (0.0, 0.0, 0.0, 1.0), ORIGIN, ORIGIN)
    unit.start(state, 0)
    assert unit.read(state, 1000000, GRAVITY)[2] == pytest.approx((-9.8, 0.0, 0.0))


def test_dynamic_bias_has_given_spread_and_correlation():
    sigma, tau, dt, count = 0.5, 0.2, 0.01, 100000
    bias, rng = GaussMarkovBias(Noise("gaussian", dynamic_bias_stddev=sigma, dynamic_bias_correlation_time=tau)), \
        np.random.default_rng(1)
    values = np.array([bias.advance(dt, rng) for _ in range(count)])
    assert values.std() == pytest.approx(sigma * math.sqrt(0.5 * tau), rel=0.03)
    assert np.corrcoef(values[:-20], values[20:])[0, 1] == pytest.approx(math.exp(-20 * dt / tau), abs=0.05)
    assert abs(values.mean()) < 0.01
    bias.reset()
    assert abs(bias.advance(1e-9, rng)) < 1e-3


def test_reset_repeats_the_dynamic_bias():
    noise = Noise("gaussian", dynamic_bias_stddev=0.5, dynamic_bias_correlation_time=1.0)
    unit = ImuSensor((ORIGIN, (0.0, 0.0, 0.0, 1.0)), (noise,) * 6, np.random.default_rng(3))
    state = LinkState(ORIGIN, (0.0, 0.0, 0.0, 1.0), ORIGIN, ORIGIN)

    def rates():
        unit.start(state, 0)
        return [unit.read(state, step * 10000000, GRAVITY)[1] for step in range(1, 20)]

    first = rates()
    unit.reset(np.random.default_rng(3))
    assert rates() == first and len({rate for rate, _, _ in first}) == 19
