# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign grade``: students' packages over hidden worlds."""
from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from typing import List, Optional

from m2wr_campaign.grading.grades import as_csv, as_text, grades
from m2wr_campaign.grading.submissions import SubmissionsError, submissions
from m2wr_campaign.programs.containment import namespace
from m2wr_campaign.report.page import study_page
from m2wr_campaign.runner.command import MOST_WORKERS, run_study
from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study
from m2wr_navigation.compare.outputs import write_text
from m2wr_sim.api.loading import package_folder


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="grade", description="Run the ROS package of each folder of submissions in worlds that the students do "
        "not know, with limits of time, memory, processes and files, and write a table. After a stop the same command "
        "continues; a submission that has changed is run again.")
    parser.add_argument("folder", metavar="SUBMISSIONS", help="has a folder for each submission")
    parser.add_argument("--exam", default="", metavar="EXAM.yaml",
                        help="worlds, repeats and limits: a study without methods (default: examples/exam.yaml)")
    parser.add_argument("--seed", type=int, default=None, help="of the worlds, in place of that of the exam")
    parser.add_argument("--program", default="", metavar="NAME",
                        help="launch file or script that is run (default: bug2.launch, the only launch file, bug2.py, "
                        "or the only script)")
    parser.add_argument("--out", default="grades", metavar="NAME",
                        help="files: NAME.sqlite, NAME.csv, NAME.html (default: grades)")
    parser.add_argument("--workers", type=int, default=max(1, len(os.sched_getaffinity(0)) // 2),
                        help="submissions that run at the same time (default: half the cores)")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if the exam, a folder or a file cannot be used."""
    parser = _parser()
    options = parser.parse_args(argv)
    if not 1 <= options.workers <= MOST_WORKERS:
        parser.error("--workers {}; expected from 1 to {}".format(options.workers, MOST_WORKERS))
    if options.seed is not None and not 0 <= options.seed < 2**31:
        parser.error("--seed {}; expected from 0 to {}".format(options.seed, 2**31 - 1))
    exam = options.exam or os.path.join(package_folder("m2wr_campaign"), "examples", "exam.yaml")
    try:
        study = read_study(exam, submissions(options.folder, options.program))
        if options.seed is not None:
            study = replace(study, seed=options.seed)
        if not namespace():
            print("grade: this system gives no namespace to processes: a submission can write wherever you can "
                  "(see SECURITY.md)", file=sys.stderr)
        with open(exam, encoding="utf-8") as file:
            text = file.read()
        with ResultFile(options.out + ".sqlite", writing=True) as results:
            code = run_study(study, text, results, options.workers)
            found = grades(list(results.runs()))
            write_text(options.out + ".csv", as_csv(found))
            write_text(options.out + ".html", study_page(results))
    except (StudyError, StoreError, SubmissionsError, OSError) as error:
        print("grade: {}".format(error), file=sys.stderr)
        return 1
    print(as_text(found))
    print("{0}.csv has this table, {0}.html the page with every failure, {0}.sqlite all runs".format(options.out))
    return code
