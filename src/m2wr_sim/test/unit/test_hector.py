# SPDX-License-Identifier: BSD-3-Clause
"""The sensors of hector_gazebo_plugins: true values without errors, and the statistics of the errors."""
import math
from dataclasses import replace

import numpy as np
import pytest

from conftest import at, box
from m2wr_sim.geometry import quaternion_from_rpy, yaw_of
from m2wr_sim.model.types import PluginSpec, RayScan, Sensor
from m2wr_sim.sensors.drift import DriftModel, places_from

IMU, GPS, MAGNETIC, SONAR = ("libhector_gazebo_ros_%s.so" % name for name in ("imu", "gps", "magnetic", "sonar"))


@pytest.fixture
def make(make_rig):
    def make_with(library, *models, static=False, ray=None, pose=at(z=0.25), **tags):
        spec = PluginSpec("p", library, tuple(tags.items()), where="crate.sdf:7: plugin")
        model = box("crate", 0, 0, 0.25, (0.5, 0.5, 0.5), static=static)
        if ray is None:
            model = replace(model, plugins=(spec,))
        else:
            sensor = Sensor("s", "ray", pose=at(x=0.3), ray=ray, plugins=(spec,))
            model = replace(model, links=(replace(model.links[0], sensors=(sensor,)),))
        rig = make_rig(*models, joint_states=False)
        rig.simulator.spawn(model, pose)
        return rig
    return make_with


# ---- errors ----------------------------------------------------------------------------------------------------


def test_drift_has_its_deviation_and_correlation():
    frequency, deviation, step = 0.05, 2.0, 0.1
    model = DriftModel(2000, *(np.full(2000, value) for value in (0.5, deviation, frequency, 0.0, 1.0)),
                       rng=np.random.default_rng(3))
    first = model.drift.copy()
    assert np.std(first) == pytest.approx(deviation, rel=0.06)
    for _ in range(100):
        values = model.measure(np.full(2000, 10.0), step)
    decay = math.exp(-100 * step * frequency)
    slope = (first @ model.drift) / (first @ first)
    assert slope == pytest.approx(decay, abs=0.03)
    added = step * math.sqrt(2.0 * frequency) * deviation         # hector's formula; each step's part fades since then
    spread = added * math.sqrt((1.0 - decay ** 2) / (1.0 - math.exp(-2.0 * step * frequency)))
    assert np.std(model.drift - slope * first) == pytest.approx(spread, rel=0.06)
    np.testing.assert_allclose(values - 10.5, model.drift)


def test_values_are_scaled_shifted_and_noisy():
    model = DriftModel(1, [0.5], [0.0], [1.0], [0.1], [2.0], np.random.default_rng(1))
    values = np.array([model.measure([3.0], 0.01)[0] for _ in range(4000)])
    assert values.mean() == pytest.approx(6.5, abs=0.01) and values.std() == pytest.approx(0.1, rel=0.05)


def test_errors_are_repeated_after_a_reset(make):
    rig = make(IMU, updateRate="50", accelDrift="0.1", accelGaussianNoise="0.1", rateDrift="0.1", yawDrift="0.1")
    first = [str(message).split("header")[0] for message in rig.run(0.3).messages("/imu")]
    rig.messages("/imu").clear()
    rig.simulator.reset_simulation()
    assert [str(message).split("header")[0] for message in rig.run(0.3).messages("/imu")] == first and len(first) == 15


@pytest.mark.parametrize("tags, message", [
    (dict(accelDrift="a"), '<accelDrift> holds "a"; expected one or 3 numbers'),
    (dict(accelOffset="1 2"), "expected one or 3 numbers"), (dict(rateGaussianNoise="-1"), "is negative"),
    (dict(yawOffset="nan"), "expected one or 1 numbers"), (dict(updateRate="-5"), "<updateRate>"),
    (dict(bodyName="arm"), '"arm" is no link')])
def test_bad_tags_are_refused_and_the_simulation_continues(make, caplog, tags, message):
    rig = make(IMU, **tags).run(0.05)
    assert message in caplog.text and "crate.sdf:7" in caplog.text and "/imu" not in rig.ports.topics


# ---- imu -------------------------------------------------------------------------------------------------------


def test_imu_at_rest_measures_gravity_upwards(make):
    message = make(IMU, updateRate="50").run(1.0).messages("/imu")[-1]
    acceleration, rates = message.linear_acceleration, message.angular_velocity
    assert (acceleration.x, acceleration.y, acceleration.z) == pytest.approx((0.0, 0.0, 9.8), abs=1e-3)
    assert (rates.x, rates.y, rates.z) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert message.header.frame_id == "link" and message.orientation_covariance[0] == 0.0


def test_imu_sees_a_body_that_is_placed_elsewhere_as_one_rate(make):
    rig = make(IMU, updateRate="50").run(0.5)
    rig.simulator.set_model_state("crate", ((0, 0, 0.25), quaternion_from_rpy(0, 0, 1.57)), (0, 0, 0), (0, 0, 0))
    rates = [message.angular_velocity.z for message in rig.run(0.2).messages("/imu")][-10:]
    assert sum(rates) * 0.02 == pytest.approx(1.57, abs=1e-3) and max(rates) == pytest.approx(1.57 / 0.02, rel=1e-3)


def test_imu_covariances_and_bias(make):
    rig = make(IMU, updateRate="50", accelOffset="0.2 0.4 0", accelGaussianNoise="0.098", rateGaussianNoise="0.01",
               yawOffset="0.3", yawGaussianNoise="0.02").run(0.5)
    message, bias = rig.messages("/imu")[-1], rig.messages("/imu/bias")[-1]
    assert message.linear_acceleration_covariance[::4] == pytest.approx([0.098 ** 2] * 3)
    assert message.angular_velocity_covariance[::4] == pytest.approx([1e-4] * 3)
    assert message.orientation_covariance[::4] == pytest.approx([1e-4, 1e-4, 4e-4])
    turn = message.orientation
    assert yaw_of((turn.x, turn.y, turn.z, turn.w)) == pytest.approx(0.3, abs=0.1)
    assert (bias.linear_acceleration.x, bias.linear_acceleration.y) == pytest.approx((0.2, 0.4))


# ---- gps -------------------------------------------------------------------------------------------------------


def test_gps_moves_by_the_radii_of_the_earth(make):
    rig = make(GPS, static=True, pose=at(x=100.0, y=0.0, z=0.25), referenceLatitude="45", referenceLongitude="9",
               referenceAltitude="120").run(0.6)
    fix = rig.messages("/fix")[-1]
    assert (fix.latitude - 45.0) * 111131.75 == pytest.approx(100.0, rel=1e-3)      # metres of a degree at 45 degrees
    assert fix.longitude == pytest.approx(9.0, abs=1e-12) and fix.altitude == pytest.approx(120.25)
    latitude, longitude = places_from(45.0, 9.0, 0.0, 0.0, -100.0)      # to the east
    assert latitude == 45.0 and (longitude - 9.0) * 78846.8 == pytest.approx(100.0, rel=1e-3)


def test_heading_90_is_a_world_whose_x_axis_points_east(make):
    fix = make(GPS, static=True, pose=at(x=100.0, z=0.25), referenceHeading="90").run(0.6).messages("/fix")[-1]
    assert fix.latitude == pytest.approx(49.9, abs=1e-9) and fix.longitude > 8.9


def test_gps_velocity_is_north_west_up(make):
    rig = make(GPS, velocityTopicName="vel", referenceHeading="90", gaussianNoise="0.5 0.5 1", updateRate="10")
    rig.simulator.set_model_state("crate", ((0, 0, 5.0), (0, 0, 0, 1)), (3.0, 1.0, 0.0), (0, 0, 0))
    rig.run(0.25)
    vector = rig.messages("/vel")[-1].vector
    assert (vector.x, vector.y) == pytest.approx((1.0, -3.0), abs=1e-3) and vector.z < -0.5
    assert rig.messages("/fix")[-1].position_covariance[::4] == pytest.approx([0.25, 0.25, 1.0])


def test_gps_has_its_own_rate(make):
    assert np.diff(make(GPS).run(1.1).stamps_ms("/fix")) == pytest.approx(250.0)


# ---- magnetometer and sonar ------------------------------------------------------------------------------------


def test_magnetic_field_turns_with_the_body(make):
    field = make(MAGNETIC, static=True, pose=((0, 0, 0.25), quaternion_from_rpy(0, 0, 0.5 * math.pi)), magnitude="2",
                 updateRate="50").run(0.1).messages("/magnetic")[-1].vector
    assert (field.x, field.y, field.z) == pytest.approx((0.0, -1.0, -math.sqrt(3.0)), abs=1e-9)
    rig = make(MAGNETIC, static=True, inclination="0", declination="30", useMagneticFieldMsgs="true", updateRate="50")
    field = rig.run(0.1).messages("/magnetic")[-1].magnetic_field
    assert (field.x, field.y) == pytest.approx((math.cos(math.pi / 6), -0.5))


CONE = RayScan(samples=5, min_angle=-0.2, max_angle=0.2, vertical_samples=3, vertical_min_angle=-0.1,
               vertical_max_angle=0.1, range_min=0.1, range_max=4.0)


def test_sonar_has_the_shortest_range_of_its_cone(make):
    message = make(SONAR, box("wall", 2.4, 0, 0.5, (0.2, 4, 4)), static=True, ray=CONE).run(0.3).messages("/sonar")[-1]
    assert message.range == pytest.approx(2.0, abs=1e-6) and message.field_of_view == pytest.approx(0.2)
    assert (message.min_range, message.max_range) == pytest.approx((0.1, 4.0))
    assert message.header.frame_id == "sonar_link"


def test_sonar_without_a_hit_has_the_longest_range_and_no_noise(make):
    messages = make(SONAR, static=True, ray=replace(CONE, vertical_min_angle=0.0), gaussianNoise="0.5").run(
        1.05).messages("/sonar")
    assert len(messages) == 10 and {message.range for message in messages} == {4.0}


def test_noise_of_the_sonar_is_clipped_to_its_limits(make):
    rig = make(SONAR, box("wall", 0.5, 0, 0.5, (0.2, 4, 4)), static=True, ray=replace(CONE, range_min=0.05),
               offset="-1").run(0.3)
    assert rig.messages("/sonar")[-1].range == pytest.approx(0.05)
