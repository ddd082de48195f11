# SPDX-License-Identifier: BSD-3-Clause
"""The launch files, loaded as roslaunch loads them, but without a master; nothing is started."""
import glob
import os
import xml.etree.ElementTree as ElementTree

import pytest
import roslib.packages

from launch_files import LAUNCH_DIR, load


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)


@pytest.mark.parametrize("path", sorted(glob.glob(os.path.join(LAUNCH_DIR, "*.launch"))), ids=os.path.basename)
def test_every_argument_has_a_default_and_a_description(path):
    for arg in ElementTree.parse(path).getroot().findall("arg"):
        assert arg.get("default") is not None and arg.get("doc") or arg.get("value") is not None, arg.get("name")


@pytest.mark.parametrize("name", ["sim.launch", "bug2.launch"])
def test_every_node_of_a_launch_file_exists(name):
    nodes, _ = load(name)
    for node in nodes.values():
        assert roslib.packages.find_node(node.package, node.type), (node.package, node.type)


def test_bug2_runs_the_reports_experiment_by_default():
    nodes, params = load("bug2.launch")
    assert sorted(nodes) == ["bug2", "gazebo", "go_to_point", "m2wr_spawn", "robot_state_publisher", "wall_follower"]
    assert {name: params["/" + name] for name in ("initial_x", "initial_y", "des_pos_x", "des_pos_y")} == {
        "initial_x": 0.0, "initial_y": 8.0, "des_pos_x": 0.0, "des_pos_y": -4.0}
    assert params["/gazebo/world"] == "world02.world"
    assert params["/gazebo/wheel_convention"] == "noetic" and params["/gazebo/wheel_conventions/m2wr"] == "kinetic"
    assert params["/use_sim_time"] is True
    assert '<robot name="m2wr"' in params["/robot_description"]
    ends_the_run = {name for name, node in nodes.items() if node.required}
    assert ends_the_run == {"bug2", "gazebo", "go_to_point", "wall_follower"}
    # which another of its name may replace, but not where time waits for it
    assert load("bug2.launch", "lockstep:=true")[0]["robot_state_publisher"].required


def test_best_path_starts_the_reports_nodes_and_the_chooser():
    nodes, params = load("best_path.launch", "world:=w.world", "memory:=here", "map:=plan.yaml", "seed:=7")
    assert {"best_path", "bug2", "gazebo", "go_to_point", "wall_follower", "map_to_odom"} <= set(nodes)
    assert (nodes["bug2"].type, nodes["best_path"].required, nodes["bug2"].required) == ("explore", True, False)
    assert nodes["bug2"].args.split()[-2:] == ["motion_plan", "bug2.py"] and "--memory='here'" in nodes["bug2"].args
    assert [params["/best_path/" + name] for name in ("world", "memory", "map")] == ["w.world", "here", "plan.yaml"]
    assert params["/best_path/criteria/time/weight"] == 0.2 and params["/gazebo/seed"] == 7
    assert not params["/gazebo/lockstep"] and load("best_path.launch", "real_time_factor:=0")[1]["/gazebo/lockstep"]


def test_one_robot_explores_in_no_namespace():
    nodes, params = load("explore.launch")
    assert sorted(nodes) == ["compare_map", "explore", "gazebo", "m2wr_spawn", "move_base", "robot_state_publisher",
                             "slam_gmapping"]
    assert params["/slam_gmapping/save_on_exit"] == "explored" and "/robot1/tf_prefix" not in params


@pytest.mark.parametrize("count", [2, 5, 8])
def test_each_robot_of_a_team_has_its_nodes_in_a_namespace(count):
    nodes, params = load("explore.launch", "robots:=%d" % count, "seed:=7", "map:=plan")
    for number in range(1, count + 1):
        robot = "robot%d" % number
        assert params["/%s/slam_gmapping/seed" % robot] == 6 + number
        assert params["/%s/move_base/global_costmap/static_layer/map_topic" % robot] == "/%s/team_map" % robot
        assert params["/%s/map_merge/init_pose_x" % robot] == 0.0 and params["/%s/tf_prefix" % robot] == robot
    assert (params["/explore_team/robots"], params["/explore_team/map"]) == (count, "plan")
    assert nodes["explore_team"].required and "/robot%d/tf_prefix" % (count + 1) not in params


def test_arguments_reach_the_nodes():
    nodes, params = load("bug2.launch", "world:=w.world", "initial_x:=1", "initial_y:=2", "initial_yaw:=3",
                         "des_pos_x:=4", "des_pos_y:=5", "real_time_factor:=6", "seed:=7", "leave_rule:=report",
                         "exit_on_goal:=true", "wheel_convention:=rep103", "step:=0.005")
    assert {name: params["/gazebo/" + name] for name in ("world", "real_time_factor", "seed", "step")} == {
        "world": "w.world", "real_time_factor": 6.0, "seed": 7, "step": 0.005}
    assert params["/gazebo/wheel_conventions/m2wr"] == "rep103"
    assert [params["/" + name] for name in ("initial_x", "initial_y", "initial_yaw", "des_pos_x", "des_pos_y")] == [
        1, 2, 3, 4, 5]
    assert params["/bug2/leave_rule"] == "report" and params["/bug2/exit_on_goal"] is True
    assert "-x 1 -y 2" in nodes["m2wr_spawn"].args


@pytest.mark.parametrize("record, words", [("/tmp/run.bag", "-O '/tmp/run.bag'"), ("run.bag", "-O 'run.bag'"),
                                           ("true", "-o 'bug2'")])
def test_recording_names_the_bag(record, words):
    nodes, _ = load("bug2.launch", "record:=" + record)
    assert words in nodes["record"].args and not nodes["record"].required
    for topic in ("/gazebo/world_markers", "/robot_description", "/gazebo/robot_states", "/odom"):
        assert topic in nodes["record"].args.split()


def test_what_a_launch_file_with_a_simulation_has_all_have():
    simulating, described = [], {}
    for path in sorted(glob.glob(os.path.join(LAUNCH_DIR, "*.launch"))):
        with open(path, encoding="utf-8") as stream:
            root = ElementTree.fromstring(stream.read())
        started = [node.get("type") for node in root.iter("node")] + [
            os.path.basename(include.get("file")) for include in root.iter("include")]
        if {"m2wr_sim_node", "sim.launch", "bug2.launch"} & set(started):
            simulating.append(os.path.basename(path))
            for arg in root.findall("arg"):
                described.setdefault(arg.get("name"), {})[simulating[-1]] = (arg.get("default"), arg.get("doc"))
    assert {"bug2.launch", "mapping.launch", "robots.launch", "sim.launch"} <= set(simulating)
    for arg in ("gui", "virtual_display", "screenshots", "screenshot_period", "record"):
        assert sorted(described[arg]) == simulating, arg
    for arg in ("virtual_display", "screenshots", "screenshot_period"):         # by one meaning
        assert len(set(described[arg].values())) == 1, arg


@pytest.mark.parametrize("name", ["robots.launch", "sim.launch"])
def test_where_robots_may_be_any_all_topics_are_recorded(name):
    nodes, _ = load(name, "record:=true")
    words = nodes["record"].args.split()
    assert "--all" in words and words[words.index("-o") + 1] == "'%s'" % name[:-len(".launch")]
    assert "/gazebo/world_markers" in words and not nodes["record"].required
    assert "-O '/tmp/x.bag'" in load(name, "record:=/tmp/x.bag")[0]["record"].args
    assert "record" not in load(name)[0] and "record" not in load(name, "record:=false")[0]


@pytest.mark.parametrize("listeners, joined", [("[]", ["/record"]), ("[ ]", ["/record"]),
                                               ("[/one, '/two: /clock']", ["/one", "/two: /clock", "/record"])])
def test_lockstep_of_any_robot_waits_for_the_recorder_too(listeners, joined):
    given = ["lockstep:=true", "lockstep_listeners:=" + listeners]
    assert load("sim.launch", "record:=true", *given)[1]["/gazebo/lockstep_listeners"] == joined
    assert load("sim.launch", *given)[1]["/gazebo/lockstep_listeners"] == joined[:-1]


@pytest.mark.parametrize("drive", ["bug2", "tour", "none"])
def test_mapping_is_recorded_with_its_map(drive):
    nodes, params = load("mapping.launch", "record:=true", "real_time_factor:=0", "drive:=" + drive)
    assert "-o 'mapping'" in nodes["record"].args and not nodes["record"].required
    assert {"/map", "/gazebo/world_markers", "/odom"} <= set(nodes["record"].args.split())
    assert params["/gazebo/lockstep_listeners"] == [
        "/slam_gmapping respawned: /m2wr/laser/scan", "/record"]
    assert "record" not in load("mapping.launch", "record:=false", "drive:=" + drive)[0]


@pytest.mark.parametrize("listeners, read", [
    ("", []), ("/a", ["/a"]), ("/a /b", ["/a", "/b"]), (" /a  /b ", ["/a", "/b"]), ("/a, /b", ["/a", "/b"]),
    ("/a respawned", ["/a respawned"]), ("/a: /x /y", ["/a: /x /y"]),
    ("/a respawned: /x, /b", ["/a respawned: /x", "/b"])])
def test_listeners_of_bug2_have_spaces_or_commas_between(listeners, read):
    params = load("bug2.launch", "lockstep:=true", "record:=false", "listeners:=" + listeners)[1]
    assert (params["/gazebo/lockstep_listeners"] or []) == read


def test_no_bag_and_no_pictures_are_asked_for_by_false():
    nodes, _ = load("bug2.launch", "record:=false", "pictures:=false")
    assert "record" not in nodes and "image_dump" not in nodes


@pytest.mark.parametrize("pictures, out", [("true", "pictures"), ("run.gif", "run.gif")])
def test_lockstep_waits_for_the_pictures(pictures, out):
    nodes, params = load("bug2.launch", "pictures:=" + pictures, "picture_rate:=5")
    assert params["/image_dump/out"] == out and params["/image_dump/rate"] == 5.0 and "image_dump" in nodes
    assert "/image_dump" in params["/gazebo/lockstep_listeners"]


@pytest.mark.parametrize("words", [["deliver.launch"], ["explore.launch"], ["explore.launch", "robots:=2"]], ids=str)
def test_pictures_of_one_robot_and_of_several_are_an_argument(words):
    nodes, params = load(*words, "pictures:=run.gif")
    assert params["/image_dump/out"] == "run.gif" and nodes["image_dump"].package == "m2wr_view"
    assert "image_dump" not in load(*words)[0]


def test_rviz_comes_with_a_display_or_when_asked_for(monkeypatch):
    assert "rviz" in load("bug2.launch", "gui:=true")[0]
    monkeypatch.setenv("DISPLAY", ":7")
    assert "rviz" in load("bug2.launch")[0]
    assert "rviz" not in load("bug2.launch", "gui:=false")[0]


@pytest.mark.parametrize("name", ["best_path.launch", "bug2.launch", "mapping.launch", "sim.launch", "robots.launch"])
def test_rviz_on_a_virtual_display_is_one_argument(name):
    nodes, params = load(name, "virtual_display:=true", "screenshots:=/p", "screenshot_period:=3")
    assert "rviz" not in nodes and nodes["virtual_display"].package == "m2wr_view"
    assert not nodes["virtual_display"].required
    assert (params["/virtual_display/out"], params["/virtual_display/period"]) == ("/p", 3.0)
    assert os.path.isfile(params["/virtual_display/config"])
    assert "virtual_display" not in load(name)[0]


@pytest.mark.parametrize("name, model, frame", [("best_path.launch", "m2wr", "odom"), ("bug2.launch", "m2wr", "odom"),
                                                ("mapping.launch", "m2wr", "odom"),
                                                ("robots.launch", "robot1", "world")])
def test_where_rviz_is_a_robot_can_be_placed(name, model, frame):
    assert not {"place_robot", "click_obstacles"} & set(load(name, "gui:=false")[0])
    nodes, params = load(name, "gui:=true")
    assert "place_robot" in nodes and "rviz" in nodes
    assert (params["/place_robot/model"], params["/place_robot/frame"]) == (model, frame)
    assert params["/click_obstacles/frame"] == frame


ROBOTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "data", "robots")


@pytest.mark.parametrize("robot, kind", [("four_wheels.xacro", "-urdf -param robot_description"),
                                         ("ball_wheels.urdf", "-urdf -param robot_description"),
                                         ("cart.sdf", "-sdf -file 'cart.sdf'")])
def test_sim_brings_up_any_robot_by_its_ending(monkeypatch, robot, kind):
    monkeypatch.chdir(ROBOTS)
    nodes, params = load("sim.launch", "model:=" + robot, "x:=1", "y:=2", "z:=0.3", "yaw:=4")
    spawn, name = nodes["spawn_robot"], robot.split(".")[0]
    assert " ".join(spawn.args.split()) == "%s -model %s -x 1 -y 2 -z 0.3 -Y 4" % (kind, name)
    assert ("robot_state_publisher" in nodes) == ("/robot_description" in params) == (not robot.endswith(".sdf"))
    assert "<xacro" not in params.get("/robot_description", "")
    assert "rviz" not in nodes


def test_sim_alone_brings_up_no_robot_and_no_rviz(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":7")
    assert sorted(load("sim.launch")[0]) == ["gazebo"]
    assert "rviz" in load("sim.launch", "model:=" + os.path.join(ROBOTS, "cart.sdf"))[0]
    assert sorted(load("bug2.launch", "gui:=false")[0]).count("rviz") == 0


def test_the_robot_may_have_another_name_and_absolute_path():
    nodes, _ = load("sim.launch", "model:=" + os.path.join(ROBOTS, "cart.sdf"), "name:=trolley")
    assert "-model trolley" in nodes["spawn_robot"].args


#: Launch files that other ones include, or that run beside a simulation that has the argument.
_PARTS = {"carriers.launch", "click_obstacles.launch", "elevation.launch", "foxglove_bridge.launch",
          "image_dump.launch", "live.launch", "record.launch", "robot_range.launch", "rosbridge_websocket.launch",
          "explore_costmap.launch", "explorer_range.launch", "map_merge.launch",
          "cmd_vel_mux.launch", "teleop.launch", "twist_mux.launch", "velocity_smoother.launch",
          "32e_points.launch", "64e_S3_points.launch", "VLP-32C_points.launch",
          "VLP16_points.launch"}


def _launch_files():
    """Return the launch files of all packages of the workspace, without those of tests."""
    top = os.path.join(LAUNCH_DIR, "..", "..", "..")
    found = glob.glob(os.path.join(top, "src", "*", "launch", "*.launch")) + glob.glob(
        os.path.join(top, "dropin", "*", "launch", "*.launch"))
    inner = {os.path.join("m2wr_sim", "launch", "rviz.launch"), os.path.join("m2wr_view", "launch", "rviz.launch"),
             os.path.join("explore_lite", "launch", "explore.launch")}
    return [os.path.normpath(path) for path in sorted(found) if os.path.basename(path) not in _PARTS
            and not path.endswith(tuple(inner))]


@pytest.mark.parametrize("path", _launch_files(), ids=lambda path: "/".join(path.split(os.sep)[-3::2]))
def test_live_true_starts_the_live_view_with_its_settings(path):
    needed = ["des_x:=0", "des_y:=0"] if path.endswith("behaviors.launch") else []
    nodes, params = load(path, "live:=true", "live_control:=false", "live_host:=::1", "live_port:=8123", *needed)
    assert (nodes["live"].package, nodes["live"].type) == ("m2wr_view", "live")
    assert (params["/live/control"], params["/live/host"], params["/live/port"]) == (False, "::1", 8123)
    assert "live" not in load(path, *needed)[0]
