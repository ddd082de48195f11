# SPDX-License-Identifier: BSD-3-Clause
"""Writes the runs of a results file as a table: CSV, compressed or not, or Parquet where pyarrow is installed."""
from __future__ import annotations

import csv
import gzip
import importlib
import io
import json
from typing import TYPE_CHECKING, Any, Dict, Iterator, List

from m2wr_campaign.store.result_file import StoreError
from m2wr_campaign.store.schema import RUN_NAMES
from m2wr_files.atomic_files import write_atomically

if TYPE_CHECKING:
    from m2wr_campaign.store.result_file import ResultFile

#: Of the world, beside the columns of the run.
WORLD_PARTS = {"world_label": "label", "world_kind": "kind", "world_number": "number",
               "world_parameters": "parameters"}
COLUMNS = tuple(name for name in RUN_NAMES if name not in ("path", "log")) + tuple(WORLD_PARTS)
SUFFIXES = (".csv", ".csv.gz", ".parquet")
MEASURED_TO = 3         # digits behind the point of CPU and wall times [s]


def table(results: ResultFile) -> Iterator[Dict[str, Any]]:
    """Yield one record of COLUMNS for each run."""
    worlds = {world["key"]: world for world in results.worlds()}
    for run in results.runs():
        world = worlds[run["world"]]
        record = {name: run[name] for name in COLUMNS if name in run}
        record.update((name, round(run[name], MEASURED_TO)) for name in ("wall", "cpu") if run[name] is not None)
        record.update((name, world[part]) for name, part in WORLD_PARTS.items())
        yield record


def export(results: ResultFile, path: str) -> int:
    """Write all runs to a file.

    Parameters
    ----------
    results : ResultFile
    path : str
        Ends in ``.csv``, ``.csv.gz`` or ``.parquet``.

    Returns
    -------
    int
        How many they are.

    Raises
    ------
    StoreError
        If the file has another ending, or Parquet is not to be had.
    """
    if not path.endswith(SUFFIXES):
        raise StoreError("{}: expected a name that ends in {}".format(path, ", ".join(SUFFIXES)))
    records = list(table(results))
    if not path.endswith(".parquet"):
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS)
        writer.writeheader()
        writer.writerows(records)
        data = text.getvalue().encode("utf-8")
        # without a time in it, the same runs give the same file
        write_atomically((path, [gzip.compress(data, mtime=0) if path.endswith(".gz") else data]))
    else:
        write_atomically((path, [_parquet(records)]))
    return len(records)


def _parquet(records: List[Dict[str, Any]]) -> bytes:
    try:
        arrow = importlib.import_module("pyarrow")
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise StoreError("Parquet needs the Python package pyarrow, which is not installed; write .csv, or install "
                         "it: pip install pyarrow") from None
    memory = io.BytesIO()
    parquet.write_table(arrow.table({name: [record[name] for record in records] for name in COLUMNS}), memory)
    return memory.getvalue()


def parameters_of(run: Dict[str, Any]) -> str:
    """Return method and parameters of a run as one text."""
    values = json.loads(run["parameters"])
    return " ".join([run["method"]] + ["{}={}".format(name, value) for name, value in sorted(values.items())])
