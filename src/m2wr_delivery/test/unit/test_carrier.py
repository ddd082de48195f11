# SPDX-License-Identifier: BSD-3-Clause
"""What a robot decides, on a level map and without a simulation: it moves as it commands."""
import math

import numpy as np
import pytest

from m2wr_delivery import carrier as module
from m2wr_delivery.carrier import Carrier, Sense
from m2wr_delivery.parcels import Board, Parcel, status_of
from m2wr_delivery.radio import decode, encode
from m2wr_elevation.elevation_map import MapSettings

SETTINGS = MapSettings(size=12.0, cell=0.1)
PARCEL = Parcel("p1", (3.0, 0.0), (3.0, 3.0))
HOME = (0.0, 0.0)


class Robot:
    """A carrier that moves exactly as it commands."""

    def __init__(self, capacity=6000.0):
        self.carrier = Carrier("robot1", HOME, capacity, SETTINGS, 6.0, 100.0)
        self.x, self.y, self.yaw, self.time, self.tilt = 0.0, 0.0, 0.0, 0.0, 0.0
        self.battery, self.loaded, self.moves, self.fix = 1.0, False, True, None
        self.known = {name: np.zeros((120, 120)) for name in ("slope", "step", "roughness")}
        self.known["traversability"] = np.ones((120, 120))
        self.status, self.requests = None, []

    def step(self, inbox=()):
        action = self.carrier.step(Sense(self.time, self.x, self.y, self.yaw, self.tilt, self.battery, self.loaded,
                                         inbox, lambda: self.known, self.fix))
        self.time += 0.1
        if self.moves:
            self.yaw += 0.1 * action.angular
            self.x += 0.1 * action.linear * math.cos(self.yaw)
            self.y += 0.1 * action.linear * math.sin(self.yaw)
        if action.request:
            self.requests.append(action.request)
            self.loaded = action.request == "pick_up"
        for text in action.outbox:
            self.status = status_of(decode(text))
        return action

    def until(self, condition, limit=120.0, inbox=()):
        end = self.time + limit
        while not condition():
            assert self.time < end, self.carrier.stage
            self.step(inbox)

    def assign(self, parcel=PARCEL):
        self.step([encode(Board(self.time, (), {"robot1": parcel}).message())])


def test_it_brings_a_parcel_and_comes_home():
    robot = Robot()
    robot.assign()
    robot.until(lambda: robot.loaded)
    assert math.hypot(robot.x - 3.0, robot.y) < module.CLOSE
    robot.until(lambda: bool(robot.status.results))
    assert math.hypot(robot.x - 3.0, robot.y - 3.0) < module.CLOSE and robot.requests == ["pick_up", "put_down"]
    assert robot.status.results[0].result == "delivered"
    robot.until(lambda: math.hypot(robot.x, robot.y) < module.CLOSE)


def test_it_bids_less_for_what_is_nearer():
    robot, far = Robot(), Parcel("p2", (-5.0, 0.0), (-5.0, 4.0))
    robot.step([encode(Board(0.0, (PARCEL, far), {}).message())])
    assert 0.0 < robot.status.bids["p1"] < robot.status.bids["p2"]
    assert robot.status.bids["p1"] == pytest.approx(6.0 / module.MEAN_SPEED, rel=0.1)


def test_it_does_not_bid_for_what_its_battery_cannot_do():
    robot = Robot(capacity=500.0)
    robot.step([encode(Board(0.0, (PARCEL,), {}).message())])
    assert robot.status.bids == {}
    robot.time = 2.0
    robot.step()
    assert "of 500 J in the battery" in robot.status.results[0].reason


def test_a_walled_drop_off_is_told_while_bidding():
    robot = Robot()
    robot.known["traversability"][80:100, :] = 0.0
    robot.step([encode(Board(0.0, (PARCEL,), {}).message())])
    assert robot.status.bids == {}
    robot.time = 2.0
    robot.step()
    assert robot.status.results[0].reason == "no traversable way to its drop-off"


def test_what_turns_out_to_be_blocked_is_brought_back():
    robot = Robot()
    robot.assign()
    robot.until(lambda: robot.loaded)
    robot.known["traversability"][75:105, :] = 0.0
    robot.until(lambda: bool(robot.status.results), 200.0)
    assert robot.status.results[0].result == "returned" and "drop-off" in robot.status.results[0].reason
    assert math.hypot(robot.x, robot.y) < module.CLOSE


def test_it_charges_before_its_battery_is_flat_and_resumes():
    robot = Robot()
    robot.assign()
    robot.until(lambda: robot.loaded)
    robot.battery = 0.15
    robot.until(lambda: robot.carrier.stage == module.CHARGING)
    assert math.hypot(robot.x, robot.y) < module.CLOSE
    robot.battery = 1.0
    robot.until(lambda: bool(robot.status.results))
    assert robot.status.results[0].result == "delivered"


def test_a_robot_that_cannot_move_backs_away_and_then_gives_up():
    robot = Robot()
    robot.assign()
    robot.moves = False
    backwards = []
    robot.until(lambda: backwards.append(robot.step().linear < 0.0) or bool(robot.status.results), 300.0)
    assert any(backwards) and "stuck" in robot.status.results[0].reason


def test_wheels_that_slip_are_noticed_where_the_base_is_heard():
    robot = Robot()
    robot.assign()
    found = []
    for _ in range(120):
        robot.fix = (0.0, 0.0)          # the base sees it stand, its wheels turn
        found.append(robot.step().linear)
    assert min(found) < 0.0


def test_a_robot_that_tipped_over_tells_it():
    robot = Robot()
    robot.assign()
    robot.tilt = 1.5
    robot.until(lambda: bool(robot.status.results))
    assert "tipped over" in robot.status.results[0].reason and robot.status.stage == module.TIPPED
    assert robot.step().linear == 0.0


def test_a_parcel_that_is_not_there_is_told():
    robot = Robot()
    robot.assign()
    end = robot.time + 120.0
    while not (robot.status and robot.status.results) and robot.time < end:
        robot.step()
        robot.loaded = False
    assert robot.status.results[0].reason == "there is no parcel to load"


def test_a_parcel_that_was_given_to_another_robot_is_left():
    robot = Robot()
    robot.assign()
    robot.step([encode(Board(robot.time, (), {"robot2": PARCEL}).message())])
    assert robot.carrier.stage == module.WAITING


def test_it_waits_for_a_robot_ahead_whose_name_is_less():
    robot = Robot()
    robot.assign()
    other = robot.status._replace(robot="robot0", place=(0.8, 0.0), time=0.1)
    for _ in range(10):
        assert robot.step([encode(other.message())]).linear == 0.0
    later = robot.status._replace(robot="robot2", place=(0.8, 0.0), time=0.1)
    fresh = Robot()
    fresh.assign()
    assert any(fresh.step([encode(later.message())]).linear != 0.0 or fresh.yaw for _ in range(10))


def test_rubbish_by_radio_is_refused_and_told():
    robot = Robot()
    robot.step(["{", '{"kind": "board"}', "[]"])
    assert len(robot.carrier.rejected) == 3 and robot.carrier.stage == module.WAITING
