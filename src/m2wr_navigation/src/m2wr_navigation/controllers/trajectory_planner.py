# SPDX-License-Identifier: BSD-3-Clause
"""Roll-outs with acceleration, turns on the spot, steps to the side and backing, as base_local_planner."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, Dict, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_maps.pose_kernels import wrapped
from m2wr_navigation.controllers import rollout_kernels as kernels
from m2wr_navigation.controllers.controller import Command
from m2wr_navigation.controllers.sampling import (
    MOST_POSES,
    GoalLimits,
    SamplingController,
    cost_cloud,
    explained,
)
from m2wr_navigation.controllers.velocity_samples import AT_REST, along_axis
from m2wr_navigation.costmap.footprint_kernels import line_cost
from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_node.array_types import FloatArray, IndexArray

HEADING_WEIGHT = 0.3        # of heading_scoring, per rad; base_local_planner, trajectory_planner.cpp
DIAGONAL = 0.1              # m/s ahead and to the side: two more samples of a holonomic robot, from there too
FASTEST = 20.0              # m/s to the side, of y_vels: faster than any robot
STOPPED = 0.01, 0.01        # m/s, rad/s: below, the robot has stopped at the goal; from there too


def _bias(default: float, meaning: str) -> Parameter:
    return Parameter(default, "", 0.0, 5.0, meaning)


class TrajectoryPlanner(SamplingController):
    """Drives ahead if it can; else it turns on the spot, steps to the side, or backs."""

    PARAMETERS: ClassVar[Dict[str, Parameter]] = {
        "max_vel_x": Parameter(0.55, "m/s", 0.0, 20.0, "greatest speed ahead"),
        "min_vel_x": Parameter(0.0, "m/s", 0.0, 20.0, "least speed ahead"),
        "max_vel_theta": Parameter(1.0, "rad/s", 0.0, 20.0, "greatest rate of turning to the left"),
        "min_vel_theta": Parameter(-1.0, "rad/s", -20.0, 0.0, "greatest rate of turning to the right, negative"),
        "min_in_place_vel_theta": Parameter(0.4, "rad/s", 0.0, 20.0, "least rate of turning on the spot"),
        "acc_lim_x": Parameter(2.5, "m/s^2", 0.0, 20.0, "greatest acceleration ahead"),
        "acc_lim_y": Parameter(2.5, "m/s^2", 0.0, 20.0, "greatest acceleration to the side"),
        "acc_lim_theta": Parameter(3.2, "rad/s^2", 0.0, 20.0, "greatest angular acceleration"),
        "sim_time": Parameter(1.7, "s", 0.01, 10.0, "time that is rolled out"),
        "sim_granularity": Parameter(0.025, "m", 0.001, 5.0, "distance between two poses that are checked"),
        "angular_sim_granularity": Parameter(0.025, "rad", 0.001, math.pi / 2, "turn between two poses"),
        "path_distance_bias": _bias(0.6, "weight of the distance to the plan"),
        "goal_distance_bias": _bias(0.8, "weight of the distance to the plan's end in the local costmap"),
        "occdist_scale": _bias(0.01, "weight of the greatest cost below the robot"),
        "vx_samples": Parameter(20, "", 1, 300, "samples ahead"),
        "vtheta_samples": Parameter(20, "", 1, 300, "samples of turning"),
        "heading_lookahead": Parameter(0.325, "m", 0.0, 5.0, "point ahead by which turns on the spot are chosen"),
        "holonomic_robot": flag(True, "whether the robot can drive to the side"),
        "escape_vel": Parameter(-0.1, "m/s", -2.0, 2.0, "speed of backing where nothing else is possible; negative"),
        "dwa": flag(False, "velocities reachable in one cycle; false: in sim_time"),
        "heading_scoring": flag(False, "whether the heading to the plan counts, too"),
        "heading_scoring_timestep": Parameter(0.1, "s", 0.0, 1.0, "after this time the heading is looked at"),
        "simple_attractor": flag(False, "straight distance to the plan's end, instead of distances along cells"),
        "y_vels": text("-0.3,-0.1,0.1,-0.3", "steps to the side of a holonomic robot [m/s]", True),
        "oscillation_reset_dist": Parameter(0.05, "m", 0.0, 5.0, "way after which all directions are allowed again"),
        "escape_reset_dist": Parameter(0.1, "m", 0.0, 5.0, "way after which backing ends"),
        "escape_reset_theta": Parameter(math.pi / 2, "rad", 0.0, 5.0, "turn after which backing ends"),
        "meter_scoring": flag(False, "whether distances are in metres; false: in cells", False),
        "prune_plan": flag(True, "accepted: the part of the plan that was passed has no influence", False),
        "xy_goal_tolerance": Parameter(0.1, "m", 0.0, 10.0, "distance to the goal at which it is reached", False),
        "yaw_goal_tolerance": Parameter(0.05, "rad", 0.0, 7.0, "angle to the goal's heading at which it is reached",
                                        False),
        "latch_xy_goal_tolerance": flag(False, "once the distance was reached, only the heading counts", False),
        "max_rotational_vel": Parameter(1.0, "rad/s", 0.0, 20.0, "greatest rate of the turn at the goal", False),
        "world_model": text("costmap", "accepted: only costmap is known"),
    }
    ALIASES: ClassVar[Dict[str, str]] = {"pdist_scale": "path_distance_bias", "gdist_scale": "goal_distance_bias",
                                         "backup_vel": "escape_vel"}

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self._backs_since: Optional[FloatArray] = None      # pose
        self._scale, self._used_grids = 1.0, self._grids

    def set_plan(self, plan: FloatArray, new_goal: bool) -> None:
        super().set_plan(plan, new_goal)
        if new_goal:
            self._backs_since = None

    @property
    def goal_limits(self) -> GoalLimits:
        values = self.values
        most = min(values["max_vel_theta"], -values["min_vel_theta"], values["max_rotational_vel"])
        return GoalLimits(STOPPED, (values["min_in_place_vel_theta"], most))

    # ---- samples

    def _ends(self, situation: Situation, rest: float) -> Tuple[Tuple[float, float], Tuple[float, float]]:
        """Return least and greatest reachable speed ahead and rate of turning; the plan ends after ``rest`` metres."""
        values, velocity = self.values, situation.velocity
        period = situation.period if values["dwa"] else values["sim_time"]
        reach = period * self.acceleration
        low = min(max(values["min_vel_x"], velocity[0] - reach[0]), values["max_vel_x"])
        high = min(values["max_vel_x"], velocity[0] + reach[0], rest / values["sim_time"])
        left = min(max(velocity[2] + reach[2], values["min_vel_theta"]), values["max_vel_theta"])
        right = max(min(velocity[2] - reach[2], values["max_vel_theta"]), values["min_vel_theta"])
        return (low, max(low, high)), (right, left)

    def _ahead(self, situation: Situation, rest: float) -> FloatArray:
        """Return the velocities (N, 3) of drives ahead.

        Drives that end within a cell are left out: distances in cells cannot tell them from standing, and a robot that
        cannot follow the plan in its present direction would creep instead of turning.
        """
        values = self.values
        speeds, rates = self._ends(situation, rest)
        grid = np.meshgrid(along_axis(*speeds, values["vx_samples"]), [0.0], along_axis(*rates, values[
            "vtheta_samples"]), indexing="ij")
        samples = np.stack(grid, -1).reshape(-1, 3)
        if values["holonomic_robot"]:
            samples = np.vstack([samples, [[DIAGONAL, DIAGONAL, 0.0], [DIAGONAL, -DIAGONAL, 0.0]]])
        return np.ascontiguousarray(samples[samples[:, 0] >= max(
            AT_REST, situation.costmap.resolution / values["sim_time"])])

    def _in_place(self, situation: Situation) -> FloatArray:
        """Return the velocities (N, 3) of turns on the spot, none slower than ``min_in_place_vel_theta``."""
        values = self.values
        (_, _), (right, left) = self._ends(situation, 0.0)
        least = values["min_in_place_vel_theta"]
        rates = along_axis(min(right, -least), max(left, least), values["vtheta_samples"])
        rates = rates[(np.abs(rates) >= max(least, 1e-3) - 1e-9) & (rates <= values["max_vel_theta"] + 1e-9)
                      & (rates >= values["min_vel_theta"] - 1e-9)]
        return np.stack([np.zeros(len(rates)), np.zeros(len(rates)), rates], -1)

    @property
    def drives_sideways(self) -> bool:
        return bool(self.values["holonomic_robot"])

    def _sideways(self) -> FloatArray:
        """Return the velocities (N, 3) of steps to the side; N is 0 if the robot cannot make them."""
        speeds = _numbers(self.values["y_vels"]) if self.values["holonomic_robot"] else []
        return np.array([[0.0, speed, 0.0] for speed in speeds]).reshape(-1, 3)

    def reachable(self, situation: Situation) -> FloatArray:
        back = np.array([[min(self.values["escape_vel"], 0.0), 0.0, 0.0]])
        return np.vstack([self._ahead(situation, math.inf), self._in_place(situation), self._sideways(), back])

    # ---- scores

    def _settings(self, complete: bool) -> FloatArray:
        """Return the settings (15,) of the kernel, for distances in cells."""
        values, scale = self.values, self._scale
        path, goal = (0.0, 0.0) if values["simple_attractor"] else (
            scale * values["path_distance_bias"], scale * values["goal_distance_bias"])
        return np.array([values["sim_time"], values["sim_granularity"], values["angular_sim_granularity"], path, goal,
                         0.0, 0.0, values["occdist_scale"], 0.0, 0.0, math.inf, 0.0, 0.0, float(MOST_POSES),
                         float(complete)])

    def _scores(self, situation: Situation, used: FloatArray, samples: FloatArray, bars: bool,
                complete: bool) -> Tuple[FloatArray, IndexArray, FloatArray]:
        """Return the cost (N,) of each sample, infinite for those not valid; why not, and where."""
        costmap = situation.costmap
        totals, reasons, places = np.empty(len(samples)), np.empty(len(samples), np.int64), np.empty((len(samples), 2))
        kernels.score_samples(
            samples, self._added_costs(situation, used, samples),
            self._oscillation.barred if bars else np.zeros((3, 2)), situation.pose,
            np.asarray(situation.velocity, float), self.acceleration, self._settings(complete), costmap.costs,
            costmap.resolution, costmap.origin, np.ascontiguousarray(situation.footprint), self._used_grids, totals,
            reasons, places)
        return totals, reasons, places

    def _added_costs(self, situation: Situation, used: FloatArray, samples: FloatArray) -> FloatArray:
        """Return the costs (N,) of ``heading_scoring`` and ``simple_attractor``."""
        values, added = self.values, np.zeros(len(samples))
        if values["heading_scoring"]:
            target = _seen_end(situation, used)
            then = self._poses_after(situation, samples, values["heading_scoring_timestep"])
            direction = np.arctan2(target[1] - then[:, 1], target[0] - then[:, 0])
            added += HEADING_WEIGHT * np.abs(np.remainder(direction - then[:, 2] + math.pi, 2 * math.pi) - math.pi)
        if values["simple_attractor"]:
            then = self._poses_after(situation, samples, values["sim_time"])
            added += values["goal_distance_bias"] * np.sum((then[:, :2] - used[-1, :2]) ** 2, -1)
        return added

    def _poses_after(self, situation: Situation, samples: FloatArray, time: float) -> FloatArray:
        """Return the pose (N, 3) after a time [s] for each sample."""
        values, out = self.values, np.empty((len(samples), 3))
        kernels.poses_after(samples, situation.pose, np.asarray(situation.velocity, float), self.acceleration, np.array(
            [time, values["sim_granularity"], values["angular_sim_granularity"], float(MOST_POSES)]), out)
        return out

    # ---- in each cycle

    def drive(self, situation: Situation, used: FloatArray) -> Command:
        values = self.values
        self._scale = situation.costmap.resolution if values["meter_scoring"] else 1.0
        grids = self.fill_grids(situation, used, 0.0)
        self._used_grids = np.zeros_like(grids) if values["simple_attractor"] else grids
        self._oscillation.look(situation.pose, values["oscillation_reset_dist"], math.inf)
        self._look_at_backing(situation.pose)
        scale = self._scale

        def costs() -> FloatArray:
            return cost_cloud(situation.costmap, grids, (
                scale * values["path_distance_bias"], scale * values["goal_distance_bias"], values["occdist_scale"]))

        sample, reason = self._chosen(situation, used)
        if sample is None and (self._oscillation.barred.any() or self._backs_since is not None):
            self._oscillation.reset()       # neither a bar nor the backing must be the only reason
            self._backs_since = None
            sample, reason = self._chosen(situation, used)
        if sample is None:
            return Command(None, reason, np.zeros((0, 3)), used, costs)
        self._oscillation.note(sample, situation.pose, AT_REST)
        if not sample[:2].any():
            self._turns_here.note_turn(situation.pose)
        return Command(sample, reason, self.poses(situation, sample, self.acceleration), used, costs)

    def _look_at_backing(self, pose: FloatArray) -> None:
        """End the backing once the robot has moved far enough."""
        if self._backs_since is not None:
            away = pose - self._backs_since
            if math.hypot(away[0], away[1]) > self.values["escape_reset_dist"] \
                    or abs(wrapped(away[2])) > self.values["escape_reset_theta"]:
                self._backs_since = None

    def _chosen(self, situation: Situation, used: FloatArray) -> Tuple[Optional[FloatArray], str]:
        """Return the best velocity and a sentence if it is unusual; None and the reason if there is none."""
        rest = math.hypot(*(used[-1, :2] - situation.pose[:2]))
        best, least = None, math.inf
        failed: List[Tuple[IndexArray, FloatArray]] = []
        ahead = self._ahead(situation, rest)
        if self._backs_since is None and len(ahead):
            totals, reasons, places = self._scores(situation, used, ahead, False, False)
            failed.append((reasons, places))
            if np.isfinite(totals).any():
                best, least = ahead[int(np.argmin(totals))], float(totals.min())
        one_cell = self._scale * (self.values["path_distance_bias"] + self.values["goal_distance_bias"])
        sides = self._turns_here.allowed_turns(least, one_cell)
        turns = self._in_place(situation)
        turns = turns[np.isin(np.sign(turns[:, 2]), sides)]
        if len(turns):
            # the way back to the best heading is no oscillation
            totals, reasons, places = self._scores(situation, used, turns, sides[0] != sides[1], True)
            failed.append((reasons, places))
            good = np.flatnonzero(np.isfinite(totals) & (totals <= least))
            if len(good):
                best = turns[good[int(np.argmin(self._distances_ahead(situation, turns[good])))]]
        sideways = self._sideways()
        if best is None and len(sideways):
            totals, reasons, places = self._scores(situation, used, sideways, True, False)
            failed.append((reasons, places))
            if np.isfinite(totals).any():
                best = sideways[int(np.argmin(totals))]
        if best is not None:
            return best, ""
        back = np.array([self.values["escape_vel"], 0.0, 0.0])
        why = explained(np.concatenate([reasons for reasons, _ in failed]), np.concatenate(
            [places for _, places in failed])) if failed else "the limits allow no velocity"
        if back[0] < 0.0 and all(self._outline_at(situation, pose) >= 0
                                 for pose in self.poses(situation, back, self.acceleration)):
            if self._backs_since is None:
                self._backs_since = np.array(situation.pose, float)
            return back, "the robot backs: " + why
        return None, why

    def _distances_ahead(self, situation: Situation, samples: FloatArray) -> FloatArray:
        """Return the distance (N,) to the plan's end of the point ahead of the robot after each sample, in cells."""
        costmap, nose = situation.costmap, self.values["heading_lookahead"]
        then = self._poses_after(situation, samples, self.values["sim_time"])
        points = then[:, :2] + nose * np.stack([np.cos(then[:, 2]), np.sin(then[:, 2])], -1)
        cells = costmap.cells(points)
        inside = costmap.inside(cells)
        found = np.full(len(samples), math.inf)
        found[inside] = self._grids[1][cells[inside, 0], cells[inside, 1]]
        return found


def _numbers(listed: str) -> List[float]:
    """Return the speeds in a text that is separated by commas; at most 100."""
    found = []
    for part in listed.split(",")[:100]:
        try:
            value = float(part)
        except ValueError:
            continue
        if 0.0 < abs(value) <= FASTEST:
            found.append(value)
    return sorted(set(found))


def _seen_end(situation: Situation, used: FloatArray) -> FloatArray:
    """Return the farthest point (2,) of the plan that is in sight of the robot."""
    costmap = situation.costmap
    cells = costmap.cells(used)
    own = costmap.cell(situation.pose[0], situation.pose[1])
    for point, cell in zip(used[::-1], cells[::-1]):
        if own is None or ((cell < 0) | (cell >= costmap.costs.shape)).any():
            continue
        if line_cost(costmap.costs, own[0], own[1], int(cell[0]), int(cell[1])) >= 0:
            return np.asarray(point[:2])
    return np.asarray(used[-1, :2])
