# SPDX-License-Identifier: BSD-3-Clause
"""The tables of a results file. A change of them is a new VERSION."""
from __future__ import annotations

APPLICATION = 0x6D327763        # "m2wc": marks the file as one of this package
VERSION = 2             # 2: runs.fault

#: Name -> (type in SQLite, meaning), of the columns of ``runs``. Times of the wall clock and of the CPU are the only
#: ones that differ between two runs with the same key.
RUN_COLUMNS = {
    "key": ("TEXT PRIMARY KEY", "what makes it the same run"),
    "world": ("TEXT NOT NULL REFERENCES worlds (key)", "key of the world"),
    "robot": ("TEXT NOT NULL", "robot"),
    "method": ("TEXT NOT NULL", "planner or method"),
    "parameters": ("TEXT NOT NULL", "of the method, as JSON"),
    "noise": ("REAL", "standard deviation of the laser's readings [m]; null: of the robot's description"),
    "repeat": ("INTEGER NOT NULL", "from 0"),
    "seed": ("INTEGER NOT NULL", "of all noise"),
    "status": ("TEXT NOT NULL", "done, or failed: the run gave no result"),
    "outcome": ("TEXT NOT NULL", "reached, unreachable, stuck, time out; missed: it took itself for arrived; failed"),
    "reason": ("TEXT NOT NULL", "of the outcome"),
    "success": ("INTEGER NOT NULL", "1: the goal was reached without a contact"),
    "length": ("REAL", "of the axle's path and the rest to the goal in a straight line [m]"),
    "ratio": ("REAL", "length over the optimum"),
    "time": ("REAL", "simulated time [s]"),
    "clearance": ("REAL", "least distance of the robot's outline from an obstacle [m]"),
    "contacts": ("INTEGER", "that began"),
    "turning": ("REAL", "sum of all changes of the heading of the path [rad]"),
    "cpu_ms": ("REAL", "CPU time of one plan, or of a cycle of a method [ms]"),
    "optimum": ("REAL", "length of the exact shortest path [m]"),
    "openness": ("REAL", "mean distance of the shortest path from the nearest obstacle [m]"),
    "tortuosity": ("REAL", "length of the shortest path over that of a straight line"),
    "wall": ("REAL", "wall time of the run [s]"),
    "cpu": ("REAL", "CPU time of the run [s]"),
    "path": ("BLOB", "x, y of the axle [m]: float32, little endian, compressed by zlib"),
    "log": ("TEXT NOT NULL", "what a failed run wrote, its end"),
    "versions": ("TEXT NOT NULL", "of the programs, as JSON"),
    "finished": ("TEXT NOT NULL", "date and time, UTC"),
    "fault": ("TEXT NOT NULL DEFAULT ''", "of sensors or drive, with its parameters; empty: none"),
}
RUN_NAMES = tuple(RUN_COLUMNS)

WORLD_COLUMNS = {
    "key": ("TEXT PRIMARY KEY", "of its content"),
    "recipe": ("TEXT NOT NULL", "what a generated world was made from"),
    "label": ("TEXT NOT NULL", "name"),
    "kind": ("TEXT NOT NULL", "file, or the generator"),
    "parameters": ("TEXT NOT NULL", "of the generator, as JSON"),
    "number": ("INTEGER NOT NULL", "among those with the same parameters"),
    "start_x": ("REAL NOT NULL", "m"), "start_y": ("REAL NOT NULL", "m"), "start_yaw": ("REAL NOT NULL", "rad"),
    "goal_x": ("REAL NOT NULL", "m"), "goal_y": ("REAL NOT NULL", "m"),
    "outlines": ("BLOB NOT NULL", "obstacles from above: JSON, compressed by zlib"),
    "sdf": ("BLOB", "of a generated world, compressed by zlib"),
}
WORLD_NAMES = tuple(WORLD_COLUMNS)

#: Bags of failed runs. A file without this table, of an earlier release, gets it when runs are added.
BAGS_TABLE = "CREATE TABLE IF NOT EXISTS bags (key TEXT PRIMARY KEY REFERENCES runs (key), data BLOB NOT NULL)"

#: What makes the tables of a version those of the next; done when runs are added to an older file.
UPGRADES = {1: "ALTER TABLE runs ADD COLUMN fault {}".format(RUN_COLUMNS["fault"][0])}

TABLES = (
    "CREATE TABLE study (name TEXT NOT NULL, text TEXT NOT NULL)",
    "CREATE TABLE plan (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE)",
    "CREATE TABLE worlds ({})".format(", ".join("{} {}".format(name, kind) for name, (kind, _) in
                                                WORLD_COLUMNS.items())),
    "CREATE TABLE runs ({})".format(", ".join("{} {}".format(name, kind) for name, (kind, _) in
                                              RUN_COLUMNS.items())),
    BAGS_TABLE,
)
