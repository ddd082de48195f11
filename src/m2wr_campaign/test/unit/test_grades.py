# SPDX-License-Identifier: BSD-3-Clause
"""The table of grades has one row a submission, the best first."""
import csv
import io

from m2wr_campaign.grading.grades import as_csv, as_text, grades


def row(method, outcome, success=0, **values):
    return dict({"method": method, "outcome": outcome, "success": success, "reason": "", "contacts": 0, "time": None,
                 "ratio": None, "clearance": None}, **values)


ROWS = [row("ann", "failed", reason="the program ended"), row("bob", "reached", 1, time=10.0, ratio=1.5, clearance=0.2),
        row("bob", "reached", 0, time=10.0, ratio=1.1, contacts=2, clearance=0.0),
        row("=eve", "reached", 1, time=20.0, ratio=1.2, clearance=0.3), row("=eve", "reached", 1, time=30.0, ratio=1.4)]


def test_the_best_is_first_and_means_are_of_successes():
    eve, bob, ann = grades(ROWS)
    assert (eve.submission, eve.success, eve.runs, eve.time, eve.clearance) == ("=eve", 2, 2, 25.0, 0.3)
    assert (bob.success, bob.ratio, bob.contacts, bob.clearance, bob.reason) == (1, 1.5, 2, 0.0, "contacts on the way")
    assert (ann.share, ann.time, ann.reason) == (0.0, None, "the program ended")


def test_the_text_has_a_line_for_each():
    lines = as_text(grades(ROWS)).splitlines()
    assert lines[0].split()[0] == "submission" and lines[3].startswith("ann         0 of 1")


def test_a_spreadsheet_reads_no_formula_in_a_name():
    rows = list(csv.DictReader(io.StringIO(as_csv(grades(ROWS)))))
    assert [one["submission"] for one in rows] == ["'=eve", "bob", "ann"] and rows[1]["ratio"] == "1.5"
