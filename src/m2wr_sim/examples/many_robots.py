# SPDX-License-Identifier: BSD-3-Clause
"""Robots in one world that wander about and turn away from what their lasers see, one another included."""
import math
import sys

from m2wr_sim.api import Sim, read_robot


def command(scan, turn_to):
    """Return forward and turning speed: straight on while the way ahead is free, else turn."""
    ahead = scan.ranges[abs(scan.angles) < 0.6].min()
    return (0.4, 0.0) if ahead > 1.0 else (0.0, turn_to)


def main(count=6, seconds=20.0):
    robot = read_robot("m2wr")
    with Sim("world01", step=0.005) as sim:
        for index in range(count):
            angle = 2.0 * math.pi * index / count
            sim.spawn(robot, (4.0 * math.cos(angle), 4.0 * math.sin(angle), angle + 2.0), "robot%d" % index)
        now = sim.step(None, 0.1)
        while now.time < seconds:
            now = sim.step({name: command(one.scan, 0.8) for name, one in now.robots.items()}, 0.1)
        for name in sim.robots:
            print("%s   x, y = %6.2f %6.2f   contacts %d" % ((name,) + now[name].pose[:2] + (sim.contact_count(name),)))


if __name__ == "__main__":
    main(*[float(word) if "." in word else int(word) for word in sys.argv[1:]])
