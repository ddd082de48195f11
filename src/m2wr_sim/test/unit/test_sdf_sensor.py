"""What sensors other than lasers say of themselves: noise of inertial units, collisions of contact sensors."""
import pytest

from m2wr_sim.model.sdf import load_sdf_models
from m2wr_sim.model.types import Noise

SDF = """<sdf version="1.6"><model name="m"><link name="l"><collision name="shell"><geometry><box><size>1 1 1</size>
</box></geometry></collision><sensor name="s" type="%s"><update_rate>50</update_rate>%s</sensor></link></model></sdf>"""
IMU = """<imu>
<angular_velocity><z><noise type="gaussian"><mean>0.1</mean><stddev>0.2</stddev></noise></z></angular_velocity>
<linear_acceleration><x><noise type="gaussian"><stddev>0.3</stddev><bias_mean>0.4</bias_mean></noise></x>
</linear_acceleration></imu>"""
EARLY = """<imu><noise><type>gaussian</type><rate><mean>0.1</mean><stddev>0.2</stddev></rate>
<accel><stddev>0.3</stddev><bias_mean>0.4</bias_mean></accel></noise></imu>"""


def sensor(kind, text):
    model, = load_sdf_models(SDF % (kind, text), source="test")
    return model.links[0].sensors[0], model.notes


def test_an_imu_has_a_noise_for_each_axis():
    found, notes = sensor("imu", IMU)
    quiet = Noise()
    rate, acceleration = Noise("gaussian", 0.1, 0.2), Noise("gaussian", 0.0, 0.3, 0.4)
    assert found.imu_noise == (quiet, quiet, rate, acceleration, quiet, quiet)
    assert not notes


def test_the_noise_of_early_files_counts_for_all_axes():
    rate, acceleration = Noise("gaussian", 0.1, 0.2), Noise("gaussian", 0.0, 0.3, 0.4)
    assert sensor("imu", EARLY)[0].imu_noise == 3 * (rate,) + 3 * (acceleration,)


def test_an_imu_that_says_nothing_is_exact():
    assert sensor("imu", "")[0].imu_noise == () and sensor("ray", IMU)[0].imu_noise == ()


def test_a_noise_that_cannot_be_is_refused():
    from m2wr_sim.errors import ModelError
    with pytest.raises(ModelError, match="stddev is -1"):
        sensor("imu", IMU.replace("0.2", "-1"))


def test_a_contact_sensor_names_its_collisions():
    text = "<contact><collision> shell </collision><collision>other</collision></contact>"
    assert sensor("contact", text)[0].contact_collisions == ("shell", "other")
    assert sensor("contact", "")[0].contact_collisions == () and sensor("imu", text)[0].contact_collisions == ()
