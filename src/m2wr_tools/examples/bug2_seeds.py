# SPDX-License-Identifier: BSD-3-Clause
"""Drive Bug 2 with several seeds of the laser's noise: python3 bug2_seeds.py [WORLD [RUNS]]."""
import sys

from m2wr_sim.api import read_robot, read_world
from m2wr_tools.bug2_runner import run_bug2


def main(world="world02", runs=3):
    scene = {"world": read_world(world), "robot": read_robot("m2wr")}
    for seed in range(int(runs)):
        run = run_bug2(seed=seed, **scene)
        print("seed %d: %s after %.1f s and %.2f m, %d changes of state, %d contacts"
              % (seed, run.outcome, run.time, run.path_length, len(run.states) - 1, len(run.contacts)))


if __name__ == "__main__":
    main(*sys.argv[1:3])
