# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark measures what it says: its world, its figures, its yardstick in C, its command line."""
import json
import math
import os
import random
import subprocess
import sys

import numpy as np
import pytest

from m2wr_sim.errors import SimError
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_tools.benchmark import c_loop, command, controllers_speed, ground_speed, in_process, others, reference, table
from m2wr_tools.benchmark.arguments import OTHERS

PACKAGE = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
SIMULATOR = os.path.join(os.path.dirname(PACKAGE), "m2wr_sim")
STEP, STEPS_PER_SECOND = 0.005, 200.0       # s, 1/s
TRIES = 3


def case(robots=1, obstacles=20, **changes):
    world = load_world(reference.world_sdf(obstacles, robots))
    return in_process.Case(world, robots, **dict(dict(step=STEP, duration=1.0, beams=90), **changes))


# ---- the world ----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("obstacles", [0, 3, 60])
def test_the_world_has_the_requested_number_of_obstacles(obstacles):
    world = load_world(reference.world_sdf(obstacles))
    assert len(world.models) == 1 + obstacles and all(model.static for model in world.models)
    assert reference.world_sdf(obstacles) == reference.world_sdf(obstacles)
    if obstacles > 4:
        assert reference.world_sdf(obstacles, seed=2) != reference.world_sdf(obstacles)


def test_more_obstacles_or_robots_come_with_more_room():
    assert reference.side_of(60, 1) == reference.SIDE
    assert reference.side_of(2000, 1) == pytest.approx(24.0 * math.sqrt(2000.0 / 60.0))
    assert reference.side_of(60, 400) > 40.0


def test_a_place_that_does_not_exist_is_an_error():
    with pytest.raises(ValueError, match="no free place"):
        reference._free_place(random.Random(1), 0.5, [(0.0, 0.0)], 0.5)


def test_robots_stand_apart():
    places = reference.robot_places(7)
    assert len(set(places)) == 7
    assert min(math.dist(one, two) for one in places for two in places if one != two) > 2.0


@pytest.mark.parametrize("robots", [1, 5])
def test_robots_drive_their_circles_without_contacts(robots):
    simulator, scanners = in_process.build(case(robots, duration=7.0))
    before = simulator.engine.solver_messages           # all of this process have been counted
    starts = [simulator.model_state("robot%d" % index).position for index in range(robots)]
    in_process.run_until(simulator, int(2.0 * math.pi / reference.ANGULAR * 1e9))
    for index in range(robots):
        state = simulator.model_state("robot%d" % index)
        assert state.position == pytest.approx(starts[index], abs=0.06)      # the time to get going is missing
        assert math.hypot(*state.linear[:2]) == pytest.approx(reference.LINEAR, rel=1e-3)
        assert state.angular[2] == pytest.approx(reference.ANGULAR, rel=1e-3)
    assert simulator.contact_counts == {} and simulator.engine.solver_messages == before
    hits = [value for value in scanners[0].ranges if math.isfinite(value)]
    assert len(hits) > 10 and all(0.1 <= value <= reference.RANGE_MAX for value in hits)
    simulator.close()


# ---- the figures --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("engine", ["auto", "pyode"])
def test_figures_of_a_case_fit_together(engine):
    told = []
    results = [in_process.measure(case(engine=engine), told.append) for _ in range(TRIES)]
    result = results[0]
    assert told[-1] == 1.0 and told == TRIES * sorted(set(told))
    assert result["messages"] == 0 and result["contacts"] == 0 and result["memory_mb"] > 10.0
    assert 0.0 < result["scan_share"] + result["physics_share"] <= 1.0
    assert 1.0 < result["step_us"] < 2000.0 and 1.0 < result["scan_us"] < 5000.0
    # steps alone take a part of the time; both are measured apart, so other programs may slow one of them
    assert min(result["factor"] * result["step_us"] for result in results) * STEPS_PER_SECOND < 1.5e6


def test_stop_watch_counts_calls_and_gives_the_function_back():
    class Worker:
        def work(self, number):
            return 2 * sum(range(number))

    worker = Worker()
    watch = in_process.Stopwatch(worker, "work")
    assert worker.work(20000) == 2 * sum(range(20000)) and worker.work(3) == 6
    assert watch.calls == 2 and watch.seconds > 0.0
    watch.remove()
    worker.work(3)
    assert watch.calls == 2


def test_a_stopwatch_does_not_count_its_own_readings():
    class Idle:
        def rest(self):
            """Take no time."""

    means = []
    for _ in range(5):
        idle = Idle()
        watch = in_process.Stopwatch(idle, "rest")
        for _ in range(2000):
            idle.rest()
        means.append(watch.seconds / watch.calls)
    assert abs(min(means, key=abs)) < 0.6 * in_process.reading_cost()


# ---- the yardstick in C -------------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def program(tmp_path_factory):
    try:
        return c_loop.compile_loop(os.path.join(PACKAGE, "bench", "step_loop.c"), str(tmp_path_factory.mktemp("c")))
    except c_loop.CompilerMissing as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("robots, step", [(1, 0.001), (3, 0.005)])
def test_the_loop_in_c_does_the_same_to_the_last_bit(program, robots, step):
    measured = case(robots, step=step)
    _, position, settings = in_process.time_engine(measured, 400)
    text = c_loop.world_text(measured.world, in_process.robot_model(90), reference.robot_places(robots),
                             in_process.motor_rates(), in_process.FORCE, settings, 2, 200)
    times, c_position = c_loop.run_loop(program, text)
    assert len(times) == 2 and all(value > 0.0 for value in times)
    assert c_position == position


def test_robots_that_meet_do_so_in_c_too(program):
    """Two robots that spin side by side: contacts between bodies, capped and steep ones."""
    settings, robot = EngineSettings(step_ns=5000000, friction_solves=1), in_process.robot_model(90)
    world = load_world(reference.world_sdf(4))
    places, rates = [(-0.27, 0.0, 0.1), (0.27, 0.1, 0.1)], {"left": 5.0, "right": -5.0}
    engine = make_engine("auto", settings)
    for model in world.models:
        engine.add_model(model, model.pose)
    handles = [engine.add_model(robot, (place, (0.0, 0.0, 0.0, 1.0)), "robot%d" % index)
               for index, place in enumerate(places)]
    for handle in handles:
        for joint, rate in rates.items():
            engine.set_joint_motor(handle.joints[joint], rate, 5.0)
    engine.step(1000)
    ends, contacts = engine.link_pose(handles[0].links["chassis"])[0], engine.drain_contact_events()
    engine.close()
    assert contacts, "the robots never met: the scene tests too little"
    text = c_loop.world_text(world, robot, places, rates, 5.0, settings, 1, 1000)
    assert c_loop.run_loop(program, text)[1] == ends


def test_what_the_program_cannot_read_is_an_error(program):
    with pytest.raises(SimError, match="code 2: .*world"):
        c_loop.run_loop(program, "word 1 2 3\n")
    with pytest.raises(SimError, match="static worlds only"):
        c_loop.world_text(load_world("<sdf version='1.6'><world name='w'><model name='free'><link name='l'/></model>"
                                     "</world></sdf>"), None, [], {}, 5.0, EngineSettings(), 1, 1)


def test_a_compiler_that_is_not_there_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", str(tmp_path / "no-compiler"))
    with pytest.raises(c_loop.CompilerMissing, match="no-compiler"):
        c_loop.compile_loop("step_loop.c", str(tmp_path))


def test_a_compiler_that_fails_says_why(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "/bin/false")
    with pytest.raises(c_loop.CompilerMissing, match="libode-dev"):
        c_loop.compile_loop("step_loop.c", str(tmp_path))


# ---- the command --------------------------------------------------------------------------------------------------

@pytest.fixture
def from_source(monkeypatch):
    monkeypatch.setattr(command, "package_folder", lambda: SIMULATOR)
    monkeypatch.setattr(c_loop, "source", lambda: os.path.join(PACKAGE, "bench", "step_loop.c"))


@pytest.mark.parametrize("arguments", [
    ("--step", "0"), ("--step", "0.03"), ("--step", "nan"), ("--robots", "0"), ("--beams", "0"), ("--duration", "0"),
    ("--engine", "bullet"), ("--clients", "2"), ("--soak", "0"), ("--obstacles", "-1"), ("--compare", "rust")])
def test_arguments_out_of_range_are_refused(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    assert ended.value.code == 2 and arguments[0] in capsys.readouterr().err


def test_simulators_on_the_command_line_are_checked():
    assert sorted(OTHERS) == sorted(others.MAKERS)


def test_a_world_that_does_not_exist_is_named(from_source, capsys):
    assert command.main(["--world", "nowhere.world"]) == 1
    assert "nowhere.world" in capsys.readouterr().err


def test_json_says_what_was_asked_where_and_what_came_out(from_source, capsys):
    assert command.main(["--json", "--duration", "0.5", "--step", "0.01", "--world", "empty"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["asked"]["step"] == 0.01 and record["machine"]["cores"] == os.cpu_count()
    assert record["result"]["factor"] > 0.0


def test_plain_lines_have_a_meaning_and_a_unit(from_source, capsys):
    assert command.main(["--duration", "0.5", "--step", "0.01", "--obstacles", "4"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("scan [us]") for line in lines)


def test_comparison_gives_a_ratio(program, from_source, capsys, monkeypatch):
    monkeypatch.setattr(command, "_C_STEPS", 200)
    assert command.main(["--compare", "c", "--repeats", "1", "--obstacles", "4", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result["ratio"] == pytest.approx(result["step_us"] / result["c_step_us"])


def test_table_has_a_row_for_every_case_and_takes_medians(monkeypatch):
    asked = []

    def run_case(arguments):
        asked.append(arguments)
        return {"factor": 100.0 + len(asked), "step_us": 5.0, "scan_us": 10.0, "messages": 0, "memory_mb": 150.0,
                "load": 0.02, "ratio": 1.05, "c_step_us": 4.8, "bounded_us": 4.3}

    monkeypatch.setattr(table, "run_case", run_case)
    monkeypatch.setattr(table.importlib.util, "find_spec", lambda name: None)       # no other simulator
    text = table.make(3, lambda share: None)
    assert all("| %s |" % name in text for name, _ in table.CASES + table.COMPARISONS)
    assert len(asked) == 3 * len(table.CASES) + len(table.COMPARISONS)
    first = next(line for line in text.splitlines() if line.startswith("| %s |" % table.CASES[0][0]))
    assert first.split("|")[2].strip() == "%d" % (101 + len(table.CASES))
    assert "1, with 2.0 % of a core" in text


def test_the_table_lists_installed_simulators(monkeypatch):
    asked = []

    def run_case(arguments):
        asked.append(arguments)
        return {"factor": 200.0, "other_factor": 80.0, "faster": 2.5, "speed": 0.5, "turn_rate": 0.9}

    monkeypatch.setattr(table, "run_case", run_case)
    monkeypatch.setattr(table.importlib.util, "find_spec", lambda name: name if name == "pybullet" else None)
    text = "\n".join(table._other_simulators(3))
    assert "| pybullet, 1 robot, 1 ms | 200 | 80 | 2.5 | 0.50 m/s, 0.90 rad/s |" in text and "mujoco" not in text
    assert len(asked) == len(table.OTHERS)


def test_controllers_are_measured_on_robots_that_they_drive():
    text = controllers_speed.report(steps=20)
    assert [line.split("|")[1].strip() for line in text.splitlines()[2:]] == [
        case.name for case in controllers_speed.CASES]


def test_controllers_that_do_not_start_are_told():
    broken = controllers_speed.CASES[1]._replace(controllers={"drive": {"type": "unknown"}})
    with pytest.raises(ValueError, match="did not start"):
        controllers_speed.time_of(broken, steps=20)


def test_a_step_is_measured_on_a_plane_and_on_heightmaps(monkeypatch):
    monkeypatch.setattr(ground_speed, "SAMPLES", 65)
    rows = [line.split("|")[1:4] for line in ground_speed.report(50, (0.1,)).splitlines()[2:]]
    assert [row[0].strip() for row in rows] == [
        "plane", "level, 65 x 65 samples, cell 10 cm", "rough, 65 x 65 samples, cell 10 cm"]
    assert all(float(value) > 0.0 for row in rows for value in row[1:])


def test_a_simulator_that_is_not_installed_is_named(from_source, capsys, monkeypatch):
    for name in ("mujoco", "pybullet"):
        monkeypatch.setitem(sys.modules, name, None)
        assert command.main(["--simulator", name, "--duration", "0.2"]) == 1
        assert "pip install %s" % name in capsys.readouterr().err


@pytest.mark.parametrize("name", sorted(others.MAKERS))
def test_another_simulator_sees_the_same_scene_and_drives(name):
    """Runs where the simulator is installed; it belongs to no list of requirements."""
    pytest.importorskip(name.split("-")[0])
    measured = case(step=0.001)
    result = others.measure(name, measured)
    assert result["factor"] > 0.0 and result["speed"] == pytest.approx(0.5, rel=0.1)
    other, (simulator, scanners) = others.MAKERS[name](measured), in_process.build(measured)
    try:
        scan = other.scan(0)
        in_process.run_until(simulator, 100000000)
        ours = scanners[0].ranges
        hits = np.isfinite(scan) & np.isfinite(ours)
        assert hits.sum() > 0.8 * np.isfinite(ours).sum()
        assert np.median(np.abs(scan[hits] - ours[hits])) < 0.1
    finally:
        other.close()
        simulator.close()


def test_a_case_that_fails_is_told_with_its_reason():
    with pytest.raises(SimError, match="nowhere.world"):
        table.run_case(("--world", "nowhere.world"))


def test_the_whole_node_is_measured_with_a_listener():
    pytest.importorskip("rosmaster", reason="needs ROS's master")
    done = subprocess.run([sys.executable, "-m", "m2wr_tools.benchmark.command", "--clients", "1", "--step", "0.005",
                           "--duration", "5", "--beams", "90", "--json"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=240)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])["result"]
    assert set(result["received"]) == {"/clock", "/tf", "/robot0/scan", "/robot0/odom", "/robot0/joint_states"}
    assert all(count > 0 for count in result["received"].values())
    assert 0.0 < result["startup_s"] < 60.0 and result["factor"] > 1.0 and result["messages"] == 0


def test_calls_of_a_service_are_timed():
    done = subprocess.run([sys.executable, "-m", "m2wr_tools.benchmark.command", "--calls", "50", "--step", "0.01",
                           "--obstacles", "2", "--factor", "1", "--json"], stdout=subprocess.PIPE,
                          universal_newlines=True, timeout=300, check=True)
    result = json.loads(done.stdout)["result"]
    assert result["calls"] == 50
    assert 0.0 < result["call_median_ms"] <= result["call_p99_ms"] <= result["call_longest_ms"]
    assert "get_model_state, median [ms]" in table.lines(result)


def test_a_soak_tells_the_memory_after_each_minute():
    pytest.importorskip("rosmaster", reason="needs ROS's master")
    done = subprocess.run([sys.executable, "-m", "m2wr_tools.benchmark.command", "--soak", "2", "--step", "0.01",
                           "--json"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=240)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])["result"]
    memory = result["memory_by_minute_mb"]
    assert len(memory) == 3 and all(10.0 < value <= result["memory_mb"] for value in memory)
    assert result["late_growth_mb"] == pytest.approx(max(0.0, memory[2] - memory[1]))
    assert table.lines(result).count("memory after minute") == 3


def test_the_models_of_the_reference_are_sound():
    robot, = load_sdf_models(reference.robot_sdf(360))
    assert robot.notes == () and robot.links[0].sensors[0].ray.samples == 360
    assert sum(link.inertial.mass for link in robot.links) == pytest.approx(5.4)


def test_peak_memory_excludes_the_parent_process():
    child = "from m2wr_sim.process_memory import memory_mb; print(memory_mb('VmRSS'), memory_mb('VmHWM'))"
    parent = ("import subprocess, sys; block = b'x' * (400 << 20); "
              "sys.stdout.write(subprocess.check_output([sys.executable, '-c', %r]).decode())" % child)
    now, peak = map(float, subprocess.check_output([sys.executable, "-c", parent]).split())
    assert 1.0 < now <= peak < 300.0
