# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign export``: the runs of a results file as CSV or Parquet."""
from __future__ import annotations

import argparse
import sys
from typing import List, Optional

from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.store.table_export import export


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="export", description="Write the runs of a study as a table, one row a run: CSV, or Parquet where the "
        "Python package pyarrow is installed.")
    parser.add_argument("results", metavar="RESULTS.sqlite", help="what the command run made")
    parser.add_argument("out", metavar="OUT.csv", help="the table; .parquet for Parquet")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if a file cannot be used."""
    options = _parser().parse_args(argv)
    try:
        with ResultFile(options.results) as results:
            count = export(results, options.out)
    except (StoreError, OSError) as error:
        print("export: {}".format(error), file=sys.stderr)
        return 1
    print("{} runs are in {}".format(count, options.out))
    return 0
