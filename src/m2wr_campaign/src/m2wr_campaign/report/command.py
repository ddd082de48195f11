# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign report``: the page of a study."""
from __future__ import annotations

import argparse
import os
import sys
from typing import List, Optional

from m2wr_campaign.report.page import study_page
from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_navigation.compare.outputs import check_writable, write_text


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="report", description="Write the page of a study: methods with intervals, methods in pairs, success "
        "against difficulty, paths, and every failure. One file of HTML that needs no network. The study may still "
        "be running.")
    parser.add_argument("results", metavar="RESULTS.sqlite", help="what the command run made")
    parser.add_argument("--out", default="", metavar="FILE",
                        help="page (default: the results' name with .html, in the present folder)")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if a file cannot be used."""
    options = _parser().parse_args(argv)
    out = options.out or os.path.splitext(os.path.basename(options.results))[0] + ".html"
    try:
        check_writable(out)
        with ResultFile(options.results) as results:
            write_text(out, study_page(results))
    except (StoreError, OSError) as error:
        print("report: {}".format(error), file=sys.stderr)
        return 1
    print("the page is {}".format(out))
    return 0
