# SPDX-License-Identifier: BSD-3-Clause
"""What is true in a run: range of the radio, batteries, loads, the end and the report."""
import json

import pytest

from m2wr_delivery import figure, report
from m2wr_delivery.dispatcher import SILENCE
from m2wr_delivery.parcels import DELIVERED, Result, Status
from m2wr_delivery.radio import encode
from m2wr_delivery.referee import IDLE_LIMIT, Referee, Truth
from m2wr_delivery.scenario import Settings, make_scenario

FIELD = make_scenario(3, Settings(robots=2, parcels=1, blocked=0, walls=0, roughness=0.0))
PARCEL = FIELD.parcels[0]


def at(x, y, tilt=0.0):
    return Truth(x, y, 0.1, 0.0, tilt)


class Run:
    """A referee and robots that are put where a test says."""

    def __init__(self, field=FIELD):
        self.referee, self.time = Referee(field), 0.0
        self.places = {"robot1": at(1.1, 0.0), "robot2": at(-1.1, 0.0)}
        self.senses = {}

    def step(self, seconds=0.1, **outboxes):
        for _ in range(max(1, round(seconds / 0.1))):
            self.time += 0.1
            self.senses = self.referee.step(self.time, self.places, outboxes)
        return self.senses


def status(robot="robot1", time=1.0, results=(), bids=None):
    return encode(Status(robot, time, (0.0, 0.0), 1.0, "waiting", "", False, tuple(results), bids or {}).message())


def test_only_robots_in_range_hear_the_base_and_have_a_fix():
    run = Run()
    run.places["robot2"] = at(9.0, 9.0)
    senses = run.step()
    assert senses["robot1"].inbox and senses["robot1"].fix == pytest.approx((1.1, 0.0), abs=0.15)
    assert not senses["robot2"].inbox and senses["robot2"].fix is None


def test_robots_pass_on_what_they_hear():
    run = Run()
    run.places.update(robot1=at(6.0, 0.0), robot2=at(9.0, 0.0))
    assert run.step(robot2=[status("robot2")])["robot2"].fix is not None
    assert "robot2" in run.referee.base.heard and run.senses["robot1"].inbox


def test_a_robot_cannot_speak_for_another_and_rubbish_is_told():
    run = Run()
    board = '{"kind": "board", "time": 1, "offered": [], "assigned": {}}'
    assert not run.step(robot1=[status("robot2"), "{", board])["robot2"].inbox[1:]
    assert len(run.referee.rejected) == 3 and not run.referee.base.heard


def test_a_battery_empties_and_a_flat_robot_is_silent():
    run = Run()
    run.places["robot1"] = at(5.0, 0.0)
    senses = run.step(60.0)
    used = 1.0 - senses["robot1"].battery
    assert used == pytest.approx(60.0 * 12.0 / 6000.0, rel=0.05) and senses["robot2"].battery == 1.0
    run.step(600.0)
    assert not run.referee.powered("robot1") and "flat" in run.referee.members["robot1"].end
    assert run.step()["robot1"].inbox == () and run.senses["robot1"].fix is None


def test_the_charger_charges():
    run = Run()
    run.step()
    run.referee.members["robot1"].battery.take(1000.0)
    run.step(5.0)
    assert run.referee.members["robot1"].battery.level == pytest.approx(5000.0 + 5.0 * (100.0 - 12.0), rel=0.01)


def test_a_parcel_is_loaded_carried_and_put_down():
    run = Run()
    run.places["robot1"] = at(*PARCEL.pick_up)
    run.step(0.3)
    assert run.referee.pick_up("robot2").startswith("there is no parcel")
    assert run.referee.pick_up("robot1") == "" and run.step()["robot1"].loaded
    assert "already" in run.referee.pick_up("robot1")
    run.places["robot1"] = at(*PARCEL.drop_off)
    run.step()
    assert "expected it to stand" in run.referee.put_down("robot1")
    run.step()
    assert run.referee.put_down("robot1") == "" and run.referee.cargo[PARCEL.name].delivered == run.time
    assert run.referee.put_down("robot1") == "robot1 carries nothing"


def test_a_tipped_robot_ends_with_its_parcel():
    run = Run()
    run.places["robot1"] = at(*PARCEL.pick_up)
    run.step(0.3)
    run.referee.pick_up("robot1")
    run.step()
    run.referee.base.hear(Status("robot1", 1.0, (0.0, 0.0), 1.0, "", "", False, (), {PARCEL.name: 1.0}))
    run.step(4.0, robot1=[status(time=2.0, bids={PARCEL.name: 1.0})])
    run.places["robot1"] = at(*PARCEL.pick_up, tilt=2.0)
    run.step(0.3)
    assert "tipped" in run.referee.members["robot1"].end and run.referee.pick_up("robot1") == "robot1 cannot move"


def test_the_run_ends_when_all_is_done_and_robots_are_back():
    run = Run()
    run.step()
    assert run.referee.finished() == ""
    run.step(robot1=[status(results=[Result(PARCEL.name, DELIVERED, 1.0)])])
    assert "every parcel" in run.referee.finished()


def test_the_run_ends_if_no_robot_takes_what_is_left():
    run = Run()
    run.step(IDLE_LIMIT + 1.0)
    assert run.referee.finished() == "no robot takes the parcels that are left"
    result = report.result_of(FIELD, run.referee, run.referee.finished())
    assert not report.succeeded(result) and "no robot took it" in report.text_of(result)


def test_report_and_figure_are_written(tmp_path):
    run = Run()
    run.step(3.0)
    result = report.result_of(FIELD, run.referee, "the test")
    report.write(str(tmp_path / "run.json"), result)
    figure.save(str(tmp_path / "run.png"), FIELD, run.referee)
    assert json.loads((tmp_path / "run.json").read_text())["ended"] == "the test"
    assert (tmp_path / "run.png").stat().st_size > 10000


def test_a_silent_robot_is_lost_until_it_tells_again():
    run = Run()
    run.step(5.0, robot1=[status(bids={PARCEL.name: 1.0})], robot2=[status("robot2")])
    assert run.referee.base.entries[PARCEL.name].state == "assigned"
    run.places["robot1"] = at(*PARCEL.pick_up)
    run.step(1.0)
    assert run.referee.pick_up("robot1") == ""
    run.step(0.1, robot1=[encode(Status("robot1", 6.0, PARCEL.pick_up, 1.0, "bringing", PARCEL.name, True, (), {})
                                 .message())])
    run.step(SILENCE + 1.0, robot2=[status("robot2")])
    assert "told nothing since 6 s" in run.referee.members["robot1"].lost and not run.referee.members["robot2"].lost
    assert run.referee.base.entries[PARCEL.name].state == "given up"
    run.step(0.2, robot2=[status("robot2")])
    assert "given up, and the robots are back" in run.referee.finished()
    row = report.result_of(FIELD, run.referee, "test")["parcels"][0]
    assert "told nothing" in row["why_not"] and "it is on robot1" in row["why_not"]
    run.step(0.2, robot1=[status(time=200.0)], robot2=[status("robot2")])
    assert not run.referee.members["robot1"].lost and not run.referee.finished()
