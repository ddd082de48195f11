# SPDX-License-Identifier: BSD-3-Clause
"""State files made to do harm: none runs code, reaches outside an array, or takes more memory than is told."""
import hashlib
import io
import json
import os
import pickletools
import zipfile
import zlib

import numpy as np
import pytest

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.io import state
from m2wr_gmapping.mapper import Mapper


@pytest.fixture(scope="module")
def good(tmp_path_factory, ring, laser):
    """A state file after a lap, with loops closed."""
    config = GmappingConfig.from_mapping(dict(
        particles=4, linearUpdate=0.5, angularUpdate=0.3, xmin=-10.0, ymin=-10.0, xmax=10.0, ymax=10.0))
    mapper, truth = Mapper(config, laser), drive(1.2)
    for k, pose in enumerate(odometry(truth, np.random.default_rng(5))):
        mapper.process(mapper.reading(ring.ranges(truth[k], laser.angles)), pose, 0.1 * k)
    mapper.occupancy(exact=False)
    name = str(tmp_path_factory.mktemp("state") / "good.state")
    state.save(name, state.snapshot(mapper))
    mapper.close()
    return name


def old_pickle(target):
    """Bytes of a state of version 4 that replaces the reader's list of allowed names, then calls os.mkdir."""
    code = (b"\x80\x04cm2wr_gmapping.io.state\n_Unpickler\n"           # the class itself, which was a permitted name
            b"N}X\x06\x00\x00\x00ARRAYS}X\x05\x00\x00\x00posix(X\x05\x00\x00\x00mkdirtss\x86b0"     # setattr by BUILD
            b"cposix\nmkdir\n(X" + len(target).to_bytes(4, "little") + target.encode() + b"tR.")
    pickletools.dis(code, out=io.StringIO())        # well-formed
    packed = zlib.compress(code, 1)
    head = dict(version=4, bytes=len(packed), sha256=hashlib.sha256(packed).hexdigest())
    return b"m2wr_gmapping state\n" + json.dumps(head).encode() + b"\n" + packed


def test_pickle_is_refused_and_not_executed(tmp_path):
    target, path = tmp_path / "owned", tmp_path / "evil.state"
    path.write_bytes(old_pickle(str(target)))
    with pytest.raises(state.StateError) as caught:
        state.load(str(path))
    assert not target.exists()
    assert "pickle" in str(caught.value) and "version 4" in str(caught.value) and "evil.state" in str(caught.value)


def rewritten(path, target, document=None, arrays=None, raw=None):
    """Write a copy of a state: ``document`` (function) changes its JSON, ``arrays`` and ``raw`` replace members."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(str(target), "w", zipfile.ZIP_DEFLATED) as new:
        for info in old.infolist():
            data = old.read(info)
            if info.filename == "state.json" and document is not None:
                held = json.loads(data.decode())
                document(held)
                data = json.dumps(held).encode()
            name = info.filename[:-4]
            if arrays and name in arrays:
                stream = io.BytesIO()
                np.save(stream, arrays[name](np.load(io.BytesIO(data))))
                data = stream.getvalue()
            new.writestr(info.filename, (raw or {}).get(info.filename, data))
    return str(target)


def refused(path, words):
    with pytest.raises(state.StateError, match=words):
        state.load(path).mapper.close()


def test_pickled_array_is_refused(good, tmp_path):
    stream = io.BytesIO()
    np.save(stream, np.array([print], object), allow_pickle=True)
    refused(rewritten(good, tmp_path / "a.state", raw={"filter.poses.npy": stream.getvalue()}), "type cannot be used")


def test_sizes_are_checked_before_memory_is_taken(good, tmp_path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, dict(descr="<f8", fortran_order=False, shape=(10**11, 3)))
    refused(rewritten(good, tmp_path / "a.state", raw={"filter.poses.npy": head.getvalue()}), "0 bytes for the shape")
    bomb = tmp_path / "bomb.state"
    with zipfile.ZipFile(str(bomb), "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("state.json", "w", force_zip64=True) as member:
            for _ in range(64):
                member.write(b" " * (1 << 20))
    assert os.path.getsize(str(bomb)) < 100000
    refused(str(bomb), "state.json: 67108864 bytes; expected at most 1048576")
    with zipfile.ZipFile(str(bomb), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("state.json", "{}")
        for k in range(3):
            archive.writestr("a%d.npy" % k, b"x")
        for info in archive.infolist()[1:]:
            info.file_size = 1 << 29                    # claimed, not there
    refused(str(bomb), "bytes when unpacked; expected at most")


@pytest.mark.parametrize("text, words", [
    (b"[" * 100000, "nested more than"), (b'{"a": ' + b"9" * 100000 + b"}", "number of 100000 digits"),
    (b"{", "damaged"), (b"\xff", "damaged"), (b"[]", "expected a state")])
def test_json_is_bounded(good, tmp_path, text, words):
    refused(rewritten(good, tmp_path / "a.state", raw={"state.json": text}), words)


@pytest.mark.parametrize("name, change, words", [
    ("filter.maps.table", lambda found: found + 10**6, "filter.maps.table is [0-9]+; expected -1 to .*, below"),
    ("filter.maps.table", lambda found: found - 2, "filter.maps.table is -[23]"),
    ("filter.maps.table", lambda found: found[:2], "particles|expected"),
    ("filter.maps.blocks", lambda found: found + 10**6, "filter.maps.blocks is [0-9]+; expected -1 to .*, below"),
    ("filter.maps.blocks", lambda found: found[:, :4], "filter.maps.blocks: 4 where 8 are expected"),
    ("filter.tree._parent", lambda found: found[::-1].copy(), "order in which they were made"),
    ("filter.tree._parent", lambda found: np.maximum(found, 0), "not in the order"),
    ("filter.tree.leaves", lambda found: 0 * found, "has not the"),
    ("filter.tree._pose", lambda found: found[:, :2], "expected"),
    ("filter.poses", lambda found: found * np.nan, "filter.poses is nan"),
    ("filter.poses", lambda found: found.astype(np.float32), "is of float32; expected float64"),
    ("_occupancy._table", lambda found: found + 10**6, "_occupancy._table is"),
    ("_occupancy._counts", lambda found: found[:, :5], "_occupancy._counts: 5 where 1024 are expected"),
    ("_loops.graph.links.1", lambda found: found + 10**6, "_loops.graph.links.1 is"),
    ("_loops.graph.links.0", lambda found: found + 10**5, "_loops.graph.links.0 is"),
    ("_between.1", lambda found: found + 10**6, "_between.1 is"),
    ("readings.rays.lengths", lambda found: found + 1, "does not fit the lengths"),
    ("readings.rays", lambda found: found[0], "readings.rays has 1 axes; expected 2"),
    ("readings.rays", lambda found: found + np.float32(1e9), "readings.rays is"),
    ("_tracker._track", lambda found: found[:20], "_tracker._track: 20 where 39 are expected"),
    ("_tracker._calibration", lambda found: found[:6], "_tracker._calibration: 6 where 45 are expected"),
    ("_history._records", lambda found: np.concatenate([found] * 3), "_history"),
    ("laser.angles", lambda found: found * 1e9, "laser.angles is")])
def test_out_of_bounds_indices_are_refused(good, tmp_path, name, change, words):
    refused(rewritten(good, tmp_path / "a.state", arrays={name: change}), words)


def test_random_values_are_refused_or_harmless(good, tmp_path, ring, laser):
    """Compiled code has no checks of its own: a value that leads it astray would end this process."""
    rng, used = np.random.default_rng(3), 0
    with zipfile.ZipFile(good) as archive:
        names = [info.filename[:-4] for info in archive.infolist() if info.filename != "state.json"]
    reading = laser.reading(ring.ranges(drive(1.2)[5], laser.angles))

    def spoil(found):
        found = found.copy()
        if found.size:
            places = rng.integers(0, found.size, 1 + found.size // 50)
            scale = 2.0 ** rng.integers(0, 62)
            with np.errstate(all="ignore"):
                found.reshape(-1)[places] = (rng.standard_normal(len(places)) * scale).astype(found.dtype)
        return found
    for name in names:
        try:
            found = state.load(rewritten(good, tmp_path / "a.state", arrays={name: spoil}))
        except state.StateError:
            continue
        used, mapper = used + 1, found.mapper
        try:
            mapper.process(reading, mapper.odometry + [0.6, 0.0, 0.0], mapper.stamps[-1] + 1.0)
            mapper.occupancy(exact=False)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            pass
        finally:
            mapper.close()
    assert used > 10
