# SPDX-License-Identifier: BSD-3-Clause
"""The doctor on master and topics: without a fault, and with each of the faults that it reports."""
import pytest

from doctor_machine import FakeMachine, environment_findings, faults, make_graph, one_fault
from m2wr_tools.doctor import environment, graph
from m2wr_tools.doctor.machine import Machine


def test_a_sound_graph_has_no_faults():
    assert not faults(graph.check_master(FakeMachine(), make_graph()) + graph.check_topics(make_graph()))


def test_loopback_nodes_with_a_remote_master_are_reported():
    one_fault(environment_findings(ROS_MASTER_URI="http://other:11311"), "problem", "the master is on other",
              "ROS_HOSTNAME is localhost", "export ROS_IP=")


def test_nodes_open_to_the_network_are_reported():
    def examine(**variables):
        machine = FakeMachine()
        del machine.environ["ROS_HOSTNAME"]
        machine.environ.update(variables)
        machine.hosts["laptop"] = ["127.0.1.1"]
        return environment.check_environment(machine)

    one_fault(examine(), "warning", "neither ROS_IP nor ROS_HOSTNAME", "ROS_IP=127.0.0.1")
    assert not faults(examine(ROS_MASTER_URI="http://other:11311"))


def test_ports_of_cpp_nodes_that_others_can_reach_are_told():
    running = graph.Graph({}, {}, {}, {}, {"/rosout": "http://localhost:4001/", "/gazebo": "http://localhost:4002/"},
                          [], None)
    texts = [entry.what for entry in graph.check_master(FakeMachine(open_everywhere={4001}), running)]
    assert any(text.startswith("/rosout: XML-RPC port open to other machines") for text in texts), texts
    texts = [entry.what for entry in graph.check_master(FakeMachine(), running)]
    assert "all nodes listen on the loopback address only" in texts


def test_only_sockets_bound_to_every_address_count_as_open():
    import socket
    with socket.socket() as everywhere, socket.socket() as here:
        everywhere.bind(("0.0.0.0", 0))
        here.bind(("127.0.0.1", 0))
        everywhere.listen(1)
        here.listen(1)
        found = Machine().open_to_all()
        assert everywhere.getsockname()[1] in found and here.getsockname()[1] not in found


def test_no_master_is_no_fault_here_and_one_elsewhere():
    assert not faults(graph.check_master(FakeMachine(), None))
    machine = FakeMachine()
    machine.environ["ROS_MASTER_URI"] = "http://other:11311"
    one_fault(graph.check_master(machine, None), "warning", "other:11311", "unset ROS_MASTER_URI")
    one_fault(graph.check_master(FakeMachine(open_ports={("localhost", 11311)}), None), "problem", "not a ROS master")


@pytest.mark.parametrize("changes, level, words", [
    ({"publishers": {}}, "problem", ("nothing publishes /clock", "use_sim_time false")),
    ({"publishers": {"/clock": ["/gazebo", "/play"]}}, "problem", ("2 nodes publish /clock", "rosnode kill")),
    ({"sim_time": None}, "warning", ("not set", "use_sim_time true")),
    ({"sim_time": False}, "warning", ("is false",)),
    ({"silent": ["/go_to_point"]}, "warning", ("/go_to_point is registered", "rosnode cleanup")),
    ({"silent": ["/far"], "nodes": {"/far": "http://nowhere:3"}}, "problem", ("nowhere", "ROS_HOSTNAME"))])
def test_faults_of_a_graph(changes, level, words):
    one_fault(graph.check_master(FakeMachine(), make_graph(**changes)), level, *words)


def test_a_dead_simulator_publishes_no_clock():
    found = faults(graph.check_master(FakeMachine(), make_graph(silent=["/gazebo"])))
    assert [entry.level for entry in found] == ["warning", "problem"]


@pytest.mark.parametrize("senders, takers, words", [
    (["/teleop", "/go_to_point"], ["/gazebo"], ("2 nodes publish /cmd_vel", "rosnode kill")),
    (["/teleop"], [], ("no robot subscribes", "spawn"))])
def test_faults_of_commands(senders, takers, words):
    state = make_graph(publishers={"/cmd_vel": senders}, subscribers={"/cmd_vel": takers})
    one_fault(graph.check_topics(state), "warning", *words)


def test_a_robot_in_another_namespace_is_named():
    state = make_graph(types={"/cmd_vel": "geometry_msgs/Twist", "/r1/cmd_vel": "geometry_msgs/Twist"},
                       publishers={"/cmd_vel": ["/teleop"]}, subscribers={"/r1/cmd_vel": ["/gazebo"]})
    one_fault(graph.check_topics(state), "warning", "cmd_vel:=/r1/cmd_vel")


def test_no_master_is_noticed_quickly():
    assert graph.read_graph({"ROS_MASTER_URI": "http://127.0.0.1:1"}) is None
    assert graph.read_graph({"ROS_MASTER_URI": "nonsense"}) is None
