# SPDX-License-Identifier: BSD-3-Clause
"""A program that answers each scan gets the time that it needs; a loop of its own is not waited for."""
import itertools

from m2wr_campaign.programs.patience import ANSWER, OTHERWISE, Patience


def waited(answers):
    """Return how long the simulation waits for each of some answers [s]."""
    patience, waits = Patience(), []
    for number, answered in enumerate(answers):
        waits.append(patience.seconds(number > 0))
        patience.note(answered)
    return waits


def test_a_program_that_answers_is_waited_for():
    waits = waited([True] * 50)
    assert waits[0] == OTHERWISE and set(waits[1:]) == {ANSWER}


def test_one_late_answer_changes_nothing():
    assert set(waited([True] * 30 + [False] + [True] * 30)[1:]) == {ANSWER}


def test_a_loop_of_half_the_rate_costs_little():
    answers = list(itertools.islice(itertools.cycle([True, False]), 200))
    assert sum(wait for wait, answered in zip(waited(answers), answers) if not answered) < 5.0


def test_a_program_that_was_stopped_is_trusted_again():
    waits = waited([True] * 10 + [False] * 40 + [True] * 30)
    assert waits[45] == OTHERWISE and waits[-1] == ANSWER
