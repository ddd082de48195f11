# SPDX-License-Identifier: BSD-3-Clause
"""The harness detects all kinds of faults, and its findings can be repeated and reduced."""
import logging
import os
import pickle
import sys
import time

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import command  # noqa: E402
import harness  # noqa: E402
import mutations  # noqa: E402
from case_files import CaseError, read_case, write_case  # noqa: E402
from harness import Finding, Target, Wrong, minimise, repeat, run_cases  # noqa: E402

LOG = logging.getLogger("m2wr_fuzz_test")


class Foreseen(Exception):
    """The exception defined for bad input."""


def hold_memory():
    return len(b"x" * (400 << 20))


def spin():
    while True:
        pass


def spend():
    end = time.process_time() + 2.0 * Trap.cpu
    while time.process_time() < end:
        pass


def log_unforeseen(error):
    try:
        raise error
    except Exception:
        LOG.exception("it failed, but continued")


class Trap(Target):
    """Performs the fault of the letter in its case; other cases do nothing."""

    name, cpu, memory, foreseen = "trap", 0.5, 100 << 20, (Foreseen,)
    letter = ""

    def make(self, rng):
        return "".join(rng.choice("abc") for _ in range(12)) + (self.letter if rng.randrange(4) == 0 else "")

    def run(self, case):
        deeds = {"X": lambda: {}["gone"], "W": self.complain, "A": os.abort, "H": spin, "S": spend, "M": hold_memory,
                 "E": lambda: sys.exit(0), "Q": lambda: os._exit(7), "L": lambda: log_unforeseen(KeyError("odd")),
                 "F": lambda: log_unforeseen(Foreseen("bad input")), "P": lambda: LOG.warning("%d", "no number")}
        for letter, deed in deeds.items():
            if letter in case:
                deed()

    @staticmethod
    def complain():
        raise Wrong("speed is 3.5e9 m/s")


def found_with(letter, count=12):
    """Findings and tally of some cases; about every fourth has the letter."""
    target = Trap()
    target.letter = letter
    *findings, tally = run_cases(target, 1, range(count))
    return target, findings, tally


@pytest.mark.parametrize("letter, kind, words", [
    ("X", "exception", "KeyError"), ("W", "wrong", "speed is N m/s"), ("A", "died", "SIGABRT"), ("S", "slow", ""),
    ("M", "memory", ""), ("E", "exception", "SystemExit"), ("Q", "died", "exit code 7"),
    ("L", "exception", "logged KeyError"), ("P", "exception", "TypeError"), ("H", "stuck", "")])
def test_each_fault_is_found_once_and_all_cases_run(letter, kind, words):
    target, findings, tally = found_with(letter)
    finding, = findings
    assert (finding.kind, tally.cases) == (kind, 12) and words in finding.signature
    cases = [target.make(mutations.generator(1, "trap", number)) for number in range(12)]
    faulty = [number for number in range(12) if letter in cases[number]]
    assert faulty and finding.number == faulty[0]
    if kind != "memory":                # a peak rises once
        assert finding.count == len(faulty)


@pytest.mark.parametrize("letter", ["", "F"])
def test_what_is_foreseen_is_no_finding(letter):
    _, findings, tally = found_with(letter, 100)
    assert not findings and tally.cases == 100


def test_a_finding_is_repeated_by_its_number_and_reduced():
    target, findings, _ = found_with("A")
    case = target.make(mutations.generator(1, "trap", findings[0].number))
    again = repeat(target, case)
    assert isinstance(again, Finding) and again.signature == findings[0].signature
    assert minimise(target, case, again.signature) == "A"
    assert repeat(target, "abc") is None


def test_the_command_prints_how_to_repeat_and_keeps_the_case(monkeypatch, tmp_path, capsys):
    Trap.letter = "X"
    monkeypatch.setattr(command, "make_target", lambda _: Trap())
    try:
        assert command.main(["--target", "urdf", "--cases", "12", "--seed", "1", "--out", str(tmp_path)]) == 1
        said = capsys.readouterr().out
        number = said.split("--case ")[1].split()[0]
        assert "--target trap --seed 1 --case " + number in said and "1 findings" in said
        path = tmp_path / ("trap-1-%s.case" % number)
        assert read_case(str(path)) == "X"
        assert command.main(["--target", "urdf", "--seed", "1", "--case", number]) == 1
        assert command.main(["--target", "urdf", "--file", str(path)]) == 1
        assert "KeyError" in capsys.readouterr().out
    finally:
        Trap.letter = ""


def test_a_restarted_target_loses_no_case(monkeypatch):
    class Fragile(Trap):
        def run(self, case):
            self.broken = True

    *findings, tally = run_cases(Fragile(), 1, range(5))
    assert not findings and tally.cases == 5


def test_an_error_in_a_library_is_reported_at_our_innermost_line():
    try:
        mutations.generator(1, "x", "no number")
    except TypeError as error:
        assert harness.signature_of(error) == "TypeError at outside"


def test_a_case_in_a_file_is_the_same_case(tmp_path):
    path = str(tmp_path / "a.case")
    for case in ("<a>\ud800\u00e9</a>", b"\0\xff", [("service", "x", 2 ** 32), ("step", 0, 0)], ("stl", b""),
                 [("a", {1: 2, "b": [None, True, -0.0, 1e308, 2 ** 70]})], [("x", -float("inf"))]):
        write_case(path, case)
        assert read_case(path) == case and repr(read_case(path)) == repr(case)
    write_case(path, [("x", float("nan"))])
    assert repr(read_case(path)) == "[('x', nan)]"


class Deed:
    def __reduce__(self):
        return os.system, ("mkdir pickles_run_code",)


@pytest.mark.parametrize("data", [
    pickle.dumps(Deed()), b"", b"{", b'{"bytes": 1}', b'{"bytes": "*"}', b'{"tuple": 3}', b'{"dict": [1]}',
    b'{"float": "x"}', b'{"dict": [[[], 1]]}', b'{"a": 1, "b": 2}', b"{}", b"[" * 100000, b'{"__class__": "x"}'],
    ids=lambda data: "%d bytes" % len(data))
def test_a_file_without_a_case_is_refused(data, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.case"
    path.write_bytes(data)
    with pytest.raises(CaseError, match="a.case"):
        read_case(str(path))
    with pytest.raises(SystemExit, match="expected a case"):
        command.main(["--target", "parameters", "--file", str(path)])
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.case"]


def test_a_case_cannot_name_a_file_outside_of_the_scratch_folder():
    from target_files import written
    with pytest.raises(ValueError, match="without folders"):
        written("case./../../x", b"")
