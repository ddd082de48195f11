# SPDX-License-Identifier: BSD-3-Clause
"""The command ``fuzz``: runs targets for a time, from a seed; repeats single cases."""
import argparse
import logging
import os
import shutil
import sys
import tempfile
import time

import mutations
from case_files import CaseError, read_case, write_case
from harness import ROOT, Finding, minimise, repeat, run_cases
from registry import TARGETS, make_target

CHUNK = 10 ** 9


def parse(argv):
    """Return the arguments of the command."""
    parser = argparse.ArgumentParser(prog="fuzz", formatter_class=argparse.ArgumentDefaultsHelpFormatter,
                                     description="Send invalid input to the workspace and check the result.")
    parser.add_argument("--target", action="append", choices=sorted(TARGETS), metavar="NAME",
                        help="run only this target, may be repeated; one of %s" % ", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, metavar="M", help="duration for all targets together")
    parser.add_argument("--cases", type=int, metavar="N", help="number of cases for all targets together")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of all cases")
    parser.add_argument("--case", type=int, metavar="K", help="run only this case of one target")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="number of the first case")
    parser.add_argument("--file", metavar="FILE", help="run the case in this file, written for a finding")
    parser.add_argument("--no-minimise", action="store_true", help="do not reduce failing cases")
    parser.add_argument("--out", default=os.path.join(ROOT, "logs", "fuzz"), metavar="DIR", help="folder for findings")
    arguments = parser.parse_args(argv)
    if (arguments.case is not None or arguments.file) and len(arguments.target or ()) != 1:
        parser.error("--case and --file need one --target")
    return arguments


def _program():
    return "/usr/bin/python3 " + os.path.relpath(os.path.join(ROOT, "test", "fuzz", "fuzz.py"))


def tell(target, finding, seed, out, smaller):
    """Print a finding with the command that repeats it, and write its case to a file."""
    os.makedirs(out, exist_ok=True)
    case = finding.case if finding.case is not None else target.make(
        mutations.generator(seed, target.name, finding.number))
    if smaller:
        case = minimise(target, case, finding.signature)
    path = os.path.join(out, "%s-%d-%d" % (target.name, seed, finding.number))
    write_case(path + ".case", case)
    with open(path + ".txt", "wb") as stream:
        stream.write(target.describe(case))
    print("\nFOUND in %s: %s: %s" % (target.name, finding.kind, finding.signature))
    print("  " + finding.text.strip()[-1500:].replace("\n", "\n  "))
    print("  again:    %s --target %s --seed %d --case %d" % (_program(), target.name, seed, finding.number))
    print("  smaller:  %s --target %s --file %s  (%d bytes, to read: %s.txt)" % (
        _program(), target.name, os.path.relpath(path + ".case"), len(target.describe(case)), os.path.relpath(path)))
    sys.stdout.flush()


def _single(arguments):
    target = make_target(arguments.target[0])
    target.prepare()
    if arguments.file:
        try:
            case = read_case(arguments.file)
        except CaseError as error:
            sys.exit("fuzz: %s" % error)
    else:
        case = target.make(mutations.generator(arguments.seed, target.name, arguments.case))
    finding = repeat(target, case)
    if finding is None:
        print("%s: no fault" % target.name)
        return 0
    print("%s: %s: %s\n%s" % (target.name, finding.kind, finding.signature, finding.text))
    return 1


def main(argv=None):
    """Entry point; returns 0 if there was no finding."""
    arguments = parse(argv)
    scratch = tempfile.mkdtemp(prefix="m2wr_fuzz_")
    before = os.getcwd()
    for name in ("ROS_HOME", "ROS_LOG_DIR"):
        os.environ.setdefault(name, scratch)
    os.environ["M2WR_FUZZ_SCRATCH"] = scratch
    logging.disable(logging.CRITICAL)           # while targets are prepared; workers check every line
    try:
        if arguments.case is not None or arguments.file:
            return _single(arguments)
        return _campaign(arguments)
    finally:
        os.chdir(before)
        shutil.rmtree(scratch, ignore_errors=True)


def _campaign(arguments):
    names = arguments.target or list(TARGETS)
    if arguments.minutes is None and arguments.cases is None:
        arguments.minutes = 2.0
    targets = [make_target(name) for name in names]
    for target in targets:
        target.prepare()
    whole, total, findings = sum(target.weight / target.dear for target in targets), 0, 0
    began, left = time.monotonic(), sum(target.weight for target in targets)
    end = None if arguments.minutes is None else began + 60.0 * arguments.minutes
    print("%-14s %9s %9s %9s %10s %9s" % ("target", "cases", "wall s", "cpu ms", "slowest s", "findings"))
    for target in targets:
        count = CHUNK if arguments.cases is None else int(
            round(arguments.cases * target.weight / target.dear / whole))
        now = time.monotonic()
        deadline = None if end is None else now + max(0.0, end - now) * target.weight / left
        left -= target.weight
        numbers = range(arguments.first, arguments.first + count)
        for found in run_cases(target, arguments.seed, numbers, deadline):
            if isinstance(found, Finding):
                tell(target, found, arguments.seed, arguments.out, not arguments.no_minimise)
        total, findings = total + found.cases, findings + len(found.findings)
        print("%-14s %9d %9.1f %9.2f %10.3f %9d" % (
            target.name, found.cases, found.wall, 1e3 * found.cpu / max(1, found.cases), found.slowest,
            len(found.findings)))
        for finding in found.findings.values():
            if finding.count > 1:
                print("    %d times: %s" % (finding.count, finding.signature))
        sys.stdout.flush()
    print("%d cases, seed %d, %d findings, %.0f s" % (total, arguments.seed, findings, time.monotonic() - began))
    return 1 if findings else 0
