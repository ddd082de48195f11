# SPDX-License-Identifier: BSD-3-Clause
"""A policy that was learned in generated worlds: a network of two layers from scan, goal and velocity to a command.

The weights are in ``learned_policy.npz`` beside this module; the example ``train_goal_policy.py`` of m2wr_campaign
writes such a file. They were learned with m2wr. The policy has no memory and no map: it cannot know that a goal is
walled in, and a dead end is left by patience only.
"""
from __future__ import annotations

import math
import os
import zipfile
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_navigation.methods.method import COMMON, RUNNING, Decision, Method, View
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_node.array_types import FloatArray

SECTORS = 36                # of the half circle in front of the robot
SIGHT = 4.0                 # m: farther readings count as this
GOAL_SIGHT = 5.0            # m: the same for the distance to the goal
FEATURES = SECTORS + 5
LINEAR, ANGULAR = 0.5, 1.0  # m/s, rad/s: greatest command that was learned
MOST_SPEED = 2.0            # times those: a faster robot counts as this
_WEIGHTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "learned_policy.npz")
_MOST_BYTES = 10 * 1024 ** 2        # of a file of weights
_MOST_UNITS = 1024          # of a layer


class Layer(NamedTuple):
    """A layer of the network.

    Attributes
    ----------
    weights : (outputs, inputs) float32
    offsets : (outputs,) float32
    """

    weights: FloatArray
    offsets: FloatArray


def features(scan: FloatArray, goal: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return what the network sees of n situations, (n, FEATURES) float32, each about -1 to 1, all finite.

    Parameters
    ----------
    scan : (n, SECTORS) float
        Least reading in each sector from -90 to 90 degrees [m]; inf: none.
    goal : (n, 2) float
        Ahead and to the left of the robot [m].
    velocity : (n, 2) float
        Forward [m/s] and turning [rad/s].
    """
    far = np.hypot(goal[:, 0], goal[:, 1])
    scale = 1.0 / np.maximum(far, 1e-6)
    return np.concatenate((
        1.0 - np.minimum(scan, SIGHT) / SIGHT,
        (np.minimum(far, GOAL_SIGHT) / GOAL_SIGHT)[:, None], goal * scale[:, None],
        np.clip(velocity / (LINEAR, ANGULAR), -MOST_SPEED, MOST_SPEED)), axis=1).astype(np.float32)


def sectors(ranges: Any, angle_min: float, angle_increment: float) -> FloatArray:
    """Return the least reading in each sector, (SECTORS,) [m], inf: none.

    Parameters
    ----------
    ranges : (B,) array_like
        Readings [m]; what is not positive is left out.
    angle_min, angle_increment : float
        Of the readings in the robot's frame [rad].
    """
    values = np.asarray(ranges, float)
    found = np.full(SECTORS, np.inf)
    angles = np.remainder(angle_min + angle_increment * np.arange(len(values)) + math.pi, 2.0 * math.pi) - math.pi
    with np.errstate(invalid="ignore"):
        # a beam at the very edge of the half circle belongs to the outer sector, whatever it is rounded to
        place = np.floor((angles + 0.5 * math.pi) * (SECTORS / math.pi) * (1.0 - 1e-9) + 1e-9)
        use = (values > 0.0) & (place >= 0.0) & (place < SECTORS)
    np.minimum.at(found, place[use].astype(int), values[use])
    return found


def network(layers: Tuple[Layer, ...], seen: FloatArray) -> FloatArray:
    """Return the actions of the network, (n, 2), for :func:`scaled`.

    Parameters
    ----------
    layers : tuple of Layer
        All but the last are followed by tanh.
    seen : (n, FEATURES) float32
    """
    values = seen
    for layer in layers[:-1]:
        values = np.tanh(values @ layer.weights.T + layer.offsets)
    return np.asarray(values @ layers[-1].weights.T + layers[-1].offsets)


def scaled(action: FloatArray) -> FloatArray:
    """Return the commands [m/s, rad/s] for actions, both (n, 2): -1 to 1 is 0 to LINEAR, and -ANGULAR to ANGULAR."""
    action = np.clip(np.asarray(action, float), -1.0, 1.0)
    return np.stack((0.5 * LINEAR * (action[:, 0] + 1.0), ANGULAR * action[:, 1]), axis=1)


@lru_cache(maxsize=8)
def read_policy(path: str) -> Tuple[Layer, ...]:
    """Return the layers of a file of weights.

    Parameters
    ----------
    path : str
        With arrays weights_0, offsets_0, weights_1 and so on.

    Raises
    ------
    ValueError
        If it cannot be read, or its arrays are not those of a network from FEATURES to two numbers.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(part.file_size for part in archive.infolist()) > _MOST_BYTES:
                raise ValueError("it has more than {} bytes".format(_MOST_BYTES))
        with np.load(path, allow_pickle=False) as arrays:
            layers = tuple(Layer(arrays["weights_{}".format(k)], arrays["offsets_{}".format(k)])
                           for k in range(len(arrays.files) // 2))
        inputs = FEATURES
        for layer in layers:
            outputs = len(layer.offsets)
            if layer.weights.shape != (outputs, inputs) or layer.offsets.shape != (outputs,) or outputs > _MOST_UNITS:
                raise ValueError("a layer from {} values has weights {} and offsets {}".format(
                    inputs, layer.weights.shape, layer.offsets.shape))
            if layer.weights.dtype.kind != "f" or layer.offsets.dtype.kind != "f":
                raise ValueError("weights are {} and {}, not numbers".format(layer.weights.dtype, layer.offsets.dtype))
            if not (np.isfinite(layer.weights).all() and np.isfinite(layer.offsets).all()):
                raise ValueError("a weight is not finite")
            inputs = outputs
        if not layers or inputs != 2:
            raise ValueError("it ends with {} values".format(inputs))
    except (OSError, ValueError, KeyError, TypeError, EOFError, MemoryError, zipfile.BadZipFile) as error:
        raise ValueError("policy {}: {}; expected layers of weights from {} values to 2".format(
            path, error, FEATURES)) from error
    return layers


class Learned(Method):
    """The learned policy."""

    PARAMETERS = dict(COMMON, **{
        "policy": Parameter("", "", 0, 0, "file of weights; empty: the one of this package", False),
    })

    def __init__(self, values: Mapping[str, Any], body: Optional[RobotBody] = None) -> None:
        super().__init__(values, body)
        self._layers = read_policy(str(self.values["policy"]) or _WEIGHTS)

    def decide(self, view: View) -> Decision:
        sensing = view.sensing
        scan = sectors(sensing.ranges, sensing.angle_min + self.body.laser[2], sensing.angle_increment)
        x, y, yaw = sensing.pose
        across, up = float(self.goal[0]) - x, float(self.goal[1]) - y
        cosine, sine = math.cos(yaw), math.sin(yaw)
        goal = np.array([[cosine * across + sine * up, cosine * up - sine * across]])
        seen = features(scan[None], goal, np.array([sensing.velocity]))
        linear, angular = scaled(network(self._layers, seen))[0].tolist()
        limit = self.values["max_vel_theta"]
        return Decision(min(linear, self.values["max_vel_x"]), min(max(angular, -limit), limit), RUNNING,
                        "as the network says")
