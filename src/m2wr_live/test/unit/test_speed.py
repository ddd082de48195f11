# SPDX-License-Identifier: BSD-3-Clause
"""The list with real-time factors shows that of the simulation."""
import math
import types

import pytest

from m2wr_live.web.speed import NOT_KNOWN, OFFERED, UNLIMITED, SpeedList, options_with, words_of


class Page:
    """A panel with one list."""

    def add_dropdown(self, _, options, initial_value):
        self.options, self.value = tuple(options), initial_value
        assert initial_value in options
        return self

    def on_update(self, react):
        self.react = react

    def choose(self, words, client="page"):
        self.value = words
        self.react(types.SimpleNamespace(client=client))


class Simulation:
    """A simulation whose real-time factor can be set."""

    def __init__(self, factor):
        self.now = factor

    def factor(self):
        return self.now

    def set_factor(self, factor):
        self.now = factor


def made(factor):
    page, simulation = Page(), Simulation(factor)
    return page, simulation, SpeedList(page, simulation, lambda action: action())


@pytest.mark.parametrize("factor, words", [(1.0, "1"), (0.5, "0.5"), (0.0, UNLIMITED), (0.3, "0.3"), (None, NOT_KNOWN),
                                           (math.nan, NOT_KNOWN), (0.1 * 10.0, "1")])
def test_the_list_begins_with_the_factor_of_the_simulation(factor, words):
    page, _, _ = made(factor)
    assert page.value == words == words_of(factor)
    assert set(map(words_of, OFFERED)) <= set(page.options)


def test_a_factor_that_is_not_offered_has_its_place_in_the_list():
    assert options_with(0.3)[1:4] == ["0.25", "0.3", "0.5"]


def test_a_choice_sets_the_factor():
    page, simulation, _ = made(1.0)
    page.choose("2")
    assert simulation.now == 2.0
    page.choose(UNLIMITED)
    assert simulation.now == 0.0


def test_a_factor_of_another_page_is_shown_and_not_set_again():
    page, simulation, shown = made(1.0)
    simulation.now = 7.0
    shown.show()
    assert (page.value, "7" in page.options) == ("7", True)
    page.choose("2", client=None)
    assert simulation.now == 7.0


def test_a_factor_that_is_known_late_is_shown():
    page, simulation, shown = made(None)
    shown.show()
    assert page.value == NOT_KNOWN
    simulation.now = 0.5
    shown.show()
    assert page.value == "0.5"
