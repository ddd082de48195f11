# SPDX-License-Identifier: BSD-3-Clause
"""Reads runs that were done before: a table as ``export`` writes it, or another results file."""
from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from typing import TYPE_CHECKING, Any, Dict, Iterator

from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.store.schema import RUN_COLUMNS

if TYPE_CHECKING:
    from typing import Mapping

    from m2wr_campaign.study.factors import RunTask

    Row = Dict[str, Any]

PACKED, PLAIN, RESULTS = ".csv.gz", ".csv", ".sqlite"
LARGEST_TABLE = 500_000_000     # bytes of a table that is not compressed: a million runs
LONGEST_TEXT = 8000             # characters of a value, as many as of a log
STATES = ("done", "failed")
NOT_READ = ("path", "log")      # no column of a table
#: What a table must have. Other columns may be missing, such as those of a later release.
NEEDED = ("key", "status", "outcome", "reason", "success", "versions", "finished")


def known_rows(path: str, tasks: Mapping[str, RunTask]) -> Iterator[Row]:
    """Yield the rows of runs of a study that another file has.

    Factors are those of the tasks, so that only the measures are taken from the file.

    Parameters
    ----------
    path : str
        Ends in ``.csv``, ``.csv.gz`` or ``.sqlite``.
    tasks : mapping of str to RunTask
        By their keys.

    Raises
    ------
    StoreError
        In one sentence, with the line: the file is not there, or a value cannot be used.
    """
    if path.endswith(RESULTS):
        rows = _rows_of_results(path)
    elif path.endswith((PLAIN, PACKED)):
        rows = _rows_of_table(path)
    else:
        raise StoreError("{}: expected a name that ends in {}, {} or {}".format(path, PLAIN, PACKED, RESULTS))
    for row in rows:
        task = tasks.get(row["key"])
        if task is not None:
            yield dict(row, **task.factors())


def _rows_of_results(path: str) -> Iterator[Row]:
    with ResultFile(path) as results:
        for row in results.runs():
            yield dict(row, path=results.packed_path_of(row["key"]))


def _rows_of_table(path: str) -> Iterator[Row]:
    reader = csv.DictReader(io.StringIO(_text_of(path)), strict=True)
    try:
        missing = [name for name in NEEDED if name not in (reader.fieldnames or ())]
        if missing:
            raise StoreError("{}: no column {}; expected a table that export wrote".format(path, missing[0]))
        for record in reader:
            place = "{}: line {}".format(path, reader.line_num)
            if None in record:
                raise StoreError("{}: more values than columns; expected a table that export wrote".format(place))
            yield dict({name: _value(place, name, record[name]) for name in RUN_COLUMNS
                        if name in record and name not in NOT_READ}, log="")
    except csv.Error as error:
        raise StoreError("{}: line {}: {}; expected a table that export wrote".format(
            path, reader.line_num, error)) from None


def _text_of(path: str) -> str:
    opened = gzip.open if path.endswith(PACKED) else open
    try:
        with opened(path, "rb") as file:
            data = file.read(LARGEST_TABLE + 1)
        if len(data) > LARGEST_TABLE:
            raise StoreError("{}: a table of more than {} bytes".format(path, LARGEST_TABLE))
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise StoreError("{}: byte {} is no UTF-8; expected a table that export wrote".format(
            path, error.start)) from None
    except (OSError, EOFError, zlib.error) as error:
        raise StoreError("{}: {}; expected a table that export wrote".format(
            path, getattr(error, "strerror", None) or error)) from None


def _value(place: str, name: str, text: str) -> Any:
    """Return a value of a table with the type of its column."""
    kind = RUN_COLUMNS[name][0]
    if text is None or len(text) > LONGEST_TEXT:
        raise StoreError("{}: {}: {}; expected at most {} characters".format(
            place, name, "no value" if text is None else "{} characters".format(len(text)), LONGEST_TEXT))
    if kind.startswith("TEXT"):
        if name == "status" and text not in STATES:
            raise StoreError("{}: status: read {!r}; expected {}".format(place, text, " or ".join(STATES)))
        return text
    if text == "" and "NOT NULL" not in kind:
        return None
    try:
        value = int(text) if kind.startswith("INTEGER") else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > 2 ** 53:
        raise StoreError("{}: {}: read {!r}; expected a finite {}number".format(
            place, name, text, "whole " if kind.startswith("INTEGER") else ""))
    if name == "success" and value not in (0, 1):
        raise StoreError("{}: success: read {!r}; expected 0 or 1".format(place, text))
    return value
