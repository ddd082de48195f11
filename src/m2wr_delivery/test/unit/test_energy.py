# SPDX-License-Identifier: BSD-3-Clause
"""The energy model against its closed form, and a battery that can be neither overfull nor below zero."""
import math

import pytest

from m2wr_delivery.energy import GRAVITY, Battery, EnergyModel


def test_power_is_electronics_and_work_over_efficiency():
    model = EnergyModel(electronics=10.0, rolling=0.1, efficiency=0.5, mass=5.0, turning=2.0)
    assert model.power(0.0) == 10.0
    assert model.power(0.4) == pytest.approx(10.0 + 5.0 * GRAVITY * 0.1 * 0.4 / 0.5)
    assert model.power(0.4, climb=0.1) == pytest.approx(10.0 + 5.0 * GRAVITY * (0.1 * 0.4 + 0.1) / 0.5)
    assert model.power(0.0, yaw_rate=-1.0) == pytest.approx(14.0)


def test_going_down_gives_nothing_back():
    assert EnergyModel().power(0.3, climb=-1.0) == EnergyModel().electronics


def test_the_energy_for_a_way_is_power_times_time():
    model = EnergyModel()
    assert model.for_way(6.0, 0.2) == pytest.approx(30.0 * model.power(0.2))


def test_a_battery_is_never_below_zero_or_overfull():
    battery = Battery(100.0)
    battery.take(30.0)
    battery.charge(1000.0)
    assert (battery.level, battery.used, battery.charged) == (100.0, 30.0, 30.0)
    battery.take(1000.0)
    assert battery.flat and battery.share == 0.0 and battery.used == 130.0


@pytest.mark.parametrize("capacity", [0.0, -1.0, math.nan, math.inf])
def test_a_capacity_that_is_none_is_refused(capacity):
    with pytest.raises(ValueError, match="capacity"):
        Battery(capacity)


@pytest.mark.parametrize("wrong", [{"mass": -1.0}, {"rolling": math.nan}, {"efficiency": 0.0}, {"efficiency": 1.5}])
def test_wrong_constants_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        EnergyModel(**wrong)
