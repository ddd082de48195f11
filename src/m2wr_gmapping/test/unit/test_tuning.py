# SPDX-License-Identifier: BSD-3-Clause
"""Tuned constants are in one place."""
import ast
import dataclasses
import glob
import os

import pytest

from m2wr_gmapping import tuning

ROOT = os.path.dirname(tuning.__file__)
MODULES = sorted(path for folder in ("", "frontend", "filter", "backend", "io", "ros")
                 for path in glob.glob(os.path.join(ROOT, folder, "*.py")))
#: Numbers of the mapper that are no tuning: another value gives the same map, or is an error.
KEPT = {
    "backend/loop_closing.py": {"MOST_CONCLUSIONS": "guard against an endless loop"},
    "backend/place_match.py": {"PINNED": "as good as infinite"},
    "backend/place_search.py": {"MARGIN": "size of a raster"},
    "backend/step_history.py": {"FIRST_STEPS": "buffer", "CHECK_EVERY": "interval of a check", "CHECK_SHARE": ""},
    "backend/turned_path.py": {"RIGHT_ANGLES": "geometry"},
    "mapper.py": {"LEVEL": "a slope", "FARTHEST_ODOMETRY": "limit of input"},
    "frontend/correlative_kernels.py": {
        "BLOCK": "speed of an exact search", "CENTRE": "values of a raster", "BESIDE": "", "CORNER": ""},
    "frontend/hill_climb_kernels.py": {
        "LSTEP": "indices", "ASTEP": "", "ITERATIONS": "", "SIGMA": "", "LSIGMA": "", "KERNEL": "", "MIN_SCORE": ""},
    "frontend/information_kernels.py": {"INFORMATION": "index"},
    "frontend/match_kernels.py": dict.fromkeys(
        "QX QY NX NY ARM_N ARM_T SLIDE BEAM_ROWS WIDE NARROW ROUNDS SPREAD SIGMA LSIGMA FREE "
        "MATCH_SETTINGS POSE SCORE LOG_LIKELIHOOD FOUND COST INFORMATION RESULT_SIZE LANES PAIR_ROWS SUMS".split(),
        "indices and layout"),
    "frontend/matcher.py": {"NO_SLIP": "names of results", "DOUBTFUL": "", "SLIP": "", "LARGE_SLIP": "",
                            "UNEXPLAINED": ""},
    "frontend/scan.py": {"FARTHEST": "limit of input", "TILT_TOLERANCE": "limit of input"},
    "frontend/track.py": dict.fromkeys(
        "DISTANCE ROTATION DRIFT MOUNT_X MOUNT_Y MOUNT_YAW PARAMETERS TRACK_SIZE CALIBRATION_SIZE NOISE_SIZE "
        "REQUEST_SIZE RECORD_SIZE".split(), "indices and layout"),
    "frontend/view_memory.py": {"SECTORS": "layout of the state"},
    "filter/filter_kernels.py": {"COST": "index", "INFORMATION": "index"},
    "filter/particle_filter.py": {"LEAST_DEVIATION": "guard of a division", "MOST_TILES": "limit of memory"},
    "filter/tile_kernels.py": {
        "SHIFT": "layout of tiles", "MASK": "", "CELLS": "", "BLOCK_SHIFT": "", "BLOCK_MASK": "",
        "BLOCKS": "index", "TILES": "index", "UNIT": "", "MOST_HITS": "", "TURNS_TOGETHER": "speed",
        "PLACES": "layout", "PLACE_SHIFT": ""},
    "filter/tile_maps.py": {
        "CELLS_A_SIDE": "layout", "TILES_A_SIDE": "layout", "SPARE": "buffer", "FIRST_BLOCKS": "buffer",
        "FIRST_TILES": "buffer", "MOST_CELLS": "limit of memory", "NEVER": "no limit of hits", "TOGETHER": "buffer"},
    "filter/trajectory.py": {"FIRST_NODES": "buffer"},
    "filter/tree_kernels.py": {},
}


def read(path):
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def test_constants_cannot_be_changed():
    for group in tuning.GROUPS:
        with pytest.raises(dataclasses.FrozenInstanceError):
            getattr(tuning, group).narrow = 1.0


def numbers_of(source):
    """Names of a module's own constants that are numbers, and not computed from tuned ones."""
    for node in ast.parse(source).body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None:
            continue
        names = {part.id for part in ast.walk(node.value) if isinstance(part, ast.Name)}
        is_number = any(isinstance(part, ast.Constant) and isinstance(part.value, (int, float))
                        for part in ast.walk(node.value))
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            for part in ast.walk(target):
                if isinstance(part, ast.Name) and part.id.isupper() and is_number:
                    if not part.id.startswith("_") and not names & {"tuning", *tuning.GROUPS}:
                        yield part.id


def test_numbers_of_a_module_are_found():
    source = "A, B = 1, 2.0\nC = np.array([3.0])\nD = tuning.SCANS.slide * 2\nE = 'text'\nF: float = 0.5\nx = 1\n"
    assert list(numbers_of(source)) == ["A", "B", "C", "F"]


@pytest.mark.parametrize("path", [os.path.relpath(path, ROOT) for path in MODULES if os.path.relpath(path, ROOT).split(
    os.sep)[0] in ("frontend", "filter", "backend", "mapper.py")])
def test_no_other_module_has_a_tuned_constant(path):
    assert sorted(numbers_of(read(os.path.join(ROOT, path)))) == sorted(KEPT.get(path.replace(os.sep, "/"), {}))


def test_the_constants_that_a_source_reads():
    found = tuning.read_by("a = tuning.MATCHING.narrow, SEARCH.rival, tuning.NOTHING.narrow\n")
    assert found == {"MATCHING.narrow": tuning.MATCHING.narrow, "SEARCH.rival": tuning.SEARCH.rival}
