# SPDX-License-Identifier: BSD-3-Clause
"""Stored attributes of a mapper and their allowed values; all others follow from parameters and laser."""
from __future__ import annotations

import math

import numpy as np

from m2wr_files.state_file import Format
from m2wr_files.state_store import KindError
from m2wr_files.state_types import Array, Generator, Group, ListedRecord, Many, Maybe, Number, Part, Record, Text
from m2wr_gmapping.backend.loop_closing import Candidate
from m2wr_gmapping.backend.turned_path import TurnedFind
from m2wr_gmapping.filter.tile_kernels import CELLS as TILE
from m2wr_gmapping.filter.tile_maps import TILES_A_SIDE
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend.scan import FARTHEST, LaserModel, ScanReading
from m2wr_gmapping.frontend.view_memory import SECTORS
from m2wr_gmapping.mapper import FARTHEST_ODOMETRY, Mapper
from m2wr_maps.occupancy_kernels import CELLS as BLOCK
from m2wr_maps.saved_map import SavedMap

#: The version is increased if the meaning of a stored name changes.
FORMAT = Format(name="m2wr_gmapping state", version=16, program="slam_gmapping",
                instead="map the bag again, or start on the saved map")
EXTENT = 2e6            # greatest distance of a wall from the origin of a saved map [m]
MOST_CELLS = 10**8      # of a saved map
MOST_BEAMS = 10**6      # of a scan
COUNT, REAL, YES = Number(int, 0), Number(float), Number(bool)
POSE = Array("float64", "3", -FARTHEST_ODOMETRY, FARTHEST_ODOMETRY)
NODE = Number(int, 0, below="scans")
LINK = Group(NODE, NODE, POSE, Array("float64", "3 3"))


READING = ListedRecord(lambda values: ScanReading.of_parts(**values), {
    "points": Array("float64", "2 H", -EXTENT, EXTENT),
    "beams": Array("float64", "%d M" % mk.BEAM_ROWS, -EXTENT, EXTENT),
    "rays": Array("float32", "2 S", -2 * FARTHEST, 2 * FARTHEST), "ray_hits": Array("bool", "S")})
CANDIDATE = ListedRecord(lambda values: Candidate(**values), {
    "along": REAL, "link": LINK, "pose": POSE, "correction": POSE, "slides": YES,
    "evidence": REAL})
TURNED_FIND = ListedRecord(lambda values: TurnedFind(**values), {
    "along": REAL, "node": NODE, "link": LINK, "correction": POSE})
LASER = Record(lambda values: LaserModel(**values), {
    "angles": Array("float64", "B", -math.pi * 3, math.pi * 3), "reverse": YES, "centre": REAL,
    "base_from_sensor": POSE, "range_min": REAL, "range_max": REAL, "max_range": REAL, "max_urange": REAL})
GIVEN = Record(lambda values: SavedMap(**values), {
    "data": Array("int8", "H W", -1, 100), "resolution": Number(float, 0.001, 10.0),
    "origin": Array("float64", "2", -EXTENT, EXTENT), "name": Text(1000)})
TILES = Part({
    "mean": Array("uint8", "T %d 2" % TILE), "hits": Array("uint8", "T %d" % TILE),
    "blocks": Array("int32", "G %d %d" % (TILES_A_SIDE, TILES_A_SIDE), -1, below="T"),
    "table": Array("int32", "particles R C", -1, below="G"), "beyond": COUNT,
    "_corner": Maybe(Group(Number(int, -2**40, 2**40), Number(int, -2**40, 2**40)))},
    ("resolution", "_frozen", "_limit", "frame", "_counters", "_block_holders", "_free_blocks", "_holders", "_free"))
TREE = Part({
    "_parent": Array("int64", "M", -1), "_pose": Array("float64", "M 3", -FARTHEST_ODOMETRY, FARTHEST_ODOMETRY),
    "leaves": Array("int64", "particles", 0, below="M"), "depth": COUNT}, ("_used",))
FILTER = Part({
    "poses": Array("float64", "particles 3", -FARTHEST_ODOMETRY, FARTHEST_ODOMETRY),
    "log_weights": Array("float64", "particles"), "weight_sums": Array("float64", "particles"),
    "weights": Array("float64", "particles", 0.0, 1.0 + 1e-6), "_rng_motion": Generator(),
    "_rng_resample": Generator(), "resamplings": COUNT, "maps": TILES, "tree": TREE},
    ("_least", "_most", "_most_tiles", "_matcher", "_noise", "_gain", "_resample_below"))
OCCUPANCY = Part({
    "_counts": Array("int32", "B %d 2" % BLOCK, 0), "_table": Array("int32", "R C", -1, below="B"),
    "_anchor": Array("float64", "2", -EXTENT, EXTENT), "_shift": Array("int64", "2", 0, 10**12),
    "_poses": Array("float64", "P 3", -FARTHEST_ODOMETRY, FARTHEST_ODOMETRY), "beyond": YES, "traced": COUNT},
    ("ground", "_resolution", "_threshold", "_most_cells", "_used"))
HISTORY = Part({
    "_records": Array("float64", "S %d" % tr.RECORD_SIZE), "_information": Array("float64", "S 3 3"),
    "_variances": Array("float64", "S"), "_measured": Array("float64", "Q 3", -FARTHEST_ODOMETRY, FARTHEST_ODOMETRY),
    "doubtful": Many(Group(NODE, Array("bool", "3"))), "_checked_at": COUNT}, ("count",))
GRAPH = Part({"links": Many(LINK), "rejected": Many(Group(NODE, NODE)), "searches": COUNT, "closures": COUNT},
             ("_matcher", "_resolution", "_history", "_link_nodes"))
EXTENSION = Part({
    "_frontiers": Many(Group(NODE, Number(int, -1, 1), REAL, POSE)), "_review": Many(NODE), "has_moved": YES,
    "has_large_shift": YES}, ("_graph",))
TURNED = Part({"_finds": Many(TURNED_FIND), "_searched_at": REAL}, ("_graph",))
LOOPS = Part({
    "graph": GRAPH, "_extension": EXTENSION, "_turned": TURNED, "_pending": Maybe(Group(LINK, POSE)),
    "_candidates": Many(CANDIDATE), "_searched_at": REAL, "_linked_at": REAL, "_wide_at": REAL,
    "wide_searches": COUNT}, ("_history",))
TRACKER = Part({
    "_track": Array("float64", str(tr.TRACK_SIZE)), "_noise": Array("float64", str(tr.NOISE_SIZE)),
    "_calibration": Array("float64", str(tr.CALIBRATION_SIZE)), "turned": REAL, "is_doubtful": YES,
    "_share": Number(float, 0.0)},
    ("_matcher", "_dense", "_view", "track", "noise", "calibration", "is_unexplained", "agrees", "_rival", "_waits"))
VIEW = Part({"_seen": Array("float64", str(SECTORS))}, ("_now",))
GAPS = Part({
    "surprise": REAL, "_count": COUNT, "_gaps": COUNT, "_first": REAL, "_last": REAL, "_steps": COUNT, "_slips": COUNT})
STANDSTILL = Part({
    "longest": REAL, "unexplained": REAL, "_scans": COUNT, "_first": REAL, "_last": REAL,
    "_step": Group(REAL, REAL, REAL), "_driven": Group(REAL, REAL), "_turned": Group(REAL, REAL)})
LEVEL = Part({
    "_reference": Group(REAL, REAL), "_tilted_distance": REAL, "_excess": Group(REAL, REAL), "_is_tilted": YES,
    "is_rocking": YES}, ("_lift", "_reach"))
MAPPER = Part({
    "stamps": Many(REAL, "scans"), "readings": Many(READING, "scans"), "given": Number(int, 0, 1),
    "_between": Many(Group(REAL, NODE, POSE)), "_odom": POSE, "_distance": Number(float, infinite=True), "_turn": REAL,
    "_last_processed": REAL, "_stamp": REAL, "_rate": REAL, "filter": FILTER, "_tracker": TRACKER, "_level": LEVEL,
    "_loops": LOOPS, "_history": HISTORY, "_motion": VIEW, "_gaps": GAPS, "_standstill": STANDSTILL,
    "_occupancy": OCCUPANCY},
    ("config", "laser", "_workers", "_plain", "_matcher", "_dense"))


def check_laser(laser: LaserModel) -> None:
    """Raise KindError for a number of beams that no scan has; before a mapper is made of it."""
    if not 1 <= len(laser.angles) <= MOST_BEAMS:
        raise KindError("{} beams; expected 1 to {}".format(len(laser.angles), MOST_BEAMS))


def check(mapper: Mapper) -> None:
    """Raise KindError where the parts of a mapper that was put together do not agree with each other."""
    scans, particles = len(mapper.stamps), mapper.particles.count
    if not 1 <= particles <= mapper.config["particles"]:
        raise KindError("{} particles; expected 1 to {}".format(particles, mapper.config["particles"]))
    if not scans or mapper.particles.tree.depth != scans:
        raise KindError("{} scans on paths of {} nodes".format(scans, mapper.particles.tree.depth))
    if len(mapper._occupancy._poses) > scans:
        raise KindError("more scans on the map than there are")
    history = mapper._history
    if history.count != (scans if mapper._tracker is not None else 1) or len(history._measured) > history.count:
        raise KindError("{} steps for {} scans".format(history.count, scans))
    if not math.isclose(float(np.sum(mapper.particles.weights)), 1.0, abs_tol=1e-3):
        raise KindError("weights that do not sum to 1")
