# SPDX-License-Identifier: BSD-3-Clause
"""The page of a study needs no network, names every failure with its picture, and is well-formed."""
from html.parser import HTMLParser

import numpy as np
import pytest

from m2wr_campaign.report import command, page
from m2wr_campaign.report.pictures import chart
from m2wr_campaign.store.result_file import ResultFile, packed_path
from m2wr_campaign.study.factors import StudyWorld
from m2wr_campaign.worlds.generators import generate

VOID = {"meta", "br"}


class Elements(HTMLParser):
    """Counts elements and checks that each is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.found, self.told = [], [], ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag not in VOID and not self.get_starttag_text().endswith("/>"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.get_starttag_text().endswith("/>") or self.open[-1:] == [tag]:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.told += data

    def count(self, tag):
        return sum(found == tag for found, _ in self.found)


def row(key, method, world, **more):
    path = packed_path(np.array([(0.0, 0.5), (1.0, 2.0), (9.0, 2.0)]))
    return dict({"key": key, "world": world, "robot": "m2wr", "method": method, "parameters": "{}", "noise": None,
                 "fault": "",
                 "repeat": 0, "seed": 7, "status": "done", "outcome": "reached", "reason": "", "success": 1,
                 "length": 2.5, "ratio": 1.2, "time": 5.0, "clearance": 0.1, "contacts": 0, "turning": 1.0,
                 "cpu_ms": 0.2, "optimum": 2.0 if world == "v" else 3.0, "openness": 1.0, "tortuosity": 1.0,
                 "path": path, "log": "", "versions": "{}", "finished": "2026-01-01"}, **more)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    path = str(tmp_path_factory.mktemp("report") / "one.sqlite")
    text, (start, goal) = generate("maze", {"cells": 2, "width": 1.8, "opened": 0.0}, 0, 0, 0.45)
    failed = {"status": "failed", "outcome": "failed", "success": 0, "ratio": None, "time": None, "optimum": None}
    with ResultFile(path, writing=True) as found:
        found.add_worlds([StudyWorld(key, "maze 0", "maze", (("cells", cells),), 0, text, text, start, goal, key)
                          for key, cells in (("w", 2), ("v", 3))])
        found.begin("<one>", "study: <one>", list("abcdefghi"))
        for key, method, world, more in (
                ("a", "bug2", "w", {}), ("b", "bug2", "v", {}), ("c", "<i>", "w", {}),
                ("d", "<i>", "v", {"success": 0, "contacts": 2}),
                ("e", "dwa", "w", dict(failed, reason="no <result>", log="Traceback <b>", path=None)),
                ("f", "dwa", "v", dict(failed, reason="command (nan, 0.0)"))):
            found.add(row(key, method, world, **more))
    return path


def test_the_page_is_whole_and_needs_no_network(results, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert command.main([results, "--out", str(out)]) == 0 and capsys.readouterr().out == "the page is {}\n".format(out)
    text = out.read_text(encoding="utf-8")
    elements = Elements(text)
    assert "http" not in text and "src=" not in text and "<i>" not in text and "<one>" not in text
    ids = {attributes["id"] for _, attributes in elements.found if "id" in attributes}
    used = [attributes["href"] for tag, attributes in elements.found if tag == "use"]
    assert len(used) == 3 * 3 + 3 and {name[1:] for name in used} == ids == {"w0", "w1"}
    assert "3 of its 9 runs are not done yet" in elements.told and "2 gave no result" in elements.told
    assert "bug2" in elements.told and "2 of 2" in elements.told and "study: <one>" in elements.told
    assert "maze 0 cells 2, run 0: failed. no <result>" in elements.told and "Traceback <b>" in elements.told
    assert "maze 0 cells 3, run 0: reached after 5 s, 2 contacts" in elements.told


def test_every_failure_has_a_picture_and_many_are_kept_closed(results, monkeypatch):
    monkeypatch.setattr(page, "OPENED", 1)
    with ResultFile(results) as found:
        text = page.study_page(found)
        elements = Elements(text)
        assert elements.count("template") == 3 and elements.count("figure") == 3 * 3 + 3
        assert "dwa: 2 of 2 runs (2 failed), 2 to 2" in elements.told
        monkeypatch.setattr(page, "MOST_FAILURES", 2)
        less = Elements(page.study_page(found))
    assert less.count("figure") == 3 * 3 + 2 and "The other 1 are not drawn" in less.told


def test_a_path_outside_of_the_world_is_seen_whole(results):
    with ResultFile(results) as found:
        elements = Elements(page.study_page(found))
    views = [list(map(float, attributes["viewbox"].split())) for tag, attributes in elements.found
             if tag == "svg" and attributes.get("aria-label") == "path of bug2 in maze 0 cells 2"]
    assert views and all(view[0] + view[2] > 9.0 for view in views)


def test_a_chart_has_a_mark_with_its_interval_for_each_bin():
    elements = Elements(chart([(1.0, 0, 10), (3.0, 10, 10)], (0.0, 4.0), "one"))
    marks = [attributes for tag, attributes in elements.found if tag == "circle"]
    bars = [attributes for tag, attributes in elements.found if attributes.get("class") == "bar"]
    assert len(marks) == len(bars) == 2 and float(marks[0]["cy"]) > float(marks[1]["cy"])
    assert float(marks[0]["cx"]) < float(marks[1]["cx"])
    assert float(bars[0]["y1"]) == float(marks[0]["cy"]) > float(bars[0]["y2"])


@pytest.mark.parametrize("words, told", [(["none.sqlite"], "none.sqlite: there is no such file"),
                                         (["none.sqlite", "--out", "no/page.html"], "there is no such folder")])
def test_what_cannot_be_read_or_written_is_told(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    assert command.main(words) == 1
    error = capsys.readouterr().err
    assert told in error and error.startswith("report: ") and error.count("\n") == 1


def test_a_study_without_runs_has_a_page(tmp_path):
    with ResultFile(str(tmp_path / "empty.sqlite"), writing=True) as results:
        results.begin("none", "study: none", ["a"])
        assert "1 of its 1 runs are not done yet" in page.study_page(results)
