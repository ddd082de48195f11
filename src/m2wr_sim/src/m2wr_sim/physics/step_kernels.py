# SPDX-License-Identifier: BSD-3-Clause
"""The stepping loop, compiled: libode is called by name, without Python objects.

It works on one block of memory, see step_layout.  The symbols of libode must be known to the compiler before this
module is imported; see native_ode.publish_symbols.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import carray, njit, types

from m2wr_sim.physics.broad_phase_kernels import is_free, sleeps_apart
from m2wr_sim.physics.contact_kernels import rotate
from m2wr_sim.physics.coupled_kernels import count_down, solve_coupled
from m2wr_sim.physics.near_kernels import make_contacts
from m2wr_sim.physics.step_layout import (
    CONTACT_PAIR_WORDS,
    DAMPED_WORDS,
    H_ADDRESS,
    H_BEFORE,
    H_BEFORE_COUNT,
    H_BODIES,
    H_BODY_COUNT,
    H_BOUNDED,
    H_CALLBACK,
    H_CALLBACK_ITSELF,
    H_CONTACT_PAIR_ROOM,
    H_COUPLED,
    H_DAMPED_JOINT_COUNT,
    H_DAMPED_JOINTS,
    H_DAMPED_LINK_COUNT,
    H_DAMPED_LINKS,
    H_DT,
    H_GROUP,
    H_HINGE_COUNT,
    H_HINGES,
    H_IDLER_COUNT,
    H_ISLAND_LIMIT,
    H_ITERATIVE,
    H_KEPT,
    H_LARGEST_ISLAND,
    H_LOG,
    H_LOG_COUNT,
    H_LOG_ROOM,
    H_LOST,
    H_MOVING,
    H_NOW,
    H_NOW_COUNT,
    H_PLANE,
    H_QUICK,
    H_REPORT_COUNT,
    H_SLEEPERS,
    H_SOLVES,
    H_SPACE_COUNT,
    H_SPACES,
    H_STATIC,
    H_STEPS,
    H_WORLD,
    HINGE_WORDS,
    LOG_WORDS,
    MANY_REPORTS,
    S_GEOM_COUNT,
    S_MEETS_ITSELF,
    SHAPE_OFFSET,
    SHAPE_SHIFT,
    SPACE_WORDS,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

_TOO_FAST, _TOO_FAR = 1e9, 1e8      # m/s and rad/s, m; as in engine
_PARAM_VEL = 2
HINGE, UNIVERSAL_1, UNIVERSAL_2 = 0, 1, 2       # as in joint_axes; else a piston
# Steps, and error [rad] of the integrated rates, after which the angles of hinges are read and rotations counted.
_UNWRAP_AFTER, _GREATEST_ERROR = 8, 1.0

_handle = types.uintp
_numbers = types.CPointer(types.float64)
_space_collide = types.ExternalFunction("dSpaceCollide", types.void(_handle, _handle, _handle))
_space_collide2 = types.ExternalFunction("dSpaceCollide2", types.void(_handle, _handle, _handle, _handle))
_space_geom = types.ExternalFunction("dSpaceGetGeom", _handle(_handle, types.int32))
_group_empty = types.ExternalFunction("dJointGroupEmpty", types.void(_handle))
_hinge_angle = types.ExternalFunction("dJointGetHingeAngle", types.float64(_handle))
_hinge_rate = types.ExternalFunction("dJointGetHingeAngleRate", types.float64(_handle))
_universal_angle_1 = types.ExternalFunction("dJointGetUniversalAngle1", types.float64(_handle))
_universal_rate_1 = types.ExternalFunction("dJointGetUniversalAngle1Rate", types.float64(_handle))
_universal_angle_2 = types.ExternalFunction("dJointGetUniversalAngle2", types.float64(_handle))
_universal_rate_2 = types.ExternalFunction("dJointGetUniversalAngle2Rate", types.float64(_handle))
_piston_angle = types.ExternalFunction("dJointGetPistonAngle", types.float64(_handle))
_piston_rate = types.ExternalFunction("dJointGetPistonAngleRate", types.float64(_handle))
_slider_at = types.ExternalFunction("dJointGetSliderPosition", types.float64(_handle))
_set_hinge = types.ExternalFunction("dJointSetHingeParam", types.void(_handle, types.int32, types.float64))
_slider_rate = types.ExternalFunction("dJointGetSliderPositionRate", types.float64(_handle))
_add_hinge_torque = types.ExternalFunction("dJointAddHingeTorque", types.void(_handle, types.float64))
_add_slider_force = types.ExternalFunction("dJointAddSliderForce", types.void(_handle, types.float64))
_set_angular_motor = types.ExternalFunction("dJointSetAMotorParam", types.void(_handle, types.int32, types.float64))
_set_linear_motor = types.ExternalFunction("dJointSetLMotorParam", types.void(_handle, types.int32, types.float64))
_position = types.ExternalFunction("dBodyGetPosition", _numbers(_handle))
_quaternion = types.ExternalFunction("dBodyGetQuaternion", _numbers(_handle))
_linear_velocity = types.ExternalFunction("dBodyGetLinearVel", _numbers(_handle))
_angular_velocity = types.ExternalFunction("dBodyGetAngularVel", _numbers(_handle))
_set_linear_velocity = types.ExternalFunction(
    "dBodySetLinearVel", types.void(_handle, types.float64, types.float64, types.float64))
_set_angular_velocity = types.ExternalFunction(
    "dBodySetAngularVel", types.void(_handle, types.float64, types.float64, types.float64))
_world_step = types.ExternalFunction("dWorldStep", types.int32(_handle, types.float64))
_world_quick_step = types.ExternalFunction("dWorldQuickStep", types.int32(_handle, types.float64))
_random_seed = types.ExternalFunction("dRandGetSeed", types.uintp())
_seed_random = types.ExternalFunction("dRandSetSeed", types.void(types.uintp))


@njit(cache=True, nogil=True, error_model="numpy")
def _damp(words: Words, values: Values) -> None:
    """Apply the damping of joints and bodies, as PyodeEngine does."""
    for index in range(np.int64(words[H_DAMPED_JOINT_COUNT])):
        row = np.int64(words[H_DAMPED_JOINTS]) + index * DAMPED_WORDS
        joint, damping, hinge, stiffness = words[row], values[row + 1], words[row + 2] != 0, values[row + 3]
        away = (_hinge_angle(joint) if hinge else _slider_at(joint)) - values[row + 4]
        motor, pull = words[row + 5], values[row + 6]
        if motor != 0:
            if hinge:
                _set_angular_motor(motor, _PARAM_VEL, -pull * away)
            else:
                _set_linear_motor(motor, _PARAM_VEL, -pull * away)
        elif hinge:
            _add_hinge_torque(joint, -damping * _hinge_rate(joint) - stiffness * away)
        else:
            _add_slider_force(joint, -damping * _slider_rate(joint) - stiffness * away)
    for index in range(np.int64(words[H_DAMPED_LINK_COUNT])):
        row = np.int64(words[H_DAMPED_LINKS]) + index * DAMPED_WORDS
        body, linear_kept, angular_kept = words[row], values[row + 1], values[row + 2]
        linear, angular = carray(_linear_velocity(body), (3,)), carray(_angular_velocity(body), (3,))
        _set_linear_velocity(body, linear_kept * linear[0], linear_kept * linear[1], linear_kept * linear[2])
        _set_angular_velocity(body, angular_kept * angular[0], angular_kept * angular[1], angular_kept * angular[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _angle(words: Words, row: int) -> float:
    """Return the angle of an axis, without full rotations."""
    joint, reading = words[row], words[row + 3]
    if reading == HINGE:
        return _hinge_angle(joint)
    if reading == UNIVERSAL_1:
        return _universal_angle_1(joint)
    return _universal_angle_2(joint) if reading == UNIVERSAL_2 else _piston_angle(joint)


@njit(cache=True, nogil=True, error_model="numpy")
def _rate(words: Words, row: int) -> float:
    """Return the rate of an axis that rotates."""
    joint, reading = words[row], words[row + 3]
    if reading == HINGE:
        return _hinge_rate(joint)
    if reading == UNIVERSAL_1:
        return _universal_rate_1(joint)
    return _universal_rate_2(joint) if reading == UNIVERSAL_2 else _piston_rate(joint)


@njit(cache=True, nogil=True, error_model="numpy")
def _integrate_hinges(words: Words, values: Values, dt: float) -> float:
    """Integrate the rates of the hinges over a step, which is faster than reading their angles.

    Returns the greatest error [rad]: libode rotates a body by ``2 atan(0.5 rate dt)``.
    """
    error = 0.0
    for index in range(np.int64(words[H_HINGE_COUNT])):
        row = np.int64(words[H_HINGES]) + index * HINGE_WORDS
        rotation = _rate(words, row) * dt
        values[row + 2] += rotation
        error = max(error, abs(rotation * rotation * rotation) / 12.0)
    return error


@njit(cache=True, nogil=True, error_model="numpy")
def _unwrap(words: Words, values: Values) -> None:
    """Count full rotations: take the angle that fits the reading and is nearest to the prediction by the rates."""
    for index in range(np.int64(words[H_HINGE_COUNT])):
        row = np.int64(words[H_HINGES]) + index * HINGE_WORDS
        raw = _angle(words, row)
        predicted = values[row + 1] + values[row + 2]
        values[row + 2] = 0.0
        # plus zero, because -0 rotations are 0: a hinge at rest reads 0, never -0
        values[row + 1] = raw + (2.0 * math.pi * np.rint((predicted - raw) / (2.0 * math.pi)) + 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _lost_body(words: Words) -> int:
    """Return the number, counted from 1, of the first body that is not finite, too far or too fast; 0 if there is none.

    Otherwise libode would abort the process in the next step.
    """
    first = np.int64(words[H_BODIES])
    for index in range(np.int64(words[H_BODY_COUNT])):
        body = words[first + index]
        at, speed = carray(_position(body), (3,)), carray(_linear_velocity(body), (3,))
        rate = carray(_angular_velocity(body), (3,))
        fast = abs(speed[0]) + abs(speed[1]) + abs(speed[2]) + abs(rate[0]) + abs(rate[1]) + abs(rate[2])
        if not (abs(at[0]) + abs(at[1]) + abs(at[2]) < _TOO_FAR and fast < _TOO_FAST):
            return index + 1
    return 0


@njit(cache=True, nogil=True, error_model="numpy")
def _log_contacts(words: Words, values: Values) -> None:
    """Log the pairs in contact that were not in the last step; then make this step the last one."""
    past, before = 0, np.int64(words[H_BEFORE_COUNT])
    for index in range(np.int64(words[H_NOW_COUNT])):
        row = np.int64(words[H_NOW]) + index * CONTACT_PAIR_WORDS
        known = False
        for _ in range(before):         # begin after the one found last: the order is nearly that of the last step
            other = np.int64(words[H_BEFORE]) + past * CONTACT_PAIR_WORDS
            past = past + 1 if past + 1 < before else 0
            if words[row] == words[other] and words[row + 1] == words[other + 1]:
                known = True
                break
        count = np.int64(words[H_LOG_COUNT])
        if not known:
            log = np.int64(words[H_LOG]) + count * LOG_WORDS
            words[log] = words[H_STEPS]
            for word in range(CONTACT_PAIR_WORDS):
                words[log + 1 + word] = words[row + word]
            words[H_LOG_COUNT] = np.uint64(count + 1)
    words[H_NOW], words[H_BEFORE] = words[H_BEFORE], words[H_NOW]
    words[H_BEFORE_COUNT], words[H_NOW_COUNT] = words[H_NOW_COUNT], np.uint64(0)


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(words: Words, values: Values, world: int, dt: float, quick: bool) -> None:
    """Solve for the forces and move the bodies by libode, as PyodeEngine does."""
    if quick:
        _world_quick_step(world, dt)
    elif words[H_LARGEST_ISLAND] <= words[H_ISLAND_LIMIT]:
        if words[H_COUPLED] == 1 and words[H_SOLVES] > 1:
            solve_coupled(words, values, world, dt)
        else:
            _world_step(world, dt)
    else:
        before = _random_seed()
        _seed_random(words[H_STEPS])
        _world_quick_step(world, dt)
        _seed_random(before)
        words[H_ITERATIVE] = np.uint64(1)


@njit(cache=True, nogil=True, error_model="numpy")
def _find_contacts(words: Words, values: Values) -> None:
    """Find the contacts of a step, in the order of PyodeEngine."""
    data, callback = words[H_ADDRESS], words[H_CALLBACK]
    spaces, space_count = np.int64(words[H_SPACES]), np.int64(words[H_SPACE_COUNT])
    bounded, sleepers = words[H_BOUNDED] != 0, words[H_SLEEPERS] != 0
    tested = 0
    for index in range(space_count):
        row = spaces + index * SPACE_WORDS
        free = bounded and words[row + S_GEOM_COUNT] != 0 and is_free(words, values, row)
        if free and sleepers and words[row + S_MEETS_ITSELF] == 0 and sleeps_apart(words, values, row):
            continue
        tested += 1
        if free:
            for number in range(np.int64(words[row + S_GEOM_COUNT])):
                make_contacts(words, values, words[H_PLANE], _space_geom(words[row], number))
        else:
            _space_collide2(words[row], words[H_STATIC], data, callback)
        if words[row + S_MEETS_ITSELF]:
            _space_collide(words[row], data, words[H_CALLBACK_ITSELF])
    if tested > 1:
        _space_collide(words[H_MOVING], data, callback)


@njit(cache=True, nogil=True, error_model="numpy")
def run(words: Words, steps: int) -> int:
    """Make steps.

    Parameters
    ----------
    words : (W,) uint64
        The block.
    steps : int
        Number of steps to make.

    Returns
    -------
    int
        Number of steps made.  It is lower if the log of contacts or the ring of reports might overflow, after each step
        with a large island, and after a step in which a body left the world; the number of the body is then in
        ``H_LOST``.  It is negative if the block has events to read, so that the caller need not check for them.
    """
    values = words.view(np.float64)
    dt = values[H_DT]
    world, group = words[H_WORLD], words[H_GROUP]
    quick = words[H_QUICK] != 0
    damped = words[H_DAMPED_JOINT_COUNT] + words[H_DAMPED_LINK_COUNT] != 0
    idlers = words[H_IDLER_COUNT] != 0
    taken = read = 0
    error = 0.0
    while (taken < steps and words[H_LOG_COUNT] + words[H_CONTACT_PAIR_ROOM] <= words[H_LOG_ROOM]
           and words[H_REPORT_COUNT] < MANY_REPORTS and not words[H_ITERATIVE]):
        taken += 1
        words[H_STEPS] += np.uint64(1)
        if damped:
            _damp(words, values)
        words[H_LARGEST_ISLAND] = words[H_KEPT] = words[H_COUPLED] = np.uint64(0)
        _find_contacts(words, values)
        if idlers:
            count_down(words, values, dt)
        _solve(words, values, world, dt, quick)
        _group_empty(group)
        if words[H_NOW_COUNT] or words[H_BEFORE_COUNT]:
            _log_contacts(words, values)
        lost = _lost_body(words)
        if lost:
            words[H_LOST] = np.uint64(lost)
            return -taken
        error += _integrate_hinges(words, values, dt)
        if taken - read == _UNWRAP_AFTER or error > _GREATEST_ERROR:
            _unwrap(words, values)
            read, error = taken, 0.0
    if taken != read:
        _unwrap(words, values)
    nearly_full = np.uint64(2) * words[H_BEFORE_COUNT] > words[H_CONTACT_PAIR_ROOM]
    return -taken if words[H_LOG_COUNT] or words[H_REPORT_COUNT] or words[H_ITERATIVE] or nearly_full else taken


@njit(cache=True, nogil=True, error_model="numpy")
def set_hinge_rate(hinge: int, rate: float) -> None:
    """Set the rate that the motor of a hinge tries to reach.

    Parameters
    ----------
    hinge : int
        Native handle.
    rate : float
        [rad/s]
    """
    _set_hinge(hinge, _PARAM_VEL, rate)


@njit(cache=True, nogil=True, error_model="numpy")
def read_poses(shapes: Words, poses: Values) -> None:
    """Write the world poses of shapes that are fixed to bodies.

    Parameters
    ----------
    shapes : (n, SHAPE_WORDS) uint64
        Body of each shape; as floats the centre of mass of its link, in link axes; the pose of the shape in the link
        frame: x y z, then the quaternion x y z w.
    poses : (n, 7) float64
        Written; in the same order.
    """
    values = shapes.view(np.float64)
    for k in range(shapes.shape[0]):
        at, quaternion = carray(_position(shapes[k, 0]), (3,)), carray(_quaternion(shapes[k, 0]), (4,))
        shift, offset = values[k, SHAPE_SHIFT:SHAPE_OFFSET], values[k, SHAPE_OFFSET:]
        w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
        cx, cy, cz = rotate(x, y, z, w, shift[0], shift[1], shift[2])
        dx, dy, dz = rotate(x, y, z, w, offset[0], offset[1], offset[2])
        poses[k, 0], poses[k, 1], poses[k, 2] = at[0] - cx + dx, at[1] - cy + dy, at[2] - cz + dz
        qx, qy, qz, qw = offset[3], offset[4], offset[5], offset[6]
        poses[k, 3] = w * qx + x * qw + y * qz - z * qy
        poses[k, 4] = w * qy - x * qz + y * qw + z * qx
        poses[k, 5] = w * qz + x * qy - y * qx + z * qw
        poses[k, 6] = w * qw - x * qx - y * qy - z * qz


@njit(cache=True, nogil=True, error_model="numpy")
def read_motion(shapes: Words, motion: Values) -> None:
    """Write the world pose of a shape that is fixed to a body, and the velocity of its link.

    Parameters
    ----------
    shapes : (1, SHAPE_WORDS) uint64
        As for :func:`read_poses`.
    motion : (1, 13) float64
        Written: the pose, the linear velocity of the origin of the link, the angular velocity.
    """
    read_poses(shapes, motion[:, :7])
    values, body = shapes.view(np.float64), shapes[0, 0]
    quaternion, speed = carray(_quaternion(body), (4,)), carray(_linear_velocity(body), (3,))
    rate, shift = carray(_angular_velocity(body), (3,)), values[0, SHAPE_SHIFT:SHAPE_OFFSET]
    cx, cy, cz = rotate(quaternion[1], quaternion[2], quaternion[3], quaternion[0], shift[0], shift[1], shift[2])
    motion[0, 7] = speed[0] - (rate[1] * cz - rate[2] * cy)
    motion[0, 8] = speed[1] - (rate[2] * cx - rate[0] * cz)
    motion[0, 9] = speed[2] - (rate[0] * cy - rate[1] * cx)
    motion[0, 10], motion[0, 11], motion[0, 12] = rate[0], rate[1], rate[2]
