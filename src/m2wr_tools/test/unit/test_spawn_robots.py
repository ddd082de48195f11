# SPDX-License-Identifier: BSD-3-Clause
"""robots.launch for any number of robots, and what spawn_robots and wander_robots refuse; no master is needed."""
import os

import pytest
import roslib.packages
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

from launch_files import LAUNCH_DIR, load
from m2wr_tools.robots import spawn_robots, wander


@pytest.mark.parametrize("count", [1, 2, 3, 7, 50])
def test_each_robot_has_its_namespace_prefix_and_state_publisher(count):
    nodes, params = load("robots.launch", "robots:=%d" % count)
    names = ["robot%d" % k for k in range(1, count + 1)]
    assert {key: value for key, value in params.items() if key.endswith("tf_prefix")} == {
        "/%s/tf_prefix" % name: name for name in names}
    config = ROSLaunchConfig()
    XmlLoader().load(os.path.join(LAUNCH_DIR, "robots.launch"), config, argv=["robots.launch", "robots:=%d" % count],
                     verbose=False)
    assert sorted(node.namespace for node in config.nodes if node.type == "robot_state_publisher") == sorted(
        "/%s/" % name for name in names)
    assert "--robots %d " % count in " ".join(nodes["spawn_robots"].args.split())


def test_all_share_a_description_whose_topics_are_relative():
    _, params = load("robots.launch")
    assert [key for key in params if key.endswith("robot_description")] == ["/robot_description"]
    assert "<topicName>m2wr/laser/scan</topicName>" in params["/robot_description"]


def test_they_start_together():
    nodes, params = load("robots.launch")
    assert params["/gazebo/paused"] is True and "--unpause" in nodes["spawn_robots"].args
    assert "--unpause" not in load("robots.launch", "paused:=true")[0]["spawn_robots"].args


def test_arguments_reach_the_nodes():
    nodes, params = load("robots.launch", "robots:=4", "name:=ant", "world:=world01", "layout:=circle", "x:=-1.5",
                         "y:=2", "yaw:=-0.5", "spacing:=2", "seed:=7", "step:=0.005", "real_time_factor:=0",
                         "world_frame:=none", "controller:=wander", "command_timeout:=0.5")
    arguments = spawn_robots.make_parser().parse_args(nodes["spawn_robots"].args.split())
    assert (arguments.robots, arguments.name, arguments.layout, arguments.x, arguments.y, arguments.yaw) == (
        4, "ant", "circle", -1.5, 2.0, -0.5)
    assert (arguments.spacing, arguments.seed, arguments.world_frame, arguments.unpause) == (2.0, 7, "none", True)
    assert nodes["wander_robots"].args.split() == ["--robots", "4", "--name", "ant"]
    expected = {"world": "world01", "step": 0.005, "seed": 7, "real_time_factor": 0.0, "command_timeout": 0.5}
    assert {name: params["/gazebo/" + name] for name in expected} == expected


@pytest.mark.parametrize("options, absent", [(["controller:=none"], "wander_robots"), (["gui:=false"], "rviz"),
                                             (["state_publishers:=false"], "robot_state_publisher")])
def test_what_is_not_wanted_is_not_started(options, absent):
    assert absent not in load("robots.launch", *options)[0]


def test_every_node_exists():
    for node in load("robots.launch", "controller:=wander")[0].values():
        assert roslib.packages.find_node(node.package, node.type), (node.package, node.type)


@pytest.mark.parametrize("main", [spawn_robots.main, wander.main])
@pytest.mark.parametrize("words", [["--robots", "many"], ["--heap"]])
def test_misuse_ends_with_code_2(main, words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["program"] + words)
    assert caught.value.code == 2 and "usage" in capsys.readouterr().err
