# SPDX-License-Identifier: BSD-3-Clause
"""A robot on wheels in a world of blocks, driven by a planner and a controller through the costmaps; without ROS."""
import math

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap import footprint as footprints
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, Observation, Source
from m2wr_navigation.parameters import read
from m2wr_navigation.supervisor import PARAMETERS, Supervisor

CELL = 0.05                         # m: of the world and of both costmaps
BEAMS, RANGE = 360, 5.0             # of the laser; m
BOX = footprints.padded(np.array([[-0.27, -0.25], [0.41, -0.25], [0.41, 0.25], [-0.27, 0.25]]), 0.01)


def made(table, name, **given):
    kind = registry.find(table, name)
    values, warnings = read(kind.PARAMETERS, given, "~" + name)
    assert not warnings and set(given) <= set(kind.PARAMETERS), (warnings, set(given) - set(kind.PARAMETERS))
    return kind, values


def world(size, *boxes):
    """Occupied cells of a square room with a wall around; boxes are (x0, y0, x1, y1) in metres from its corner."""
    cells = np.zeros((int(size / CELL), int(size / CELL)), bool)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = True, True, True, True
    for box in boxes:
        x0, y0, x1, y1 = (int(round(value / CELL)) for value in box)
        cells[y0:y1, x0:x1] = True
    return cells


class ClosedLoop:
    """Runs at the rate of the controller; the costmaps are updated in each cycle.

    The robot follows commands with an acceleration limit, one cycle late; its odometry is exact. ``axle`` is the place
    of the wheels in the base frame, along x: the middle of a turn on the spot.
    """

    def __init__(self, occupied, controller, pose, period=0.1, footprint=BOX, origin=(0.0, 0.0),
                 acceleration=(3.0, 6.0), axle=0.0, planner="NavfnROS", inflation=(0.8, 4.0), local_size=6.0,
                 replan=1.0, **values):
        self.occupied, self.origin, self.period = occupied, np.array(origin, float), period
        self.pose, self.velocity = np.array(pose, float), np.zeros(3)
        self.acceleration, self.footprint, self.replan, self.axle = acceleration, footprint, replan, axle
        self.now, self.track, self.commands, self.messages = 0.0, [], [], []
        self.whole = self._costmap("map", occupied.shape[1] * CELL, False, inflation, True)
        self.local = self._costmap("odom", local_size, True, inflation, False)
        kind, settings = made(registry.PLANNERS, planner)
        self.planner = kind(settings)
        settings = read(PARAMETERS, dict({"controller_frequency": 1.0 / period}, **values), "~")[0]
        self.supervisor = Supervisor(settings, controller, [])
        self._delayed = np.zeros(3)

    def _costmap(self, frame, size, rolling, inflation, with_map):
        costmap = LayeredCostmap(frame, (size, size), CELL, tuple(self.origin), rolling, False)
        costmap.set_footprint(self.footprint)
        if with_map:
            kind, values = made(registry.LAYERS, "StaticLayer")
            layer = kind("static_layer", values)
            costmap.add(layer)
            layer.set_map(np.where(self.occupied, 100, 0).astype(np.int8), CELL, np.append(self.origin, 0.0), "map")
        kind, values = made(registry.LAYERS, "ObstacleLayer")
        layer = kind("obstacle_layer", values)
        layer.sources["scan"] = Source("scan", read(SOURCE_PARAMETERS, {
            "clearing": True, "obstacle_range": RANGE - 1.0, "raytrace_range": RANGE}, "scan")[0])
        costmap.add(layer)
        kind, values = made(registry.LAYERS, "InflationLayer", inflation_radius=inflation[0],
                            cost_scaling_factor=inflation[1])
        costmap.add(kind("inflation_layer", values))
        return costmap

    def scan(self):
        """End points of the beams that hit something, and of the others."""
        angles = self.pose[2] + np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
        steps = np.arange(0.02, RANGE, 0.02)
        x, y = (start + steps[:, None] * part for start, part in zip(self.pose, (np.cos(angles), np.sin(angles))))
        rows, columns = (np.clip(((values - origin) / CELL).astype(int), 0, size - 1)
                         for values, origin, size in zip((y, x), self.origin[::-1], self.occupied.shape))
        hit = self.occupied[rows, columns]      # what is outside of the world is behind its wall
        first, found = hit.argmax(0), hit.any(0)
        ends = np.where(found, first, -1), np.arange(BEAMS)
        ends = np.stack([x[ends], y[ends], np.full(BEAMS, 0.2)], 1)
        return Observation(self.now, np.append(self.pose[:2], 0.2), ends[found], ends[~found])

    def hits(self):
        """Whether the true outline of the robot is in an occupied cell."""
        corners = footprints.placed(self.footprint, self.pose)
        sides = [a + np.linspace(0.0, 1.0, 40)[:, None] * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0))]
        cells = np.floor((np.concatenate(sides) - self.origin) / CELL).astype(int)
        return bool(self.occupied[cells[:, 1], cells[:, 0]].any())

    def move(self, command):
        """Follow the command of the cycle before for one period."""
        command, self._delayed = self._delayed, np.array(command, float)
        limits = self.period * np.array([self.acceleration[0], self.acceleration[0], self.acceleration[1]])
        self.velocity = self.velocity + np.clip(command - self.velocity, -limits, limits)
        for _ in range(10):
            cosine, sine = math.cos(self.pose[2]), math.sin(self.pose[2])
            v, s, w = self.velocity * (0.1 * self.period)
            s = s - w * self.axle
            self.pose = self.pose + [cosine * v - sine * s, sine * v + cosine * s, w]
        self.now += self.period

    def situation(self, plan):
        velocity = self.velocity - [0.0, self.velocity[2] * self.axle, 0.0]     # of the base frame's origin
        return Situation(self.now, self.period, self.pose.copy(), velocity, plan, self.local.snapshot(),
                         self.local.footprint)

    def drive(self, goal, seconds):
        """Drive to a goal; returns the result's text, empty if the time is over."""
        goal = np.array(goal, float)
        number, plan, planned = self.supervisor.begin(self.now), self.pose[None], -math.inf
        end = self.now + seconds
        while self.now < end:
            observation = self.scan()
            for costmap in (self.whole, self.local):
                costmap.obstacle_layers()[0].sources["scan"].add(observation, self.now)
                costmap.update(self.pose, self.now)
            if self.supervisor.wants_plan or self.now - planned >= self.replan:
                planned = self.now
                found = self.planner.plan(self.whole.snapshot(), self.pose, goal, 0.0)
                self.messages += self.supervisor.take_plan(number, found, self.now)
                plan = found.poses if len(found.poses) else plan
            outcome = self.supervisor.cycle(self.now, self.situation(plan), [])
            self.messages += ["%.1f %s" % (self.now, text) for text in outcome.messages]
            if outcome.result:
                return outcome.text
            self.track.append(np.concatenate([self.pose, self.velocity]))
            self.commands.append(np.zeros(3) if outcome.velocity is None else outcome.velocity)
            self.outcome = outcome
            self.move(self._delayed if outcome.velocity is None else outcome.velocity)
        return ""
