# SPDX-License-Identifier: BSD-3-Clause
"""Inertial measurement unit (IMU): measures the motion of the link that carries it.

Follows Gazebo's imu sensor.  The acceleration is the specific force: the change of velocity since the last measurement,
minus gravity, so that a unit at rest measures +9.8 m/s^2 upwards.  Rates and acceleration are in the sensor's frame.
The orientation is relative to a reference, either the world or the initial orientation.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

from m2wr_sim.geometry import compose, conjugate, cross, multiply, rotate_inverse
from m2wr_sim.sensors.noise import NoiseModel

if TYPE_CHECKING:
    import numpy as np

    from m2wr_sim.geometry import Pose, Quaternion, Vector
    from m2wr_sim.model.types import Noise
    from m2wr_sim.physics.engine import LinkState


class GaussMarkovBias:
    """Bias that changes over time: a first-order Gauss-Markov process that starts at 0.

    In a time dt the value decays by the factor exp(-dt / tau) and gets a normal draw of variance
    sigma^2 tau / 2 (1 - exp(-2 dt / tau)).  sigma is the ``dynamic_bias_stddev`` of the noise [unit / sqrt(s)], tau its
    ``dynamic_bias_correlation_time`` [s].  This discretisation is exact at any rate.
    """

    def __init__(self, noise: Noise) -> None:
        active = noise.kind in ("gaussian", "gaussian_quantized") and noise.dynamic_bias_correlation_time > 0.0
        self._sigma = noise.dynamic_bias_stddev if active else 0.0
        self._tau = noise.dynamic_bias_correlation_time
        self._value = 0.0

    def advance(self, elapsed: float, rng: np.random.Generator) -> float:
        """Return the bias after a time step. Draws no number if the sensor has no such bias.

        Parameters
        ----------
        elapsed : float
            Time step [s].
        rng : numpy.random.Generator

        Returns
        -------
        float
            In the unit of the measurement.
        """
        if self._sigma <= 0.0:
            return 0.0
        spread = self._sigma * math.sqrt(-0.5 * self._tau * math.expm1(-2.0 * elapsed / self._tau))
        self._value = math.exp(-elapsed / self._tau) * self._value + spread * float(rng.standard_normal())
        return self._value

    def reset(self) -> None:
        """Set the bias to 0."""
        self._value = 0.0


class ImuSensor:
    """Measures orientation, angular velocity and acceleration.

    Parameters
    ----------
    pose : Pose
        Sensor frame in the frame of its link.
    noise : sequence of Noise
        Empty, or six: angular velocity x y z, acceleration x y z.
    rng : numpy.random.Generator
        Source of the noise.
    reference : (4,) quaternion
        Orientation in the world that is measured as the identity.

    Raises
    ------
    ValueError
        If a parameter of the noise is invalid.
    """

    def __init__(self, pose: Pose, noise: Sequence[Noise], rng: np.random.Generator,
                 reference: Quaternion = (0.0, 0.0, 0.0, 1.0)) -> None:
        self._pose, self._reference = pose, reference
        self._noises = [NoiseModel(entry, rng, 1) for entry in noise]
        self._biases = [GaussMarkovBias(entry) for entry in noise]
        self._rng = rng
        self._velocity: Optional[Vector] = None
        self._before_ns = 0

    def start(self, state: LinkState, now_ns: int) -> None:
        """Store the velocity with which the next measurement computes the acceleration.

        Parameters
        ----------
        state : LinkState
            State of the link that carries the sensor.
        now_ns : int
            Simulated time [ns].
        """
        self._velocity, self._before_ns = self._motion(state)[1], now_ns

    def _motion(self, state: LinkState) -> Tuple[Quaternion, Vector]:
        """Return the orientation of the sensor and the velocity of its origin, both in the world."""
        pose = compose((state.position, state.orientation), self._pose)
        arm = tuple(a - b for a, b in zip(pose[0], state.position))
        rotational = cross(state.angular_velocity, arm)
        x, y, z = (a + b for a, b in zip(state.linear_velocity, rotational))
        return pose[1], (x, y, z)

    def read(self, state: LinkState, now_ns: int, gravity: Sequence[float]) -> Tuple[Quaternion, Vector, Vector]:
        """Take a measurement; :meth:`start` must have been called at an earlier time.

        Parameters
        ----------
        state : LinkState
            State of the link that carries the sensor.
        now_ns : int
            Simulated time [ns], later than that of the last call.
        gravity : (3,) sequence of float
            In the world [m/s^2].

        Returns
        -------
        orientation : (4,) tuple
            Quaternion, relative to the reference.
        rates : (3,) tuple
            Angular velocity in the sensor's frame [rad/s].
        acceleration : (3,) tuple
            Specific force in the sensor's frame [m/s^2].

        Raises
        ------
        ValueError
            If :meth:`start` has not been called.
        """
        if self._velocity is None:
            raise ValueError("an IMU measures from its second state on: call start first")
        orientation, velocity = self._motion(state)
        elapsed = (now_ns - self._before_ns) * 1e-9
        world = tuple((a - b) / elapsed - g for a, b, g in zip(velocity, self._velocity, gravity))
        self._velocity, self._before_ns = velocity, now_ns
        values = list(rotate_inverse(orientation, state.angular_velocity)) + list(rotate_inverse(orientation, world))
        for index, noise in enumerate(self._noises):
            bias = self._biases[index].advance(elapsed, self._rng)
            values[index] = _with_noise(values[index] + bias, noise)
        return (multiply(conjugate(self._reference), orientation), (values[0], values[1], values[2]),
                (values[3], values[4], values[5]))

    def reset(self, rng: np.random.Generator) -> None:
        """Restart the noise with another generator."""
        for noise, bias in zip(self._noises, self._biases):
            noise.reset(rng)
            bias.reset()
        self._rng = rng


def _with_noise(value: float, noise: NoiseModel) -> float:
    """Return a value with noise, rounded to the sensor's precision."""
    value += noise.shift + noise.stddev * float(noise.normals[noise.advance(1)])
    return noise.precision * round(value / noise.precision) if noise.precision > 0.0 else value
