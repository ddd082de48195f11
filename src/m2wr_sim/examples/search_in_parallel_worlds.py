# SPDX-License-Identifier: BSD-3-Clause
"""Find the constant command that brings the robot farthest in ten seconds without a contact, by trying many at once."""
import sys

import numpy as np

from m2wr_sim.api import VectorSim


def main(count=16, seconds=10.0):
    generator = np.random.default_rng(0)
    commands = np.column_stack((generator.uniform(0.1, 0.6, count), generator.uniform(-0.5, 0.5, count)))
    with VectorSim(count, "world02", "m2wr", pose=(0.0, 8.0, 0.0), sensing="off", step=0.005) as worlds:
        start = worlds.reset().pose
        end = worlds.step(commands, seconds)
        distance = np.hypot(*(end.pose - start).T[:2])
        distance[end.contacts > 0] = 0.0
        best = int(np.argmax(distance))
        print("best of %d: %.2f m with linear %.2f m/s, angular %.2f rad/s; %d of them hit something"
              % (count, distance[best], commands[best, 0], commands[best, 1], np.count_nonzero(end.contacts)))


if __name__ == "__main__":
    main(*[int(word) for word in sys.argv[1:2]])
