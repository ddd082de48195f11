# SPDX-License-Identifier: BSD-3-Clause
"""The dynamic window approach with the parameters and costs of dwa_local_planner (Fox, Burgard, Thrun 1997)."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Dict, NamedTuple

import numpy as np

from m2wr_navigation.controllers import rollout_kernels as kernels
from m2wr_navigation.controllers.controller import Command
from m2wr_navigation.controllers.sampling import (
    AT_ONCE,
    MOST_POSES,
    GoalLimits,
    SamplingController,
    cost_cloud,
    explained,
)
from m2wr_navigation.controllers.velocity_samples import AT_REST, ROUNDING, make_samples
from m2wr_navigation.parameters import Parameter, flag

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, IndexArray

GREATEST = 1e6              # of a parameter: samples, times and costs stay finite
MOST_SAMPLES = 100          # along an axis: a million at most


def _p(default: float, unit: str, low: float, meaning: str) -> Parameter:
    return Parameter(default, unit, low, GREATEST, meaning)


class _Scored(NamedTuple):
    """Samples (N, 3) with costs, reasons and places, and the index of the best one or -1; see ``score_samples``."""

    best: int
    samples: FloatArray
    totals: FloatArray
    reasons: IndexArray
    places: FloatArray


class Dwa(SamplingController):
    """Rolls out velocities that the robot can reach, and takes the one with the least cost."""

    PARAMETERS: ClassVar[Dict[str, Parameter]] = {
        "max_vel_trans": _p(0.55, "m/s", 0.0, "greatest speed in any direction; 0: no limit"),
        "min_vel_trans": _p(0.1, "m/s", 0.0, "slower samples must turn"),
        "max_vel_x": _p(0.55, "m/s", -GREATEST, "greatest speed ahead"),
        "min_vel_x": _p(0.0, "m/s", -GREATEST, "least speed ahead; negative: backwards"),
        "max_vel_y": _p(0.1, "m/s", -GREATEST, "greatest speed to the left"),
        "min_vel_y": _p(-0.1, "m/s", -GREATEST, "least speed to the left"),
        "max_vel_theta": _p(1.0, "rad/s", 0.0, "greatest rate of turning"),
        "min_vel_theta": _p(0.4, "rad/s", 0.0, "least rate of turning on the spot"),
        "acc_lim_x": _p(2.5, "m/s^2", 0.0, "greatest acceleration ahead"),
        "acc_lim_y": _p(2.5, "m/s^2", 0.0, "greatest acceleration to the side"),
        "acc_lim_theta": _p(3.2, "rad/s^2", 0.0, "greatest angular acceleration"),
        "acc_lim_trans": _p(0.1, "m/s^2", 0.0, "accepted, without effect as in the original"),
        "prune_plan": flag(False, "accepted: the part of the plan that was passed has no influence"),
        "xy_goal_tolerance": _p(0.1, "m", 0.0, "distance to the goal at which it is reached"),
        "yaw_goal_tolerance": _p(0.1, "rad", 0.0, "angle to the goal's heading at which it is reached"),
        "latch_xy_goal_tolerance": flag(False, "once the distance was reached, only the heading counts"),
        "trans_stopped_vel": _p(0.1, "m/s", 0.0, "below, the robot has stopped"),
        "theta_stopped_vel": _p(0.1, "rad/s", 0.0, "below, the robot has stopped"),
        "sim_time": _p(1.7, "s", 0.01, "time that is rolled out"),
        "sim_granularity": _p(0.025, "m", 0.001, "distance between two poses that are checked"),
        "angular_sim_granularity": _p(0.1, "rad", 0.001, "turn between two poses that are checked"),
        "path_distance_bias": _p(0.6, "", 0.0, "weight of the distance to the plan"),
        "goal_distance_bias": _p(0.8, "", 0.0, "weight of the distance to the plan's end in the local costmap"),
        "occdist_scale": _p(0.01, "", 0.0, "weight of the greatest cost below the robot"),
        "twirling_scale": _p(0.0, "", 0.0, "weight of turning"),
        "stop_time_buffer": _p(0.2, "s", 0.0, "accepted, without effect as in the original"),
        "oscillation_reset_dist": _p(0.05, "m", 0.0, "way after which all directions are allowed again"),
        "oscillation_reset_angle": _p(0.2, "rad", 0.0, "turn after which all directions are allowed again"),
        "forward_point_distance": _p(0.325, "m", -GREATEST, "the nose, which points along plan and goal"),
        "scaling_speed": _p(0.25, "m/s", 0.0, "above, the footprint grows"),
        "max_scaling_factor": _p(0.2, "", 0.0, "by how much at max_vel_trans"),
        "cheat_factor": Parameter(1.0, "", 0.0, GREATEST, "how near to the goal the nose is ignored", False),
        "vx_samples": Parameter(3, "", 1, MOST_SAMPLES, "samples ahead"),
        "vy_samples": Parameter(10, "", 1, MOST_SAMPLES, "samples to the side"),
        "vth_samples": Parameter(20, "", 1, MOST_SAMPLES, "samples of turning"),
        "use_dwa": flag(True, "velocities reachable in one cycle; false: in sim_time, with acceleration"),
        "publish_cost_grid_pc": flag(False, "publish cost_cloud", False),
        "publish_traj_pc": flag(False, "publish trajectory_cloud", False),
        "sum_scores": flag(False, "accepted, without effect: the last pose counts", False),
    }

    @property
    def drives_sideways(self) -> bool:
        return bool(self.values["min_vel_y"] < 0.0 or self.values["max_vel_y"] > 0.0)

    @property
    def goal_limits(self) -> GoalLimits:
        values = self.values
        return GoalLimits((values["trans_stopped_vel"], values["theta_stopped_vel"]),
                          (values["min_vel_theta"], values["max_vel_theta"]))

    def reachable(self, situation: Situation) -> FloatArray:
        values = self.values
        period = situation.period if values["use_dwa"] else values["sim_time"]
        return make_samples(values, np.asarray(situation.velocity, float), period)

    @property
    def _rolled_with(self) -> FloatArray:
        return AT_ONCE if self.values["use_dwa"] else self.acceleration

    def drive(self, situation: Situation, used: FloatArray) -> Command:
        values, costmap = self.values, situation.costmap
        grids = self.fill_grids(situation, used, values["forward_point_distance"])
        samples = self.reachable(situation)
        if not len(samples):
            return Command(None, "the limits allow no velocity: expected min_vel_trans {:g}, min_vel_theta {:g} below "
                           "max_vel_trans {:g}, max_vel_theta {:g}".format(*(values[name] for name in (
                               "min_vel_trans", "min_vel_theta", "max_vel_trans", "max_vel_theta"))),
                           np.zeros((0, 3)), used)
        self._oscillation.look(situation.pose, values["oscillation_reset_dist"], values["oscillation_reset_angle"])
        drives = self._drives(samples, costmap.resolution)
        scored = self._scored(situation, samples, drives, grids)
        if scored.best < 0 and (scored.reasons == kernels.BARRED).any():
            # the robot still moves the barred way, and cannot reach another velocity yet
            self._oscillation.reset()
            scored = self._scored(situation, samples, drives, grids)
        scale = costmap.resolution

        def costs() -> FloatArray:
            return cost_cloud(costmap, grids, (scale * values["path_distance_bias"],
                                               scale * values["goal_distance_bias"], values["occdist_scale"]))

        def cloud() -> FloatArray:
            return self._trajectory_cloud(situation, scored.samples, scored.totals)

        clouds = costs if values["publish_cost_grid_pc"] else None, cloud if values["publish_traj_pc"] else None
        if scored.best < 0:
            return Command(None, explained(scored.reasons, scored.places), np.zeros((0, 3)), used, *clouds)
        best = scored.samples[scored.best]
        self._oscillation.note(best, situation.pose, values["min_vel_trans"])
        if scored.best >= np.count_nonzero(drives):
            self._turns_here.note_turn(situation.pose)
        return Command(best, "", self.poses(situation, best, self._rolled_with), used, *clouds)

    def _drives(self, samples: FloatArray, cell: float) -> BoolArray:
        """Return which samples (N,) drive: they leave a cell within ``sim_time``, or are the fastest in reach."""
        speeds = np.hypot(samples[:, 0], samples[:, 1])
        least = max(self.values["min_vel_trans"] - ROUNDING, AT_REST, cell / self.values["sim_time"])
        return np.asarray((speeds > 0.0) & (speeds >= min(least, float(speeds.max()) - 1e-9)))

    def _scored(self, situation: Situation, samples: FloatArray, drives: BoolArray, grids: Float32Array) -> _Scored:
        """Return the scores of the drives, and then of the turns that are allowed beside the best one of them."""
        ahead = self._scores(situation, samples[drives], grids, self._oscillation.barred)
        least = float(ahead.totals[ahead.best]) if ahead.best >= 0 else math.inf
        one_cell = situation.costmap.resolution * (self.values["path_distance_bias"] + self.values[
            "goal_distance_bias"])
        sides = self._turns_here.allowed_turns(least, one_cell)
        turns = samples[~drives]
        # the way back to the best heading is no oscillation
        barred = self._oscillation.barred if sides[0] != sides[1] else np.zeros((3, 2))
        turned = self._scores(situation, turns[np.isin(np.sign(turns[:, 2]), sides)], grids, barred)
        best = ahead.best
        if turned.best >= 0 and turned.totals[turned.best] <= least:
            best = len(ahead.samples) + turned.best
        return _Scored(best, *(np.concatenate([getattr(ahead, name), getattr(turned, name)])
                               for name in ("samples", "totals", "reasons", "places")))

    def _scores(self, situation: Situation, samples: FloatArray, grids: Float32Array, barred: FloatArray) -> _Scored:
        """Return the scores of some samples; see ``score_samples``."""
        costmap, count = situation.costmap, len(samples)
        totals, reasons, places = np.empty(count), np.empty(count, np.int64), np.empty((count, 2))
        best = int(kernels.score_samples(
            samples, np.zeros(count), barred, situation.pose, np.asarray(situation.velocity, float),
            self._rolled_with, self._settings(situation), costmap.costs, costmap.resolution, costmap.origin,
            np.ascontiguousarray(situation.footprint), grids, totals, reasons, places))
        return _Scored(best, samples, totals, reasons, places)

    def _settings(self, situation: Situation) -> FloatArray:
        """Return the settings (15,) of the kernel."""
        values, cell = self.values, situation.costmap.resolution
        away = situation.plan[-1, :2] - situation.pose[:2]
        is_far = away @ away > values["forward_point_distance"] ** 2 * values["cheat_factor"]
        path, goal = cell * values["path_distance_bias"], cell * values["goal_distance_bias"]
        return np.array([values["sim_time"], values["sim_granularity"], values["angular_sim_granularity"], path, goal,
                         goal, path if is_far else 0.0, values["occdist_scale"], values["twirling_scale"],
                         values["forward_point_distance"], values["scaling_speed"], values["max_scaling_factor"],
                         values["max_vel_trans"], float(MOST_POSES), float(values["publish_traj_pc"])])

    def _trajectory_cloud(self, situation: Situation, samples: FloatArray, totals: FloatArray) -> FloatArray:
        """Return the poses of all valid samples: x, y, z, theta, cost."""
        parts = []
        for k in np.flatnonzero(np.isfinite(totals)):
            poses = self.poses(situation, samples[k], self._rolled_with)
            parts.append(np.column_stack([poses[:, :2], np.zeros(len(poses)), poses[:, 2],
                                          np.full(len(poses), totals[k])]))
        return np.concatenate(parts).astype(np.float32) if parts else np.zeros((0, 5), np.float32)
