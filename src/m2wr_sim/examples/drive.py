# SPDX-License-Identifier: BSD-3-Clause
"""Drive a robot along two sides of a square and print where it is: simulation, true pose, odometry, scan."""
import math

from m2wr_sim.api import Sim


def main():
    with Sim("world02", "m2wr", pose=(0.0, 8.0, math.pi), seed=1) as sim:
        for command, duration in (((0.5, 0.0), 4.0), ((0.0, -0.5), math.pi), ((0.5, 0.0), 1.0)):
            now = sim.step(command, duration)
            print("t = %5.2f s   x, y, yaw = %6.3f %6.3f %6.3f   %5.2f m/s   nearest obstacle %.2f m   contacts %d"
                  % ((now.time,) + now.pose + (now.odometry.linear_x, now.scan.ranges.min(), len(now.contacts))))


if __name__ == "__main__":
    main()
