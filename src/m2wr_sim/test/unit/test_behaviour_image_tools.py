# SPDX-License-Identifier: BSD-3-Clause
"""The image tools of the distribution on our pictures; skipped where they are not installed."""
import glob
import os
import shutil
import socket
import subprocess
import time

import pytest

roslib_packages = pytest.importorskip("roslib.packages")
WIDTH, HEIGHT = 64, 48
WORLD = """<sdf version="1.6"><world name="w"><model name="wall"><static>1</static><pose>2.05 0 0.5 0 0 0</pose>
<link name="l"><visual name="v"><geometry><box><size>0.1 9 9</size></box></geometry></visual></link></model>
<model name="eye"><static>1</static><pose>0 0 0.5 0 0 0</pose><link name="l"><sensor name="s" type="depth">
<update_rate>20</update_rate><camera><horizontal_fov>1</horizontal_fov><image><width>64</width><height>48</height>
</image><clip><near>0.1</near><far>9</far></clip></camera><plugin name="p" filename="libgazebo_ros_openni_kinect.so">
<cameraName>eye</cameraName><imageTopicName>rgb/image_raw</imageTopicName>
<cameraInfoTopicName>rgb/camera_info</cameraInfoTopicName><frameName>optical</frameName></plugin></sensor></link></model>
</world></sdf>"""


def program_of(package, name, library=None):
    """Return the path of a program; skip the test where it, or the library with its nodelets, is missing."""
    try:
        found = roslib_packages.find_node(package, name)
    except Exception:       # rospkg raises one that roslib does not document
        found = []
    found = found or [path for path in ("/usr/lib/%s/%s" % (package, name),) if os.path.exists(path)]
    if not found:
        pytest.skip("the program %s of the package %s is not installed" % (name, package))
    needs_library(library)
    return found[0]


def needs_library(name):
    """Skip the test where a library of nodelets is missing."""
    folders = ["/usr/lib", "/usr/lib/*", "/opt/ros/noetic/lib"]
    folders += ["%s/*" % folder for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(":")]
    if name and not any(glob.glob("%s/%s" % (folder, name)) for folder in folders):
        pytest.skip("%s, which loads nodelets, is missing (Debian: lib%s-dev)" % (name, name[3:-3].replace("_", "-")))


@pytest.fixture
def camera(tmp_path):
    """Start a master and a simulator with a depth camera 2 m from a wall; return a function that starts programs."""
    if shutil.which("rosmaster") is None:
        pytest.skip("rosmaster is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:%d" % port, ROS_IP="127.0.0.1",
                       ROS_LOG_DIR=str(tmp_path))
    running = []

    def start(*arguments, **more):
        running.append(subprocess.Popen(list(arguments), env=dict(environment, **more), stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, universal_newlines=True))
        return running[-1]

    (tmp_path / "eye.world").write_text(WORLD)
    start("rosmaster", "-p", str(port))
    deadline = time.monotonic() + 30.0
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        assert time.monotonic() < deadline, "the master did not start in 30 s"
        time.sleep(0.02)
    start(roslib_packages.find_node("m2wr_sim", "m2wr_sim_node")[0], "_world:=%s" % (tmp_path / "eye.world"))
    yield start
    for process in reversed(running):
        process.terminate()
    for process in running:
        try:
            process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def wait_for(start, topic, words):
    """Wait until a message of a topic, printed without its arrays, has all these words."""
    deadline, text = time.monotonic() + 60.0, ""
    echo = start("rostopic", "echo", "--noarr", topic)
    for line in echo.stdout:
        text += line
        if all(word in text for word in words):
            return
        if time.monotonic() > deadline:
            break
    pytest.fail("no message on %s with %s in 60 s:\n%s" % (topic, words, text[-1500:]))


def test_image_proc_rectifies_our_pictures(camera):
    camera(program_of("image_proc", "image_proc", "libimage_proc.so"), ROS_NAMESPACE="/eye/rgb")
    wait_for(camera, "/eye/rgb/image_rect_color", ("width: %d" % WIDTH, "height: %d" % HEIGHT, 'encoding: "rgb8"'))
    wait_for(camera, "/eye/rgb/image_mono", ('encoding: "mono8"', 'frame_id: "optical"'))


def test_depth_image_proc_makes_a_cloud_of_our_depths(camera):
    camera(program_of("nodelet", "nodelet", "libdepth_image_proc.so"), "standalone", "depth_image_proc/point_cloud_xyz",
           "image_rect:=/eye/depth/image_raw", "camera_info:=/eye/depth/camera_info", "points:=/cloud")
    wait_for(camera, "/cloud", ("width: %d" % WIDTH, "height: %d" % HEIGHT, 'frame_id: "optical"'))


def test_image_view_saves_our_pictures(camera, tmp_path):
    camera(program_of("image_view", "image_saver"), "image:=/eye/rgb/image_raw",
           "_filename_format:=%s/%%04d.%%s" % tmp_path, "_encoding:=bgr8")
    deadline = time.monotonic() + 60.0
    while not list(tmp_path.glob("*.jpg")):
        assert time.monotonic() < deadline, "no picture was saved in 60 s"
        time.sleep(0.05)
