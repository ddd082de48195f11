# SPDX-License-Identifier: BSD-3-Clause
"""One SQLite file with the results of a study; each run is committed when it ends."""
from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import zlib
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any, Dict, Iterable, Iterator, List, Optional, Sequence, Set, Tuple

import numpy as np

from m2wr_campaign.store.schema import APPLICATION, BAGS_TABLE, RUN_NAMES, TABLES, UPGRADES, VERSION, WORLD_NAMES
from m2wr_campaign.study.factors import StudyWorld
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import Outline

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

    Row = Dict[str, Any]

PATIENCE = 10.0             # s that another program may lock the file
KEPT_BAGS = 20              # of failed runs of a method: a bag has half a megabyte, and a broken method fails each time
LARGEST_BLOB = 50_000_000   # bytes of an uncompressed world or path


class StoreError(Exception):
    """A results file that cannot be used."""


class ResultFile:
    """The results of one study.

    Parameters
    ----------
    path : str
    writing : bool, optional
        Whether runs are added: the file is made if it is not there, and no other program may add runs meanwhile.

    Raises
    ------
    StoreError
        In one sentence: not there, of something else, of another version, damaged, in use.
    """

    def __init__(self, path: str, writing: bool = False) -> None:
        self.path = path
        self._lock: Optional[IO[str]] = None
        if not writing and not os.path.isfile(path):
            raise StoreError("{}: there is no such file; expected the results of a study".format(path))
        try:
            if writing:
                self._lock = _locked(path)
            # a write that a kill has cut off has to be undone first, for which the file must be writable
            cut = os.path.exists(path + "-journal") and os.access(path, os.W_OK)
            mode = "rwc" if writing else "rw" if cut else "ro"
            self._data = sqlite3.connect("file:{}?mode={}".format(_quoted(path), mode), uri=True, timeout=PATIENCE,
                                         isolation_level=None)
            self._data.row_factory = sqlite3.Row
            with self._told():
                self._open(writing)
        except BaseException:
            self.close()
            raise

    def _open(self, writing: bool) -> None:
        application, = self._data.execute("PRAGMA application_id").fetchone()
        version, = self._data.execute("PRAGMA user_version").fetchone()
        tables, = self._data.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if writing and not tables and not application:
            self._data.execute("BEGIN IMMEDIATE")
            for statement in TABLES:
                self._data.execute(statement)
            self._data.execute("PRAGMA application_id = {}".format(APPLICATION))
            self._data.execute("PRAGMA user_version = {}".format(VERSION))
            self._data.execute("COMMIT")
        elif application != APPLICATION:
            raise StoreError("{}: a database of another program; expected the results of a study".format(self.path))
        elif not 1 <= version <= VERSION:
            raise StoreError("{}: version {} of the tables; expected at most version {}: read it with the release "
                             "that wrote it, or name another file".format(self.path, version, VERSION))
        elif writing:
            self._upgrade(version)
        if writing:
            self._data.execute(BAGS_TABLE)
        found = self._data.execute("PRAGMA quick_check(1)").fetchone()[0]
        if found != "ok":
            raise sqlite3.DatabaseError(found)

    def _upgrade(self, version: int) -> None:
        """Make the tables of an earlier release those of this one; its runs stay as they are."""
        self._data.execute("BEGIN IMMEDIATE")
        for number in range(version, VERSION):
            self._data.execute(UPGRADES[number])
        self._data.execute("PRAGMA user_version = {}".format(VERSION))
        self._data.execute("COMMIT")

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Make one sentence of an error of SQLite; what was committed before stays."""
        try:
            yield
        except sqlite3.Error as error:
            if self._data.in_transaction:
                try:
                    self._data.execute("ROLLBACK")
                except sqlite3.Error:
                    pass
            reason = str(error)
            if "locked" in reason:
                reason = "another program has locked it for {:.0f} s; end that program".format(PATIENCE)
            elif "full" in reason:
                reason = "the disk is full; make room and run again: finished runs are kept"
            elif "not a database" in reason or "malformed" in reason or isinstance(error, sqlite3.DatabaseError) \
                    and not isinstance(error, (sqlite3.OperationalError, sqlite3.IntegrityError)):
                reason = "damaged, or no results of a study ({}); name another file, or take its backup".format(reason)
            raise StoreError("{}: {}".format(self.path, reason)) from None

    def begin(self, name: str, text: str, keys: Sequence[str]) -> None:
        """Store the study and the keys of all its runs; earlier runs with these keys stay valid.

        Parameters
        ----------
        name, text : str
            Of the study, and of its file.
        keys : sequence of str
            In their order.

        Raises
        ------
        StoreError
            If the file has the results of a study of another name.
        """
        with self._told():
            known = self._data.execute("SELECT name FROM study").fetchone()
            if known is not None and known["name"] != name:
                raise StoreError("{}: results of the study {!r}; expected {!r}, or a new file".format(
                    self.path, known["name"], name))
            self._data.execute("BEGIN IMMEDIATE")
            self._data.execute("DELETE FROM study")
            self._data.execute("INSERT INTO study VALUES (?, ?)", (name, text))
            self._data.execute("DELETE FROM plan")
            self._data.executemany("INSERT INTO plan VALUES (?, ?)", enumerate(keys))
            self._data.execute("COMMIT")

    def study(self) -> Tuple[str, str]:
        """Return name and text of the study."""
        with self._told():
            found = self._data.execute("SELECT name, text FROM study").fetchone()
        return ("", "") if found is None else (found["name"], found["text"])

    def planned(self) -> int:
        """Return how many runs the study has."""
        with self._told():
            return int(self._data.execute("SELECT count(*) FROM plan").fetchone()[0])

    def finished(self) -> Set[str]:
        """Return the keys of all runs that are stored."""
        with self._told():
            return {row["key"] for row in self._data.execute("SELECT key FROM runs")}

    def add_worlds(self, worlds: Iterable[StudyWorld]) -> None:
        """Store worlds; those that are stored stay as they are."""
        rows = []
        with self._told():
            known = {row["key"] for row in self._data.execute("SELECT key FROM worlds")}
        for world in worlds:
            if world.key not in known:
                known.add(world.key)
                rows.append(_world_row(world))
        with self._told():
            self._data.execute("BEGIN IMMEDIATE")
            self._data.executemany("INSERT INTO worlds VALUES ({})".format(_marks(WORLD_NAMES)), rows)
            self._data.execute("COMMIT")

    def generated(self, recipe: str) -> Optional[StudyWorld]:
        """Return a generated world that is stored, or None."""
        with self._told():
            row = self._data.execute("SELECT * FROM worlds WHERE recipe = ?", (recipe,)).fetchone()
        if row is None or row["sdf"] is None:
            return None
        text = _unpacked(row["sdf"]).decode("utf-8")
        return StudyWorld(row["key"], row["label"], row["kind"],
                          tuple(sorted(json.loads(row["parameters"]).items())), row["number"], text, text,
                          (row["start_x"], row["start_y"], row["start_yaw"]), (row["goal_x"], row["goal_y"]), recipe)

    def add(self, row: Row) -> None:
        """Store a run.

        Parameters
        ----------
        row : dict
            Value of each column of ``runs``; missing ones are null. ``bag``, if it is there, is stored beside them;
            of the runs of a method, only the first KEPT_BAGS.

        Raises
        ------
        StoreError
            If it cannot be written; the runs before it stay.
        """
        with self._told():
            self._add(row)

    def add_all(self, rows: Iterable[Row]) -> int:
        """Store all of some runs, or none if one of them cannot be had; return how many they are.

        Parameters
        ----------
        rows : iterable of dict
            As for :meth:`add`.

        Raises
        ------
        StoreError
            As :meth:`add`, and what the rows raise.
        """
        count = 0
        with self._told():
            self._data.execute("BEGIN IMMEDIATE")
            try:
                for row in rows:
                    self._add(row)
                    count += 1
                self._data.execute("COMMIT")
            except BaseException:
                if self._data.in_transaction:
                    self._data.execute("ROLLBACK")
                raise
        return count

    def _add(self, row: Row) -> None:
        self._data.execute("SAVEPOINT run")
        self._data.execute("INSERT OR REPLACE INTO runs ({}) VALUES ({})".format(
            ", ".join(RUN_NAMES), _marks(RUN_NAMES)), [row.get(name, "" if name == "fault" else None)
                                                       for name in RUN_NAMES])
        self._data.execute("DELETE FROM bags WHERE key = ?", (row["key"],))
        kept, = self._data.execute("SELECT count(*) FROM bags JOIN runs USING (key) WHERE method = ? "
                                   "AND parameters = ?", (row["method"], row["parameters"])).fetchone()
        if row.get("bag") and kept < KEPT_BAGS:
            self._data.execute("INSERT INTO bags VALUES (?, ?)", (row["key"], row["bag"]))
        self._data.execute("RELEASE run")

    def runs(self) -> Iterator[Row]:
        """Yield the runs of the present plan in its order, without their paths."""
        with self._told():
            there = {row["name"] for row in self._data.execute("PRAGMA table_info(runs)")}
            names = ", ".join("runs." + name if name in there else "'' AS " + name     # of an earlier release
                              for name in RUN_NAMES if name != "path")
            for row in self._data.execute("SELECT {} FROM plan JOIN runs USING (key) ORDER BY number".format(names)):
                yield dict(row)

    def worlds(self) -> List[Row]:
        """Return all worlds without SDF; ``outlines`` are a list of Outline."""
        with self._told():
            rows = self._data.execute("SELECT {} FROM worlds".format(
                ", ".join(name for name in WORLD_NAMES if name != "sdf"))).fetchall()
        return [dict(row, outlines=[Outline(np.array(corners, float).reshape(-1, 2), radius)
                                    for corners, radius in json.loads(_unpacked(row["outlines"]))]) for row in rows]

    def packed_path_of(self, key: str) -> Optional[bytes]:
        """Return the path of a run as it is stored, or None."""
        with self._told():
            row = self._data.execute("SELECT path FROM runs WHERE key = ?", (key,)).fetchone()
        return None if row is None else row["path"]

    def path_of(self, key: str) -> FloatArray:
        """Return x, y (N, 2) [m] of the axle in a run; empty for a failed one, or one that came from a table."""
        packed = self.packed_path_of(key)
        if packed is None:
            return np.zeros((0, 2))
        return np.frombuffer(_unpacked(packed), "<f4").reshape(-1, 2).astype(float)

    def bags(self) -> Iterator[Tuple[str, bytes]]:
        """Yield key and bag of each failed run that has one, by key."""
        with self._told():
            if self._data.execute("SELECT count(*) FROM sqlite_master WHERE name = 'bags'").fetchone()[0]:
                for row in self._data.execute("SELECT key, data FROM bags JOIN runs USING (key) ORDER BY key"):
                    yield row["key"], row["data"]

    def close(self) -> None:
        """Close the file; called again it does nothing."""
        if hasattr(self, "_data"):
            self._data.close()
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def __enter__(self) -> ResultFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def packed_path(path: FloatArray) -> bytes:
    """Return a path (N, 2) as it is stored."""
    return zlib.compress(np.asarray(path, "<f4").tobytes())


def _unpacked(data: bytes) -> bytes:
    stream = zlib.decompressobj()
    found = stream.decompress(data, LARGEST_BLOB)
    if stream.unconsumed_tail:
        raise StoreError("a world or path of more than {} bytes".format(LARGEST_BLOB))
    return found


def _marks(names: Sequence[str]) -> str:
    return ", ".join("?" for _ in names)


def _quoted(path: str) -> str:
    """Return a path for a URI of SQLite."""
    return os.path.abspath(path).replace("%", "%25").replace("?", "%3f").replace("#", "%23")


def _locked(path: str) -> IO[str]:
    """Return an open file beside the results that this process has locked, until it ends or closes it.

    A record lock: processes that are forked do not hold it.
    """
    try:
        file = open(path + ".lock", "a+", encoding="utf-8")
    except OSError as error:
        raise StoreError("{}: {}; expected a file that can be written".format(
            path, error.strerror or error)) from None
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.seek(0)
        holder = file.read(20).strip()
        file.close()
        raise StoreError("{}: process {} adds runs to it; wait for its end, or name another file".format(
            path, holder or "of another machine")) from None
    file.truncate(0)
    file.write("{}\n".format(os.getpid()))
    file.flush()
    return file


def _world_row(world: StudyWorld) -> List[Any]:
    outlines = [(np.round(outline.vertices, 4).tolist(), round(float(outline.radius), 4))
                for outline in obstacle_outlines(read_world(world.world))]
    sdf = zlib.compress(world.text.encode("utf-8")) if world.text else None
    return [world.key, world.recipe, world.label, world.kind, json.dumps(dict(world.parameters)), world.number,
            *world.start, *world.goal, zlib.compress(json.dumps(outlines).encode()), sdf]
