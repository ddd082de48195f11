# SPDX-License-Identifier: BSD-3-Clause
"""The camera plugins: pictures, calibration, depth, clouds, rates, frames, formats, noise, and what is refused."""
import math
from io import BytesIO

import numpy as np
import pytest
from genpy import Time

from camera_robots import camera_model
from conftest import at, box
from m2wr_sim.api import Sim
from m2wr_sim.model.types import Light, Visual, World
from m2wr_sim.plugins import camera as camera_module
from m2wr_sim.ros.serialise import serialise_by_genpy, serialiser_of

DEPTH = "libgazebo_ros_openni_kinect.so"
RED = (1.0, 0.0, 0.0, 1.0)


def wall(x=2.0, rgba=RED):
    """A wall across the view whose front is at x."""
    from dataclasses import replace
    model = box("wall", x + 0.1, 0.0, 0.5, (0.2, 8.0, 8.0))
    link = model.links[0]
    visual = Visual("v", link.collisions[0].geometry, rgba=rgba)
    return replace(model, links=(replace(link, visuals=(visual,)),))


@pytest.fixture
def make(make_rig):
    def make_with(*models, **options):
        world = World(models=models or (wall(),), lights=(Light("l", "directional", diffuse=(0, 0, 0, 1)),))
        rig = make_rig(joint_states=False, world=world)
        record = camera_model(**options)
        rig.simulator.spawn(record, record.pose)
        return rig
    return make_with


def pixels(image, channels=3, kind=np.uint8):
    return np.asarray(image.data).view(kind).reshape(image.height, image.width, channels)


def test_picture_has_the_colour_of_what_is_in_front(make):
    rig = make(tags="<cameraName>cam</cameraName><frameName>cam_optical</frameName>").run(0.2)
    image = rig.messages("/cam/image_raw")[-1]
    assert (image.width, image.height, image.encoding, image.step, image.is_bigendian) == (32, 24, "rgb8", 96, 0)
    assert image.header.frame_id == "cam_optical" and np.all(pixels(image) == (102, 0, 0))


def test_camera_info_is_that_of_gazebo(make):
    rig = make(tags="<cameraName>cam</cameraName><hackBaseline>0.07</hackBaseline><distortionK1>0.1</distortionK1>"
                    "<distortionK2>0.2</distortionK2><distortionK3>0.5</distortionK3><distortionT1>0.3</distortionT1>"
                    "<distortionT2>0.4</distortionT2>").run(0.2)
    info, image = rig.messages("/cam/camera_info")[-1], rig.messages("/cam/image_raw")[-1]
    focal = 16.0 / math.tan(0.6)
    assert info.K == pytest.approx([focal, 0, 16.5, 0, focal, 12.5, 0, 0, 1])
    assert info.P == pytest.approx([focal, 0, 16.5, -0.07 * focal, 0, focal, 12.5, 0, 0, 0, 1, 0])
    assert info.R == [1, 0, 0, 0, 1, 0, 0, 0, 1] and info.D == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert (info.distortion_model, info.width, info.height) == ("plumb_bob", 32, 24)
    assert info.header.stamp == image.header.stamp


def test_pictures_come_at_the_slower_of_two_rates(make):
    assert np.diff(make(rate=20).run(0.5).stamps_ms("/cam/image_raw")) == pytest.approx(50.0)
    slow = make(rate=20, tags="<cameraName>cam</cameraName><updateRate>5</updateRate>").run(1.1)
    assert np.diff(slow.stamps_ms("/cam/image_raw")) == pytest.approx(200.0)


def test_without_subscribers_no_picture_is_taken(make, monkeypatch):
    rig = make()
    for port in rig.ports.topics.values():
        port.listening = False
    monkeypatch.setattr(camera_module.Eye, "take", lambda self, colour=True: pytest.fail("a picture was taken"))
    rig.run(0.3)
    assert rig.messages("/cam/image_raw") == []


def test_subscribers_of_the_info_alone_wake_it(make):
    rig = make()
    rig.ports.topics["/cam/image_raw"].listening = False
    rig.run(0.2)
    assert rig.messages("/cam/image_raw") == [] and len(rig.messages("/cam/camera_info")) >= 3


@pytest.mark.parametrize("inside, encoding, step, value", [
    ("<format>L8</format>", "mono8", 32, 30), ("<format>B8G8R8</format>", "bgr8", 96, 0),
    ("<format>RGB8</format>", "rgb8", 96, 102), ("<format>L16</format>", "mono16", 64, 30),
    ("<format>R16G16B16</format>", "rgb16", 192, 102), ("<format>BAYER_RGGB8</format>", "bayer_rggb8", 32, 102),
    ("<format>BAYER_BGGR8</format>", "bayer_bggr8", 32, 0), ("<format>PLASMA</format>", "bgr8", 96, 0)])
def test_formats_have_the_encodings_of_gazebo(make, inside, encoding, step, value):
    image = make(inside=inside).run(0.2).messages("/cam/image_raw")[-1]
    assert (image.encoding, image.step) == (encoding, step) and len(image.data) == 24 * step
    assert abs(int(image.data[0]) - value) <= 1


def test_noise_has_its_deviation_and_is_the_same_after_a_reset(make, monkeypatch):
    rig = make(wall(rgba=(1.0, 1.0, 1.0, 1.0)), width=64, height=48,
               inside="</image><noise><type>gaussian</type><mean>0.1</mean><stddev>0.05</stddev></noise><image>")
    first = [pixels(image) for image in rig.run(0.3).messages("/cam/image_raw")]
    assert abs(first[0].mean() - 255 * 0.5) < 1.0 and abs(first[0].std() - 255 * 0.05) < 0.5
    assert np.any(first[0] != first[1])
    rig.messages("/cam/image_raw").clear()
    rig.simulator.reset_simulation()
    again = [pixels(image) for image in rig.run(0.3).messages("/cam/image_raw")]
    assert len(again) >= 3 and all(np.array_equal(one, two) for one, two in zip(first, again))


def test_distortion_moves_pixels_by_the_model(make):
    lens = "</image><distortion><k1>%g</k1><center>0.5 0.5</center></distortion><image>"
    from dataclasses import replace
    model = box("post", 2.1, 0.6, 0.5, (0.2, 0.05, 8.0))
    link = model.links[0]
    post = replace(model, links=(replace(link, visuals=(Visual("v", link.collisions[0].geometry, rgba=RED),)),))
    columns = []
    for inside in ("", lens % 0.3):
        image = make(post, width=160, height=120, inside=inside).run(0.2).messages("/cam/image_raw")[-1]
        row = pixels(image)[60]
        columns.append(np.flatnonzero((row[:, 1] < 20) & (row[:, 0] > 20)).mean())
    focal = 80.0 / math.tan(0.6)
    x = (79.5 - columns[0]) / focal
    assert columns[1] == pytest.approx(79.5 - focal * x * (1.0 + 0.3 * x * x), abs=0.7)


def test_moving_models_move_in_the_picture(make_rig, build):
    from dataclasses import replace
    model = build.box("crate", 3.0, 0.0, 0.5, (0.5, 0.5, 0.5), static=False)
    link = model.links[0]
    crate = replace(model, links=(replace(link, visuals=(Visual("v", link.collisions[0].geometry, rgba=RED),)),))
    rig = make_rig(crate, joint_states=False)
    record = camera_model()
    rig.simulator.spawn(record, record.pose)

    def column():
        picture = pixels(rig.run(0.1).messages("/cam/image_raw")[-1])
        return np.argwhere((picture[:, :, 0] > 60) & (picture[:, :, 1] < 20)).mean(axis=0)[1]

    middle = column()
    rig.simulator.set_model_state("crate", ((3.0, 0.8, 0.3), (0, 0, 0, 1)), (0, 0, 0), (0, 0, 0))
    assert column() < middle - 3
    rig.simulator.delete("crate")
    assert not np.any(pixels(rig.run(0.1).messages("/cam/image_raw")[-1])[:, :, 1] < 20)


def test_static_model_that_is_placed_elsewhere_is_seen_there(make):
    rig = make(library=DEPTH)
    assert rig.run(0.1).messages("/cam/depth/image_raw")
    rig.simulator.set_model_state("wall", ((4.1, 0.0, 0.5), (0, 0, 0, 1)), (0, 0, 0), (0, 0, 0))
    depth = pixels(rig.run(0.1).messages("/cam/depth/image_raw")[-1], 1, np.float32)
    assert np.all(depth == np.float32(4.0))


# ---- depth cameras ---------------------------------------------------------------------------------------------


def test_models_are_looked_through_only_after_one_came_or_went(make):
    """So that a picture takes no longer in a world of many models that it does not show."""
    class Counted(dict):
        reads = 0

        def items(self):
            Counted.reads += 1
            return super().items()

    rig = make(tags="<cameraName>cam</cameraName>")
    simulator = rig.simulator
    simulator.models = Counted(simulator.models)
    simulator.refresh_pictures()
    before = Counted.reads
    rig.run(0.5)
    simulator.refresh_pictures()
    assert Counted.reads == before
    simulator.delete("wall")
    simulator.refresh_pictures()
    assert Counted.reads == before + 1
    assert np.all(pixels(rig.run(0.2).messages("/cam/image_raw")[-1]) != (102, 0, 0))


def test_depth_image_holds_metres_and_nan_outside(make):
    image = make(library=DEPTH, kind="depth").run(0.1).messages("/cam/depth/image_raw")[-1]
    assert (image.encoding, image.step) == ("32FC1", 128)
    np.testing.assert_allclose(pixels(image, 1, np.float32), 2.0, rtol=1e-6)
    for x, tags in ((0.3, ""), (6.0, ""), (3.0, "<pointCloudCutoffMax>2.5</pointCloudCutoffMax>")):
        rig = make(wall(x), library=DEPTH, kind="depth", tags="<cameraName>cam</cameraName>" + tags).run(0.1)
        assert np.all(np.isnan(pixels(rig.messages("/cam/depth/image_raw")[-1], 1, np.float32)))
        cloud = rig.messages("/cam/points")[-1]
        assert not cloud.is_dense and np.all(np.isnan(np.asarray(cloud.data).view(np.float32).reshape(-1, 8)[:, :3]))


def test_depth_camera_has_no_longest_range_but_the_cameras(make):
    rig = make(wall(6.0), library="libgazebo_ros_depth_camera.so", kind="depth").run(0.1)
    np.testing.assert_allclose(pixels(rig.messages("/cam/depth/image_raw")[-1], 1, np.float32), 6.0, rtol=1e-6)


def test_depth_in_millimetres_is_cut_off_and_0_outside(make):
    tags = "<cameraName>cam</cameraName><useDepth16UC1Format>true</useDepth16UC1Format>"
    image = make(wall(2.0006), library=DEPTH, tags=tags).run(0.1).messages("/cam/depth/image_raw")[-1]
    assert image.encoding == "16UC1" and np.all(pixels(image, 1, np.uint16) == 2000)
    image = make(wall(6.0), library=DEPTH, tags=tags).run(0.1).messages("/cam/depth/image_raw")[-1]
    assert np.all(pixels(image, 1, np.uint16) == 0)


def test_cloud_lies_on_the_wall_in_optical_axes_with_its_colour(make):
    cloud = make(library=DEPTH).run(0.1).messages("/cam/points")[-1]
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (32, 24, 32, 1024) and cloud.is_dense
    assert [(field.name, field.offset, field.datatype) for field in cloud.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 16, 7)]
    points = np.asarray(cloud.data).view(np.float32).reshape(24, 32, 8)
    focal = 16.0 / math.tan(0.6)
    np.testing.assert_allclose(points[:, :, 2], 2.0, rtol=1e-6)
    np.testing.assert_allclose(points[0, :, 0], 2.0 * (np.arange(32) - 15.5) / focal, rtol=1e-5)
    np.testing.assert_allclose(points[:, 0, 1], 2.0 * (np.arange(24) - 11.5) / focal, rtol=1e-5)
    assert bytes(np.asarray(cloud.data)[16:20]) == bytes((0, 0, 102, 0))            # blue, green, red


def test_topics_of_a_depth_camera_are_those_of_gazebo(make):
    rig = make(library=DEPTH, tags="<cameraName>/cam</cameraName><robotNamespace>rob</robotNamespace>"
                                   "<depthImageTopicName>/depth</depthImageTopicName>")
    assert {topic for topic in rig.ports.topics if "cam" in topic or "depth" in topic} == {
        "/rob/cam/ir/image_raw", "/rob/cam/ir/camera_info", "/depth", "/rob/cam/depth/camera_info", "/rob/cam/points"}


def test_info_of_the_depth_image_alone_does_not_wake_it(make):
    rig = make(library=DEPTH)
    for topic, port in rig.ports.topics.items():
        port.listening = topic == "/cam/depth/camera_info"
    rig.run(0.2)
    assert rig.messages("/cam/depth/camera_info") == []


# ---- several cameras, trigger, services ------------------------------------------------------------------------


def test_stereo_camera_has_a_baseline_on_the_right(make):
    rig = make(library="libgazebo_ros_multicamera.so", kind="multicamera", cameras=("left", "right"),
               tags="<cameraName>st</cameraName><hackBaseline>0.1</hackBaseline>").run(0.2)
    left, right = (rig.messages("/st/%s/camera_info" % side)[-1] for side in ("left", "right"))
    assert left.P[3] == 0.0 and right.P[3] == pytest.approx(-0.1 * right.K[0])
    images = [rig.messages("/st/%s/image_raw" % side)[-1] for side in ("left", "right")]
    assert images[0].header.stamp == images[1].header.stamp


def test_cameras_of_other_names_than_left_and_right_are_refused(make, caplog):
    make(library="libgazebo_ros_multicamera.so", kind="multicamera", cameras=("left", "middle")).run(0.05)
    assert 'camera "middle" of sensor s: expected a name that contains left or right' in caplog.text


def test_triggered_camera_takes_one_picture_for_each_trigger(make):
    rig = make(library="libgazebo_ros_triggered_camera.so").run(0.2)
    assert rig.messages("/cam/image_raw") == []
    rig.ports.send("/cam/image_trigger", object())
    assert len(rig.run(0.2).messages("/cam/image_raw")) == 1


def test_calibration_is_set_by_the_service_or_refused(make):
    rig = make()
    from sensor_msgs.msg import CameraInfo
    from sensor_msgs.srv import SetCameraInfoRequest
    call = rig.ports.services["/cam/set_camera_info"].callback
    refused = call(SetCameraInfoRequest(CameraInfo(width=1, height=1)))
    assert not refused.success and "expected 32 x 24" in refused.status_message
    infinite = CameraInfo(width=32, height=24, D=[math.nan])
    assert not call(SetCameraInfoRequest(infinite)).success
    assert call(SetCameraInfoRequest(CameraInfo(width=32, height=24, D=[1, 2, 3, 4, 5]))).success
    assert list(rig.run(0.2).messages("/cam/camera_info")[-1].D) == [1, 2, 3, 4, 5]


# ---- bad input -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("library", ["libgazebo_ros_camera.so", DEPTH, "libgazebo_ros_multicamera.so"])
@pytest.mark.parametrize("options, message", [
    (dict(width=0), "image width 0: expected 1 to 8192 pixels"),
    (dict(height=50000), "image height 50000: expected 1 to 8192 pixels"),
    (dict(width=8000, height=8000), "8000 x 8000 pixels: expected at most 16777216"),
    (dict(fov=0), "horizontal_fov 0.0: expected 0.01 to 3.1 rad"),
    (dict(fov=math.pi), "expected 0.01 to 3.1 rad"),
    (dict(near=5, far=1), "clip near 5.0, far 1.0: expected 0 < near < far"),
    (dict(near=-1), "clip near -1.0"),
    (dict(inside="</image><noise><type>gaussian</type><stddev>7</stddev></noise><image>"), "stddev 7.0"),
    (dict(inside="</image><distortion><k1>1e9</k1></distortion><image>"), "expected numbers from -100 to 100")])
def test_impossible_camera_is_refused_with_its_limits(make, caplog, library, options, message):
    rig = make(library=library, cameras=("left",), **options).run(0.1)
    assert message in caplog.text and "sensor s" in caplog.text and "eye.sdf" in caplog.text
    assert "This plugin will not run" in caplog.text and rig.simulator.now_ns == 10 ** 8


def test_plugin_outside_of_a_camera_sensor_is_refused(make, caplog):
    make(kind="ray").run(0.05)
    assert 'must be in a <sensor type="camera">' in caplog.text


# ---- messages and the library ----------------------------------------------------------------------------------


@pytest.mark.parametrize("topic", ["/cam/ir/image_raw", "/cam/depth/image_raw", "/cam/points"])
def test_messages_are_serialised_as_genpy_does(make, topic):
    message = make(library=DEPTH).run(0.1).messages(topic)[-1]
    message.header.stamp = Time(3, 4)
    fast = serialiser_of(type(message))(7, message)
    message.data = message.data.tobytes()
    assert fast == serialise_by_genpy(7, message)
    message.serialize(BytesIO())


def test_pictures_without_ros():
    with Sim(World(models=(wall(),)), camera_model(library=DEPTH), at(z=0.5)) as sim:
        picture = sim.picture()
        assert picture.colour.shape == (24, 32, 3) and np.all(picture.depth == np.float32(2.0))
        taken = []
        sim.cameras()[0].callbacks.append(taken.append)
        sim.step(duration=0.5)
        assert [round(each.time, 3) for each in taken] == pytest.approx(np.arange(10) * 0.05 + taken[0].time, abs=2e-3)
        with pytest.raises(Exception, match="has no camera 1; cameras: s"):
            sim.picture(camera=1)
