# SPDX-License-Identifier: BSD-3-Clause
"""What sensors other than lasers say of themselves: noise of inertial units, collisions of contact sensors."""
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.model.types import CameraView, Noise

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


def test_invalid_noise_is_reported_and_ignored():
    found, notes = sensor("imu", IMU.replace("0.2", "-1"))
    assert found.imu_noise[2] == Noise("gaussian", 0.1) and "stddev is -1" in notes[0] and "using 0" in notes[0]


WANDERS = "<dynamic_bias_stddev>0.5</dynamic_bias_stddev>"
TIME = "<dynamic_bias_correlation_time>100</dynamic_bias_correlation_time>"


def test_dynamic_bias_is_read_for_imus_and_reported_for_others():
    rate = "<imu><angular_velocity><x><noise>{}</noise></x></angular_velocity></imu>"
    found, notes = sensor("imu", rate.format(WANDERS + TIME))
    assert found.imu_noise[0] == Noise("gaussian", dynamic_bias_stddev=0.5, dynamic_bias_correlation_time=100.0)
    assert not notes
    found, notes = sensor("imu", rate.format(WANDERS))
    assert found.imu_noise[0] == Noise("gaussian") and "correlation_time" in notes[0]
    found, notes = sensor("ray", "<ray><noise>{}</noise></ray>".format(WANDERS + TIME))
    assert found.ray.noise == Noise("gaussian") and "only IMU sensors" in notes[0]


def test_sensors_that_measure_nothing_are_reported():
    for kind, words in (("gps", "not simulated"), ("nose", 'unknown type "nose"')):
        found, (note,) = sensor(kind, "<gps/>" if kind == "gps" else "")
        assert words in note and '"s"' in note and "test:2" in note and found.kind == kind
    assert sensor("gps", "<plugin name='p' filename='libgps.so'/>")[1] == ()     # the plugin is named when it starts
    assert [sensor(kind, "")[1] for kind in ("ray", "gpu_ray", "imu", "contact")] == [(), (), (), ()]


def test_elements_of_other_sensor_types_are_reported():
    assert "<ray> in a sensor of type imu" in sensor("imu", "<ray/>")[1][0]


def test_a_camera_has_the_defaults_of_sdf_and_what_is_written():
    found, notes = sensor("camera", "")
    assert found.cameras == (CameraView(),) and not notes
    found, notes = sensor("multicamera", """<camera name="left"><pose>0 0.1 0 0 0 0</pose>
        <horizontal_fov>2</horizontal_fov>
        <image><width>64</width><height>48</height><format>L8</format></image><clip><near>1</near><far>9</far></clip>
        <distortion><k1>1</k1><k2>2</k2><k3>3</k3><p1>4</p1><p2>5</p2><center>0.4 0.6</center></distortion>
        <noise><type>gaussian</type><mean>0</mean><stddev>0.1</stddev></noise></camera><camera name="right"/>""")
    left, right = found.cameras
    assert left == CameraView("left", ((0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0)), 64, 48, "L8", 2.0, 1.0, 9.0,
                              Noise("gaussian", stddev=0.1), (1.0, 2.0, 3.0, 4.0, 5.0, 0.4, 0.6))
    assert right == CameraView("right") and not notes and sensor("ray", "")[0].cameras == ()


def test_a_contact_sensor_names_its_collisions():
    text = "<contact><collision> shell </collision><collision>other</collision></contact>"
    assert sensor("contact", text)[0].contact_collisions == ("shell", "other")
    assert sensor("contact", "")[0].contact_collisions == () and sensor("imu", text)[0].contact_collisions == ()
