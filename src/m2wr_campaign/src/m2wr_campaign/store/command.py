# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign export``: the runs of a results file as CSV or Parquet, and the bags of the failed ones."""
from __future__ import annotations

import argparse
import os
import sys
from typing import List, Optional

from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.store.table_export import export
from m2wr_files.atomic_files import write_atomically


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="export", description="Write the runs of a study as a table, one row a run: CSV, or Parquet where the "
        "Python package pyarrow is installed.")
    parser.add_argument("--bags", metavar="FOLDER", default="", help="write the last ten seconds of each failed run, "
                        "where it has a bag of them, to FOLDER/KEY.bag; KEY is that of the table")
    parser.add_argument("results", metavar="RESULTS.sqlite", help="what the command run made")
    parser.add_argument("out", metavar="OUT.csv", help="the table; .csv.gz: compressed, .parquet: Parquet")
    return parser


def export_bags(results: ResultFile, folder: str) -> int:
    """Write the bags of failed runs.

    Parameters
    ----------
    results : ResultFile
    folder : str
        Made if it is not there.

    Returns
    -------
    int
        How many they are.
    """
    os.makedirs(folder, exist_ok=True)
    count = 0
    for key, data in results.bags():
        name = "".join(letter for letter in key if letter.isalnum())       # a key is a hexadecimal number
        write_atomically((os.path.join(folder, name + ".bag"), [data]))
        count += 1
    return count


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if a file cannot be used."""
    options = _parser().parse_args(argv)
    try:
        with ResultFile(options.results) as results:
            count = export(results, options.out)
            bags = export_bags(results, options.bags) if options.bags else 0
    except (StoreError, OSError) as error:
        print("export: {}".format(error), file=sys.stderr)
        return 1
    print("{} runs are in {}{}".format(count, options.out, ", {} bags in {}".format(bags, options.bags)
                                       if options.bags else ""))
    return 0
