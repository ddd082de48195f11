# SPDX-License-Identifier: BSD-3-Clause
"""A planar simulator for the unit tests: unicycle, laser, true clearance of the robot's outline.

No ROS and no physics engine: the axle follows the last command with limited acceleration, the command is applied at the
ticks of a 20 Hz controller, scans and odometry have 20 Hz. It runs the same state machines as the nodes.
"""
import math

import numba
import numpy as np

from motion_plan.body import AXLE_X, FOOTPRINT_BOXES, FOOTPRINT_DISCS, LASER_X
from motion_plan.bug2 import Bug2, State
from motion_plan.go_to_point import GoToPoint
from motion_plan.regions import BUG2_BOUNDS, RegionReader
from motion_plan.surroundings import Surroundings
from motion_plan.wall_follower import WallFollower
from motion_plan.wall_guard import WallGuard

BEAMS = 720
ANGLE_MIN, ANGLE_MAX = -1.570796, 1.570796
INCREMENT = (ANGLE_MAX - ANGLE_MIN) / (BEAMS - 1)
RANGE_MIN, RANGE_MAX, SIGMA = 0.10, 10.0, 0.01
STEP, TICK_STEPS = 0.01, 5
MAX_ACCELERATION, MAX_ANGULAR_ACCELERATION = 3.5, 10.0
#: Half depth of a jersey barrier [m]: at the laser's height, and at its foot.
BARRIER_LASER, BARRIER_FOOT, BARRIER_LENGTH = 0.336, 0.405, 4.065


@numba.njit(cache=False)
def cast_rays(x, y, yaw, boxes, discs, ranges):
    """Noise-free ranges from (x, y); boxes (N, 5): x, y, half length, half width, yaw; discs (M, 3): x, y, radius."""
    for beam in range(ranges.shape[0]):
        angle = yaw + ANGLE_MIN + beam * INCREMENT
        cos_beam, sin_beam = math.cos(angle), math.sin(angle)
        least = math.inf
        for i in range(boxes.shape[0]):
            cos_box, sin_box = math.cos(boxes[i, 4]), math.sin(boxes[i, 4])
            dx, dy = x - boxes[i, 0], y - boxes[i, 1]
            px, py = cos_box * dx + sin_box * dy, cos_box * dy - sin_box * dx
            ux, uy = cos_box * cos_beam + sin_box * sin_beam, cos_box * sin_beam - sin_box * cos_beam
            enter, leave = 0.0, math.inf
            for p, u, half in ((px, ux, boxes[i, 2]), (py, uy, boxes[i, 3])):
                if abs(u) < 1e-12:
                    if abs(p) > half:
                        leave = -1.0
                else:
                    near, far = (-half - p) / u, (half - p) / u
                    enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
            if enter <= leave and enter < least:
                least = enter
        for i in range(discs.shape[0]):
            dx, dy = discs[i, 0] - x, discs[i, 1] - y
            along, across = dx * cos_beam + dy * sin_beam, dx * sin_beam - dy * cos_beam
            reach = discs[i, 2] * discs[i, 2] - across * across
            if along > 0.0 and reach > 0.0:
                least = min(least, max(along - math.sqrt(reach), 0.0))
        ranges[beam] = least


@numba.njit(cache=False)
def clearance(outline, x, y, yaw, boxes, discs):
    """Least distance of the outline's points (N, 2, body frame) from any obstacle; negative inside one."""
    least = math.inf
    cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
    for k in range(outline.shape[0]):
        px = x + cos_yaw * outline[k, 0] - sin_yaw * outline[k, 1]
        py = y + sin_yaw * outline[k, 0] + cos_yaw * outline[k, 1]
        for i in range(boxes.shape[0]):
            cos_box, sin_box = math.cos(boxes[i, 4]), math.sin(boxes[i, 4])
            dx, dy = px - boxes[i, 0], py - boxes[i, 1]
            ox = abs(cos_box * dx + sin_box * dy) - boxes[i, 2]
            oy = abs(cos_box * dy - sin_box * dx) - boxes[i, 3]
            outside = math.hypot(max(ox, 0.0), max(oy, 0.0))
            least = min(least, outside + min(max(ox, oy), 0.0))
        for i in range(discs.shape[0]):
            least = min(least, math.hypot(px - discs[i, 0], py - discs[i, 1]) - discs[i, 2])
    return least


def outline_points(spacing=0.02):
    """Return points (N, 2) on the border of the robot's footprint, in the body frame."""
    points = []
    for x_min, x_max, y_min, y_max in FOOTPRINT_BOXES:
        for x in np.arange(x_min, x_max + 1e-9, spacing):
            points += [(x, y_min), (x, y_max)]
        for y in np.arange(y_min, y_max + 1e-9, spacing):
            points += [(x_min, y), (x_max, y)]
        points += [(x, y) for x in (x_min, x_max) for y in (y_min, y_max)]
    for x, y, radius in FOOTPRINT_DISCS:
        for angle in np.arange(0.0, 2 * math.pi, spacing / radius / 2):
            points.append((x + radius * math.cos(angle), y + radius * math.sin(angle)))
    return np.array(points)


class World:
    """Obstacles as seen by the laser, and as they collide with the body."""

    def __init__(self):
        self.seen_boxes, self.solid_boxes, self.discs = [], [], []

    def box(self, x, y, length, width, yaw=0.0):
        """A box with the same outline at every height; full length and width [m]."""
        self.seen_boxes.append((x, y, length / 2, width / 2, yaw))
        self.solid_boxes.append((x, y, length / 2, width / 2, yaw))
        return self

    def barrier(self, x, y, yaw):
        """A jersey barrier: its foot is wider, below the laser's plane."""
        self.seen_boxes.append((x, y, BARRIER_LENGTH / 2, BARRIER_LASER, yaw))
        self.solid_boxes.append((x, y, BARRIER_LENGTH / 2, BARRIER_FOOT, yaw))
        return self

    def disc(self, x, y, radius):
        """A round obstacle."""
        self.discs.append((x, y, radius))
        return self

    def arena(self, half=9.4):
        """Sixteen barriers around a square; round blocks close its corners."""
        for along in (-6.1, -2.03, 2.03, 6.1):
            for side in (-half, half):
                self.barrier(along, side, 0.0)
                self.barrier(side, along, math.pi / 2)
        for x in (-half, half):
            for y in (-half, half):
                self.disc(x, y, 1.0)
        return self

    def arrays(self):
        """Return (seen boxes, solid boxes, discs) as arrays."""
        return (np.array(self.seen_boxes, dtype=float).reshape(-1, 5),
                np.array(self.solid_boxes, dtype=float).reshape(-1, 5),
                np.array(self.discs, dtype=float).reshape(-1, 3))


class Robot:
    """Unicycle with a command latched at controller ticks, and a laser with seeded noise."""

    def __init__(self, world, start, yaw, rng, gain=1.0):
        self.pose = (start[0], start[1], yaw)
        self.speed = (0.0, 0.0)
        self.command = (0.0, 0.0)
        self.path_length = 0.0
        self._target = (0.0, 0.0)
        self._seen, self._solid, self._discs = world.arrays()
        self._outline = outline_points()
        self._rng, self._gain = rng, gain
        self._ranges = np.empty(BEAMS)
        self.least_clearance = self.clearance()

    def clearance(self):
        """True distance [m] of the outline from the nearest obstacle."""
        return clearance(self._outline, self.pose[0], self.pose[1], self.pose[2], self._solid, self._discs)

    def take_command(self):
        """The controller's tick."""
        self._target = self.command

    def step(self):
        """Advance by STEP seconds."""
        reach, turn = MAX_ACCELERATION * STEP, MAX_ANGULAR_ACCELERATION * STEP
        linear = self.speed[0] + max(-reach, min(reach, self._target[0] * self._gain - self.speed[0]))
        angular = self.speed[1] + max(-turn, min(turn, self._target[1] * self._gain - self.speed[1]))
        self.speed = (linear, angular)
        x, y, yaw = self.pose
        axle_x, axle_y = x + AXLE_X * math.cos(yaw), y + AXLE_X * math.sin(yaw)
        middle, yaw = yaw + 0.5 * angular * STEP, yaw + angular * STEP
        axle_x, axle_y = axle_x + linear * STEP * math.cos(middle), axle_y + linear * STEP * math.sin(middle)
        self.pose = (axle_x - AXLE_X * math.cos(yaw), axle_y - AXLE_X * math.sin(yaw),
                     math.atan2(math.sin(yaw), math.cos(yaw)))
        self.path_length += abs(linear) * STEP

    def scan(self):
        """Ranges of the simulated sensor."""
        x, y, yaw = self.pose
        cast_rays(x + LASER_X * math.cos(yaw), y + LASER_X * math.sin(yaw), yaw, self._seen, self._discs, self._ranges)
        noisy = np.clip(self._ranges + SIGMA * self._rng.standard_normal(BEAMS), RANGE_MIN, RANGE_MAX)
        return np.where(self._ranges > RANGE_MAX, np.inf, np.where(self._ranges <= RANGE_MIN, -np.inf, noisy))


class Result:
    """Result of a run."""

    def __init__(self, state, time, robot, bug, track, hits, reason):
        self.state, self.time, self.robot, self.bug, self.track = state, time, robot, bug, track
        self.hits, self.reason = hits, reason
        self.clearance = robot.least_clearance
        self.path_length = robot.path_length


def run_bug2(world, start, goal, yaw=0.0, seed=0, limit=400.0, leave_rule='complete', guard=True, jitter=0.0, gain=1.0):
    """Drive Bug 2 with its two behaviours through ``world``.

    ``jitter`` is the probability that a controller tick, a period of a node or a scan is skipped; as ticks are 50 ms
    apart, this gives delays of 100 and 150 ms at all places. At most two periods in a row are skipped.
    """
    rng = np.random.default_rng(seed)
    robot = Robot(world, start, yaw, rng, gain)
    bug, go, wall, guarding = Bug2(start, goal, leave_rule), GoToPoint(goal), WallFollower(), WallGuard()
    reader, around = RegionReader(BUG2_BOUNDS), Surroundings()
    active, regions, scan_time = State.GO_TO_POINT, None, 0.0
    track, hits, missed = [], 0, {}

    def lost(name):
        missed[name] = missed.get(name, 0) + 1 if missed.get(name, 0) < 2 and rng.random() < jitter else 0
        return missed[name] > 0

    for tick in range(int(limit / (STEP * TICK_STEPS))):
        now = tick * STEP * TICK_STEPS
        if not lost('scan'):
            ranges = robot.scan()
            regions = reader.read(ranges, ANGLE_MIN, ANGLE_MAX, INCREMENT)
            around.update(ranges, ANGLE_MIN, INCREMENT, robot.pose)
            wall.take_action(regions)
            scan_time = now
        if regions is not None and not lost('bug2'):
            state = bug.update(now, robot.pose, regions, around, robot.speed, now - scan_time)
            if state is not active:
                active = state
                guarding.release()
                go.restart()
                hits += state is State.WALL_FOLLOWING
                robot.command = (0.0, 0.0)
        if bug.finished:
            break
        if regions is not None and not lost('behaviour'):
            if active is State.GO_TO_POINT:
                robot.command = go.update(robot.pose)
            elif guard:
                robot.command = guarding.update(now, robot.pose, around, wall.update())
            else:
                robot.command = wall.update()
        delay = int(rng.integers(0, TICK_STEPS))
        for step in range(TICK_STEPS):
            if step == delay and not lost('controller'):
                robot.take_command()
            robot.step()
        robot.least_clearance = min(robot.least_clearance, robot.clearance())
        if tick % 4 == 0:
            track.append(robot.pose)
    return Result(bug.state, now, robot, bug, np.array(track), hits, bug.reason)
