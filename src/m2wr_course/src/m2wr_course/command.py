# SPDX-License-Identifier: BSD-3-Clause
"""The command ``rosrun m2wr_course exercise N FILE``."""
from __future__ import annotations

import argparse
import importlib
import os
import sys
from typing import Callable, Iterable, Optional, Sequence

from m2wr_course.finding import Finding
from m2wr_sim.errors import SimError

#: By number: what the file is, and module and function of the check; imported when it is asked for.
EXERCISES = {
    1: ("robot with its wheels 0.6 m apart (.xacro, .urdf)", "robots", "wider_robot"),
    2: ("the same robot in tidier files (.xacro)", "robots", "same_robot"),
    3: ("robot with a second laser that looks back (.xacro, .urdf)", "robots", "laser_behind"),
    4: ("Python file with the function nearest", "programs", "nearest"),
    5: ("world in which Bug 2 meets two walls (.world)", "worlds", "two_walls"),
    6: ("map of world02, of all of it (.yaml)", "maps", "whole_map"),
    7: ("weights with which the robot keeps its distance (.yaml)", "paths", "safe_path"),
    9: ("Python file with the function choose", "explorations", "short_exploration"),
    10: ("report of a delivery on higher ground (.json)", "deliveries", "all_delivered"),
}


#: Exercises whose check takes a seed of the noise.
SEEDED = (9,)


def check_of(number: int) -> Callable[..., Iterable[Finding]]:
    """Return the function that checks the file of an exercise and yields its findings."""
    _, module, name = EXERCISES[number]
    return getattr(importlib.import_module("m2wr_course." + module), name)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Check one file; returns 0 if all is right, 1 if something is not yet, 2 if it cannot be tried at all."""
    told = "\n".join("%d  %s" % (number, EXERCISES[number][0]) for number in sorted(EXERCISES))
    parser = argparse.ArgumentParser("exercise", description="Check an exercise of the course.",
                                     epilog="exercises:\n" + told,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("number", type=int, choices=sorted(EXERCISES), help="which exercise")
    parser.add_argument("file", help="what you have made")
    parser.add_argument("--seed", type=int, help="of the noise of the laser, for exercise {}: is it done by "
                        "luck?".format(", ".join(map(str, SEEDED))))
    options = parser.parse_args(arguments)
    if options.seed is not None and (options.seed < 0 or options.number not in SEEDED):
        parser.error("--seed {}; expected 0 or more, and exercise {}".format(
            options.seed, " or ".join(map(str, SEEDED))))
    seed = {} if options.seed is None else {"seed": options.seed}
    if not os.path.isfile(options.file):
        print("exercise %d: there is no file %s; expected a %s" % (options.number, options.file,
                                                                   EXERCISES[options.number][0]), file=sys.stderr)
        return 2
    print("exercise %d: checking %s ..." % (options.number, options.file), flush=True)      # some take their time
    wrong = looked = 0
    try:
        for finding in check_of(options.number)(os.path.abspath(options.file), **seed):
            looked += 1
            print("%-8s %s" % ("ok" if finding.right else "not yet", finding.text))
            if not finding.right:
                wrong += 1
                print("         %s" % finding.cure)
    except SyntaxError as error:        # of a student's program
        print("exercise %d: %s, line %s: syntax error, Python says: %s\n    %s" % (
            options.number, options.file, error.lineno, error.msg, (error.text or "").strip()), file=sys.stderr)
        return 2
    except (SimError, OSError) as error:
        print("exercise %d: %s: %s" % (options.number, options.file, error), file=sys.stderr)
        return 2
    print("exercise %d: %s" % (options.number, "done" if not wrong else "%d of %d not yet" % (wrong, looked)))
    return 1 if wrong else 0
