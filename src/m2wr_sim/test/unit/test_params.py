# SPDX-License-Identifier: BSD-3-Clause
"""The node's parameters: types, ranges, unknown names, and where a world's name leads."""
import pytest

from m2wr_sim.errors import ParameterError, WorldError
from m2wr_sim.ros.params import NodeConfig, read_config
from m2wr_sim.ros.shared_files import find_world


def refusal(**parameters):
    with pytest.raises(ParameterError) as caught:
        read_config(parameters)
    return str(caught.value)


def test_without_parameters_the_defaults_hold():
    config, unknown = read_config({})
    assert config == NodeConfig() and unknown == []
    assert config.wheel_convention == "noetic" and config.real_time_factor is None and config.seed == 0


def test_every_parameter_is_explained():
    from dataclasses import fields
    assert all(len(entry.metadata["help"]) > 10 for entry in fields(NodeConfig))


def test_values_arrive_with_their_types():
    config, unknown = read_config({
        "world": "a.world", "real_time_factor": 2, "seed": 3.0, "step": 0.005, "solver": "quick", "paused": True,
        "pub_clock_frequency": 0, "wheel_convention": "rep103", "wheel_conventions": {"m2wr": "kinetic"},
        "command_timeout": 1, "joint_states": False, "joint_state_rate": 20})
    assert unknown == []
    assert (config.real_time_factor, config.seed, config.step, config.solver) == (2.0, 3, 0.005, "quick")
    assert isinstance(config.seed, int) and isinstance(config.real_time_factor, float)
    assert config.paused is True and config.joint_states is False and config.wheel_conventions == {"m2wr": "kinetic"}


def test_unknown_names_are_returned_sorted():
    config, unknown = read_config({"zeta": 1, "seed": 1, "alpha": True})
    assert config.seed == 1 and unknown == ["alpha", "zeta"]


def test_an_empty_real_time_factor_is_none():
    assert read_config({"real_time_factor": ""})[0].real_time_factor is None
    assert read_config({"real_time_factor": 0})[0].real_time_factor == 0.0


@pytest.mark.parametrize("name, value, words", [
    ("real_time_factor", -1, "at least 0"), ("real_time_factor", float("nan"), "finite"),
    ("real_time_factor", float("inf"), "finite"), ("real_time_factor", "fast", "a number"),
    ("seed", -1, "at least 0"), ("seed", 1.5, "a whole number"), ("seed", "7", "a whole number"),
    ("seed", True, "a whole number"),
    ("step", 0.5, "0 or 0.00001 to 0.1 s"), ("step", -0.001, "0 or 0.00001"), ("step", 1e-7, "0 or 0.00001"),
    ("step", float("nan"), "0 or 0.00001"), ("solver", "ode", "step, quick"), ("paused", 1, "true or false"),
    ("paused", "true", "true or false"), ("joint_states", None, "true or false"),
    ("pub_clock_frequency", -5.0, "at least 0"), ("pub_state_frequency", "x", "a number"),
    ("wheel_convention", "legacy", "noetic, kinetic, rep103"), ("wheel_conventions", "kinetic", "names of models"),
    ("wheel_conventions", ["a"], "names of models"), ("command_timeout", -0.1, "at least 0"),
    ("joint_state_rate", float("inf"), "finite")])
def test_bad_values_are_refused_by_name_value_and_range(name, value, words):
    message = refusal(**{name: value})
    assert "~" + name in message and repr(value) in message and words in message


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_a_seed_that_is_not_finite_is_refused_like_any_other(value):
    assert "~seed" in refusal(seed=value)


def test_a_models_convention_is_checked_too():
    message = refusal(wheel_conventions={"good": "noetic", "bad": "left"})
    assert "~wheel_conventions/bad" in message and "'left'" in message and "noetic, kinetic, rep103" in message


@pytest.mark.parametrize("value", [0.00001, 0.1, 0.0])
def test_the_ends_of_a_range_belong_to_it(value):
    assert read_config({"step": value})[0].step == value


def test_worlds_are_found_by_path_then_in_the_folder(tmp_path, monkeypatch):
    folder, elsewhere = tmp_path / "worlds", tmp_path / "else"
    for place in (folder, elsewhere):
        place.mkdir()
    (folder / "a.world").write_text("<sdf/>")
    (elsewhere / "b.world").write_text("<sdf/>")
    monkeypatch.chdir(elsewhere)
    assert find_world("a.world", str(folder)) == find_world("a", str(folder)) == str(folder / "a.world")
    for name in ("b.world", str(elsewhere / "b.world")):
        assert find_world(name, str(folder)) == str(elsewhere / "b.world")
    (elsewhere / "a.world").write_text("<sdf/>")
    assert find_world("a.world", str(folder)) == str(elsewhere / "a.world")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("m2wr_sim.ros.shared_files.user_folder", lambda: str(elsewhere))
    assert find_world("b", str(folder)) == str(elsewhere / "b.world")
    with pytest.raises(WorldError, match="nowhere.world.*cannot be read.*%s.*%s" % (elsewhere, folder)):
        find_world("nowhere.world", str(folder))


@pytest.mark.parametrize("text, number", [("1e-3", 0.001), ("2E-3", 0.002), ("5.e-3", 0.005)])
def test_a_number_with_an_exponent_needs_no_dot_and_no_sign(text, number):
    """YAML takes it for a text."""
    assert read_config({"step": text})[0].step == number


@pytest.mark.parametrize("text", ["e3", "1e", "1e-3x", "--1e3", "1e400"])
def test_what_only_looks_like_an_exponent_is_refused(text):
    with pytest.raises(ParameterError, match="parameter ~real_time_factor is .* expected a .*number"):
        read_config({"real_time_factor": text})


def test_a_listener_with_topics_needs_no_quotes():
    assert read_config({"lockstep_listeners": [{"/rec": "/clock /odom"}, "/other"]})[0].lockstep_listeners == [
        "/rec: /clock /odom", "/other"]
    for bad in ({"/a": "/b", "/c": "/d"}, {}, 7):
        with pytest.raises(ParameterError, match="expected a list of names"):
            read_config({"lockstep_listeners": [bad]})


@pytest.mark.parametrize("name, value, words", [
    ("lockstep", 1, "true or false"), ("lockstep_controllers", "/bug2", "a list of names"),
    ("lockstep_controllers", [""], "a list of names"), ("lockstep_replies", [3], "a list of names"),
    ("lockstep_tick", "clock", "scan, odometry, both"), ("lockstep_patience", 0.0, "at least 0.1"),
    ("lockstep_on_silence", "wait", "stop, go_on")])
def test_bad_lockstep_parameters_are_refused(name, value, words):
    with pytest.raises(ParameterError) as caught:
        read_config({name: value})
    assert "~" + name in str(caught.value) and words in str(caught.value)
