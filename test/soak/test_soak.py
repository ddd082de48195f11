# SPDX-License-Identifier: BSD-3-Clause
"""The measurements of a soak run detect faults; a short run works from start to figure."""
import json
import os
import re
import struct
import subprocess
import sys

import numpy as np
import pytest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

import slopes  # noqa: E402
from watch import Clock, Sample, Stamps, look_at  # noqa: E402

SHIFT = 900.0


def samples_of(hours, leak, noise=0.3, per_shift=40):
    """Samples of a process that grows by 30 MB in each shift and leaks ``leak`` [MB/h] over all shifts."""
    rng, found = np.random.default_rng(1), []
    for shift in range(int(hours * 3600.0 / SHIFT)):
        for k in range(per_shift):
            age = SHIFT * (k + 0.5) / per_shift
            at = (shift * SHIFT + age) / 3600.0
            begin = 20.0 * np.exp(-at)          # what is loaded when it is first needed
            found.append(Sample(at, shift, age, 200.0 - begin + 30.0 * age / SHIFT + leak * at + noise * rng.normal(),
                                40, 12 + (shift % 2)))
    return found


@pytest.mark.parametrize("leak", [0.0, 0.2, 1.0, -0.5])
def test_a_leak_is_separated_from_periodic_use(leak):
    hours, values = slopes.levels(samples_of(24.0, leak), "memory", SHIFT)
    slope, low, high = slopes.slope(hours, values)
    assert len(hours) > 75 and low <= slope <= high
    assert abs(slope - leak) < 0.02


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("leak", [0.0, 0.4])
def test_large_maps_neither_hide_nor_imitate_a_leak(leak, seed):
    """Of one map to the next the measured levels differ by 2.5 MB (standard deviation); the limit is 0.2 MB/h."""
    differing = np.random.default_rng(seed).normal(0.0, 2.5, 100)
    samples = [sample._replace(memory=sample.memory + differing[sample.shift]) for sample in samples_of(24.0, leak)]
    slope = slopes.slope(*slopes.levels(samples, "memory", SHIFT))[0]
    assert (slope > 0.2) == (leak > 0.2)


def test_alternating_descriptors_and_threads_have_no_slope():
    samples = samples_of(24.0, 0.0)
    for name in ("descriptors", "threads"):
        assert slopes.slope(*slopes.levels(samples, name, SHIFT))[0] == 0.0


def test_of_a_few_shifts_nothing_is_said():
    with pytest.raises(ValueError, match="expected at least"):
        slopes.slope(*slopes.levels(samples_of(1.25, 0.0), "memory", SHIFT))


def stamp(seconds):
    return struct.pack("<III", 7, int(seconds), int(round(seconds % 1.0 * 1e9)))


def test_gaps_repeats_and_restarts_of_stamps_are_counted():
    stamps = Stamps(0.4, 4)
    for seconds in (0.4, 0.8, 1.2, 2.0, 2.0, 2.4, 0.0, 0.4):
        stamps.take(stamp(seconds))
    assert (stamps.count, stamps.gaps, stamps.repeats, stamps.beginnings) == (8, 1, 1, 1)
    assert stamps.widest == pytest.approx(0.8)


def test_the_clock_adds_up_over_resets_of_time():
    clock = Clock()
    for seconds in (1.0, 2.0, 5.0, 0.5, 1.5):
        clock.take(stamp(seconds)[4:])
    assert (clock.total, clock.now, clock.shift) == (6.5, 1.5, 1)


def test_a_process_is_measured_and_a_missing_one_reported():
    memory, descriptors, threads = look_at(os.getpid())
    assert 1.0 < memory < 4000.0 and descriptors >= 3 and threads >= 1
    child = subprocess.Popen(["true"])
    child.wait()
    with pytest.raises(ProcessLookupError):
        look_at(child.pid)


@pytest.mark.timeout(900)
def test_some_minutes_of_a_soak_run(tmp_path):
    done = subprocess.run([sys.executable, os.path.join(HERE, "soak.py"), "--hours", "0.1", "--factor", "20",
                           "--no-bounds", "--out", str(tmp_path)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=840)
    said = done.stdout.decode()
    assert done.returncode == 0, said
    assert (tmp_path / "soak.png").stat().st_size > 10000
    seen = json.loads((tmp_path / "soak.json").read_text())
    assert seen["shifts"] == 1 and seen["done"]["spawn and delete"] == 21 and seen["done"]["ask"] == 42
    assert seen["stamps"]["/scan"]["count"] > 300
    assert len(seen["samples"]["mapper"]) > 5           # how many depends on how busy the machine is
    shares = [int(number) for number in re.findall(r"^ *(\d+) %: ", said, re.MULTILINE)]
    assert shares == sorted(set(shares)) and shares[-1] >= 75, said        # a busy machine skips some
    assert not [line for line in said.splitlines() if line.startswith("FAILED")], said
