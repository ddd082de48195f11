# SPDX-License-Identifier: BSD-3-Clause
"""An inertial unit: what it reads of the motion of the link that carries it.

Follows Gazebo's imu sensor: the acceleration is the change of velocity since the last reading, gravity's reaction
included (a unit at rest reads +9.8 upwards); rates and acceleration are in the unit's own axes; the orientation is
relative to a reference, the world or that of the beginning.
"""
import math

from m2wr_sim.geometry import compose, conjugate, cross, multiply, rotate_inverse
from m2wr_sim.sensors.noise import NoiseModel


class WanderingBias:
    """A bias that wanders and forgets: a first-order Gauss-Markov process that begins at 0.

    Over a time dt the value keeps the share exp(-dt / tau) and gains a normal draw of variance
    sigma^2 tau / 2 (1 - exp(-2 dt / tau)), where sigma is the noise's ``dynamic_bias_stddev`` [unit / sqrt(s)] and tau
    its ``dynamic_bias_correlation_time`` [s]: the exact discretisation, the same at any rate.
    """

    def __init__(self, noise):
        active = noise.kind in ("gaussian", "gaussian_quantized") and noise.dynamic_bias_correlation_time > 0.0
        self._sigma = noise.dynamic_bias_stddev if active else 0.0
        self._tau = noise.dynamic_bias_correlation_time
        self._value = 0.0

    def advance(self, elapsed, rng):
        """Return the bias ``elapsed`` seconds later; draws nothing where there is none."""
        if self._sigma <= 0.0:
            return 0.0
        spread = self._sigma * math.sqrt(-0.5 * self._tau * math.expm1(-2.0 * elapsed / self._tau))
        self._value = math.exp(-elapsed / self._tau) * self._value + spread * float(rng.standard_normal())
        return self._value

    def reset(self):
        """Begin at 0 again."""
        self._value = 0.0


class ImuSensor:
    """Reads orientation, turn rates and acceleration.

    Parameters
    ----------
    pose : Pose
        Of the unit in the link's frame.
    noise : sequence of Noise
        Empty, or six: rates x y z, accelerations x y z.
    rng : numpy.random.Generator
        Source of the noise.
    reference : (4,) quaternion
        World orientation that counts as none.

    Raises
    ------
    ValueError
        If the noise is not usable.
    """

    def __init__(self, pose, noise, rng, reference=(0.0, 0.0, 0.0, 1.0)):
        self._pose, self._reference = pose, reference
        self._noises = [NoiseModel(entry, rng, 1) for entry in noise]
        self._biases = [WanderingBias(entry) for entry in noise]
        self._rng = rng
        self._velocity = self._before_ns = None

    def start(self, state, now_ns):
        """Note the motion from which the next reading counts its acceleration.

        Parameters
        ----------
        state : LinkState
            Of the carrying link.
        now_ns : int
            Simulated time [ns].
        """
        self._velocity, self._before_ns = self._motion(state)[1], now_ns

    def _motion(self, state):
        """Return the unit's orientation and the velocity of its origin in the world."""
        pose = compose((state.position, state.orientation), self._pose)
        arm = tuple(a - b for a, b in zip(pose[0], state.position))
        carried = cross(state.angular_velocity, arm)
        return pose[1], tuple(a + b for a, b in zip(state.linear_velocity, carried))

    def read(self, state, now_ns, gravity):
        """Take a reading; needs :meth:`start` once before, at an earlier time.

        Returns
        -------
        orientation, rates, acceleration : tuples
            Quaternion; rad/s and m/s^2 in the unit's axes.
        """
        orientation, velocity = self._motion(state)
        elapsed = (now_ns - self._before_ns) * 1e-9
        world = tuple((a - b) / elapsed - g for a, b, g in zip(velocity, self._velocity, gravity))
        self._velocity, self._before_ns = velocity, now_ns
        values = list(rotate_inverse(orientation, state.angular_velocity)) + list(rotate_inverse(orientation, world))
        for index, noise in enumerate(self._noises):
            wandered = self._biases[index].advance(elapsed, self._rng)
            values[index] = _disturbed(values[index] + wandered, noise)
        return multiply(conjugate(self._reference), orientation), tuple(values[:3]), tuple(values[3:])

    def reset(self, rng):
        """Start the noise anew."""
        for noise, bias in zip(self._noises, self._biases):
            noise.reset(rng)
            bias.reset()
        self._rng = rng


def _disturbed(value, noise):
    value += noise.shift + noise.stddev * float(noise.normals[noise.advance(1)])
    return noise.precision * round(value / noise.precision) if noise.precision > 0.0 else value
