# SPDX-License-Identifier: BSD-3-Clause
"""Saved states: a resumed run equals an uninterrupted one; invalid files are refused."""
import io
import json
import os
import resource
import signal
import zipfile

import numpy as np
import pytest

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.io import state
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import between, compose


class Ride:
    """A drive round the ring whose mapper can be exchanged on the way."""

    def __init__(self, ring, laser, **parameters):
        values = dict(particles=6, linearUpdate=0.5, angularUpdate=0.3, xmin=-10.0, ymin=-10.0, xmax=10.0, ymax=10.0)
        values.update(parameters)
        self.ring, self.laser = ring, laser
        self.mapper = Mapper(GmappingConfig.from_mapping(values), laser)
        self.truth = drive(1.2)
        self.odom = odometry(self.truth, np.random.default_rng(5))

    def go(self, first, last, shift=None):
        """Process scans; ``shift`` (3,) moves the odometry, as if it had begun elsewhere."""
        for k in range(first, last):
            ranges = self.ring.ranges(self.truth[k], self.laser.angles)
            at = self.odom[k] if shift is None else compose(shift, self.odom[k])
            self.mapper.process(self.mapper.reading(ranges), at, 0.1 * k)
            if k % 25 == 0:
                self.mapper.occupancy(exact=False)
        return self

    def saved(self, path, host=None):
        """Save and load a state; returns the State."""
        state.save(path, state.snapshot(self.mapper, host))
        self.mapper.close()
        found = state.load(path)
        self.mapper = found.mapper
        return found

    def result(self):
        """Path, map and numbers at the end."""
        self.mapper.finish()
        stamps, poses = self.mapper.trajectory()
        grid = self.mapper.occupancy(exact=False)
        found = (stamps.tobytes(), poses.tobytes(), grid.data.tobytes(), grid.origin.tobytes(), self.mapper.info(),
                 self.mapper.filter.resamplings, self.mapper.filter.normals().tobytes())
        self.mapper.close()
        return found


LAST = 200


@pytest.fixture(scope="module")
def path(tmp_path_factory, ring, laser):
    """A state file of a short ride."""
    name = str(tmp_path_factory.mktemp("state") / "good.state")
    ride = Ride(ring, laser).go(0, 30)
    ride.saved(name)
    ride.mapper.close()
    return name


@pytest.mark.parametrize("parameters", [{}, {"compatible": True, "particles": 3}, {"resampleThreshold": 1.0},
                                        {"min_particles": 1}, {"loop_closing": False, "track_between": False}], ids=str)
def test_resumed_run_equals_an_uninterrupted_run(tmp_path, ring, laser, parameters):
    without = Ride(ring, laser, **parameters).go(0, LAST).result()
    ride, done = Ride(ring, laser, **parameters), 0
    for stop in (1, 60, 61, 170):           # after the first scan, on the way, at once again, after loops were closed
        ride.go(done, stop)
        assert ride.saved(str(tmp_path / "a.state"), {"note": stop}).host == {"note": stop}
        done = stop
    assert ride.go(done, LAST).result() == without


def test_state_file_is_small(path):
    with open(path, "rb") as stream:
        assert len(stream.read()) < 300000          # some metres of corridor, not 400 x 400 cells of 9 bytes


def test_parameters_of_the_running_program_are_kept(path):
    live = GmappingConfig.from_mapping({"map_frame": "plan", "threads": 2, "particles": 99, "delta": 0.05})
    found = state.load(path, live)
    assert (found.mapper.config["map_frame"], found.mapper.config["threads"]) == ("plan", 2)
    assert found.mapper.config["particles"] == 6 and len(found.mapper.filter.poses) == 6
    assert "particles" in found.differing and "delta" not in found.differing and "map_frame" not in found.differing
    found.mapper.close()


def test_reset_odometry_continues_at_the_last_pose(tmp_path, ring, laser):
    for told, runs_on, shift, later in (
            (True, False, (30.0, -4.0, 1.0), 0.0), (True, True, (500.0, 0.0, 0.0), 0.0),        # told, and too fast
            (True, True, (3.0, -4.0, 1.0), 1e5), (False, True, (0.0, 0.0, 0.0), 1e5)):          # found by the scan
        ride = Ride(ring, laser).go(0, 100)
        before, found = ride.mapper.pose, ride.saved(str(tmp_path / "a.state"))
        reading = found.mapper.reading(ring.ranges(ride.truth[100], laser.angles))
        said = state.connect_odometry(found.mapper, reading, compose(shift, ride.odom[100]), 10.0 + later, runs_on)
        assert bool(said) == told
        ride.go(100, 140, shift)
        apart = between(between(ride.truth[99], ride.truth[139]), between(before, found.mapper.pose))
        assert np.hypot(apart[0], apart[1]) < 0.3 and abs(apart[2]) < 0.1
        ride.mapper.close()


def test_distant_odometry_is_accepted_if_the_scan_agrees(tmp_path, ring, laser):
    ride = Ride(ring, laser).go(0, 240)                 # once round: the whole ring is known
    found = ride.saved(str(tmp_path / "a.state"))
    led = between(ride.truth[239], ride.truth[40])
    reading = found.mapper.reading(ring.ranges(ride.truth[40], laser.angles))
    assert np.hypot(led[0], led[1]) > 3.0
    assert state.connect_odometry(found.mapper, reading, compose(ride.odom[239], led), 1e5) is None
    found.mapper.close()


def test_odometry_that_leads_off_the_map_is_accepted(tmp_path, ring, laser):
    """Where the map ends no scan fits; that it fits a little at the last pose is no reason to go back there."""
    ride = Ride(ring, laser).go(0, 60)
    found = ride.saved(str(tmp_path / "a.state"))
    ranges = ring.ranges(ride.truth[59], laser.angles)
    ranges[len(ranges) // 3:] = np.random.default_rng(1).uniform(0.3, 0.8, len(ranges) - len(ranges) // 3)
    reading = found.mapper.reading(ranges)
    assert state.connect_odometry(found.mapper, reading, compose(ride.odom[59], (50.0, 0.0, 0.0)), 1e5) is None
    found.mapper.close()


def test_odometry_older_than_the_state_is_a_reset(path, laser):
    mapper = state.load(path).mapper
    nothing = laser.reading(np.full(181, np.nan))
    assert state.connect_odometry(mapper, nothing, mapper.odometry + [0.1, 0.0, 0.0], -5.0) is not None
    mapper.close()


# ---- files that are none

def spoilt(path, tmp_path, change):
    """Return a file with other bytes."""
    with open(path, "rb") as stream:
        content = change(stream.read())
    name = tmp_path / "spoilt.state"
    name.write_bytes(content)
    return str(name)


def another_document(content, **values):
    """Return the file with other values at the top of its JSON."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for info in old.infolist():
            data = old.read(info)
            if info.filename == "state.json":
                data = json.dumps(dict(json.loads(data.decode()), **values)).encode()
            new.writestr(info.filename, data)
    return out.getvalue()


def with_array(content, name, array):
    """Return the file with another array."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for info in old.infolist():
            data = io.BytesIO(old.read(info))
            if info.filename == name + ".npy":
                data = io.BytesIO()
                np.save(data, array)
            new.writestr(info.filename, data.getvalue())
    return out.getvalue()


@pytest.mark.parametrize("change, words", [
    (lambda content: b"", "expected a state"), (lambda content: b"P5\n" + content, "expected a state"),
    (lambda content: content[:25], "damaged or cut off"), (lambda content: content[:len(content) // 2], "cut off"),
    (lambda content: content[:-1], "cut off"), (lambda content: content + b"x", "cut off"),
    (lambda content: content[:-9] + b"123456789", "damaged"),
    (lambda content: content[:5000] + b"123456789" + content[5009:], "damaged"),
    (lambda content: another_document(content, version=99), "version 99; this program reads version 16"),
    (lambda content: another_document(content, format="other"), "expected a state"),
    (lambda content: another_document(content, config=[]), "config"),
    (lambda content: another_document(content, config={"particles": 10**9}), "particles is 1000000000; expected 1 to"),
    (lambda content: another_document(content, values={}), "it has no laser.reverse"),
    (lambda content: with_array(content, "laser.angles", np.zeros(0)), "0 beams; expected 1 to"),
    (lambda content: another_document(content, host={"laser_frame": [1]}), "laser_frame")])
def test_invalid_state_file_names_the_reason(path, tmp_path, change, words):
    with pytest.raises(state.StateError, match=words) as caught:
        state.load(spoilt(path, tmp_path, change))
    assert "spoilt.state" in str(caught.value)


def test_missing_state_file_is_named(tmp_path):
    with pytest.raises(state.StateError, match="none.state: No such file"):
        state.load(str(tmp_path / "none.state"))


def test_non_regular_file_is_refused(tmp_path):
    os.mkfifo(str(tmp_path / "pipe"))
    for name in (str(tmp_path / "pipe"), "/dev/zero"):
        with pytest.raises(state.StateError, match="no regular file"):
            state.load(name)


def test_numpy_opens_a_state_without_pickles(path):
    with np.load(path, allow_pickle=False) as arrays:
        assert arrays["filter.poses"].shape == (6, 3)


def test_undeclared_attribute_is_an_error(ring, laser):
    ride = Ride(ring, laser).go(0, 5)
    ride.mapper.filter.tree.news = 1
    with pytest.raises(state.StateError, match="TrajectoryTree has other attributes than this program stores: news"):
        state.snapshot(ride.mapper)
    ride.mapper.close()


# ---- disks

@pytest.fixture
def full_disk():
    """No file may grow beyond 1000 bytes."""
    limit, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    signal.signal(signal.SIGXFSZ, handler)


def test_full_disk_keeps_the_old_state(path, tmp_path, full_disk):
    name = tmp_path / "a.state"
    name.write_bytes(b"old")
    with pytest.raises(state.StateError, match="is kept"):
        state.save(str(name), state.Snapshot({}, {"noise": np.random.default_rng(1).integers(0, 256, 50000, np.uint8)}))
    assert name.read_bytes() == b"old" and [entry.name for entry in tmp_path.iterdir()] == ["a.state"]


def test_missing_folder_is_an_error(tmp_path):
    with pytest.raises(state.StateError, match="nowhere"):
        state.save(str(tmp_path / "nowhere" / "a.state"), state.Snapshot({}, {}))


def test_no_state_before_the_first_scan(laser):
    mapper = Mapper(GmappingConfig.from_mapping(), laser)
    with pytest.raises(state.StateError, match="no state to save"):
        state.snapshot(mapper)
    mapper.close()
