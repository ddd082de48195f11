# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 9: a rule that makes a short exploration is done, others are told why not."""
import pytest

from course_checks import check
from m2wr_course import explorations
from m2wr_course.command import main
from m2wr_exploration.study.run import Exploration


def test_the_nearest_frontier_makes_a_short_exploration(tmp_path, capsys):
    (tmp_path / "mine.py").write_text("def choose(paths, sizes):\n    return paths.index(min(paths))\n")
    code, said = check(9, tmp_path / "mine.py", capsys)
    assert code == 0 and "ok       its path is" in said.out, said.out


def test_exercise_9_explores_with_the_noise_of_the_seed(tmp_path, capsys, monkeypatch):
    used = []

    def explore(*given, **_):
        used.append(given[4])
        return Exploration(1.0, 100.0, 70.0, 200.0, 0, "", 9, None, None, [], None)

    monkeypatch.setattr(explorations, "explore", explore)
    (tmp_path / "mine.py").write_text("def choose(paths, sizes):\n    return 0\n")
    assert main(["9", str(tmp_path / "mine.py")]) == main(["9", str(tmp_path / "mine.py"), "--seed", "4"]) == 0
    assert used == [explorations.SEED, 4] and "exercise 9: done" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["9", "x.py", "--seed", "-1"], ["4", "x.py", "--seed", "1"]])
def test_a_seed_that_is_of_no_use_is_refused(words, capsys):
    with pytest.raises(SystemExit):
        main(words)
    assert "expected 0 or more, and exercise 9" in capsys.readouterr().err


@pytest.mark.parametrize("body, words", [
    ("return paths[0]", "it answers 3.0; expected a whole number from 0 to 0"),
    ("return len(paths)", "it answers 1; expected a whole number from 0 to 0"),
    ("return None", "it answers None; expected"),
    ("return paths.index(5.0)", "one frontier: it raises ValueError")])
def test_a_rule_that_names_no_frontier_does_not_explore(tmp_path, capsys, body, words):
    (tmp_path / "mine.py").write_text("def choose(paths, sizes):\n    %s\n" % body)
    code, said = check(9, tmp_path / "mine.py", capsys)
    assert code == 1 and words in said.out and "path is" not in said.out


def test_a_rule_that_fails_while_it_explores_is_told(tmp_path, capsys):
    (tmp_path / "mine.py").write_text("asked = []\n\n\ndef choose(paths, sizes):\n    asked.append(len(paths))\n"
                                      "    return 0 if len(asked) < 8 else -1\n")
    code, said = check(9, tmp_path / "mine.py", capsys)
    assert code == 1 and "while it explores, it answers -1" in said.out
