# SPDX-License-Identifier: BSD-3-Clause
"""Compiled versions of coupled_friction (iterative friction limits) and idle (sleeping bodies).

See step_layout for the block of memory.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import carray, njit, types

from m2wr_sim.physics.step_layout import (
    C_MODE,
    C_MU,
    C_MU2,
    C_NORMAL,
    CONTACT_WORDS,
    FORMER_WORDS,
    GRIP_WORDS,
    H_ADDRESS,
    H_BODIES,
    H_BODY_COUNT,
    H_CONTACTS,
    H_FORMER,
    H_FORMER_COUNT,
    H_FORMER_STEP,
    H_GRIPS,
    H_GROUP,
    H_IDLER_COUNT,
    H_IDLERS,
    H_ISLANDS,
    H_KEPT,
    H_SOLVES,
    H_SPACE_COUNT,
    H_SPACES,
    H_STATES,
    H_STEPS,
    H_WORLD,
    I_BODY,
    I_STEPS,
    I_TIME,
    IDLE_WORDS,
    ISLAND_WORDS,
    J_COUPLED,
    J_FEEDBACK,
    J_FIRST,
    J_ISLAND,
    J_JOINT,
    J_KEY,
    J_MODEL,
    J_MU,
    J_MU2,
    J_NORMAL,
    J_ROOM,
    J_SECOND,
    MODE_APPROX1,
    S_BODY_COUNT,
    S_FIRST_BODY,
    SPACE_WORDS,
    STATE_WORDS,
    T_FROZEN,
    X_AGAIN,
    X_AWAKE,
    X_CHANGE,
    X_CONTACTS,
    X_FOR,
    X_GREATEST,
    X_STEP,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

_AGREED = 0.001                                         # as in contacts
AGAIN, AGREES = 1, 2                                    # of an island with a coupled contact
_LINEAR, _ANGULAR, _STEPS, _TIME = 0.1, 0.1, 5.0, 1.0   # as in idle

_handle = types.uintp
_numbers = types.CPointer(types.float64)
_create_contact = types.ExternalFunction("dJointCreateContact", _handle(_handle, _handle, _handle))
_attach = types.ExternalFunction("dJointAttach", types.void(_handle, _handle, _handle))
_set_feedback = types.ExternalFunction("dJointSetFeedback", types.void(_handle, _handle))
_joint_count = types.ExternalFunction("dBodyGetNumJoints", types.int32(_handle))
_enable = types.ExternalFunction("dBodyEnable", types.void(_handle))
_disable = types.ExternalFunction("dBodyDisable", types.void(_handle))
_is_enabled = types.ExternalFunction("dBodyIsEnabled", types.int32(_handle))
_position = types.ExternalFunction("dBodyGetPosition", _numbers(_handle))
_quaternion = types.ExternalFunction("dBodyGetQuaternion", _numbers(_handle))
_linear_velocity = types.ExternalFunction("dBodyGetLinearVel", _numbers(_handle))
_angular_velocity = types.ExternalFunction("dBodyGetAngularVel", _numbers(_handle))
_force = types.ExternalFunction("dBodyGetForce", _numbers(_handle))
_torque = types.ExternalFunction("dBodyGetTorque", _numbers(_handle))
_three = types.void(_handle, types.float64, types.float64, types.float64)
_set_position = types.ExternalFunction("dBodySetPosition", _three)
_set_quaternion = types.ExternalFunction("dBodySetQuaternion", types.void(_handle, _handle))
_set_linear_velocity = types.ExternalFunction("dBodySetLinearVel", _three)
_set_angular_velocity = types.ExternalFunction("dBodySetAngularVel", _three)
_set_force = types.ExternalFunction("dBodySetForce", _three)
_set_torque = types.ExternalFunction("dBodySetTorque", _three)
_world_step = types.ExternalFunction("dWorldStep", types.int32(_handle, types.float64))


@njit(cache=True, nogil=True, error_model="numpy")
def stands_for(words: Words, model: int) -> Any:
    """Return the row of the model that represents the island of a model in this step.

    Parameters
    ----------
    words : (W,) uint64
        The block.
    model : int
        Number of the model, counted in ``H_SPACES``.

    Returns
    -------
    int
        A row of ``H_ISLANDS``.
    """
    row = np.int64(words[H_ISLANDS] + model * np.uint64(ISLAND_WORDS))
    if words[row + X_STEP] != words[H_STEPS]:
        words[row + X_STEP], words[row + X_FOR] = words[H_STEPS], np.uint64(row)
        words[row + X_CONTACTS] = words[row + X_AWAKE] = words[row + X_AGAIN] = np.uint64(0)
    while words[row + X_FOR] != np.uint64(row):
        words[row + X_FOR] = words[np.int64(words[row + X_FOR]) + X_FOR]        # shortens the path for the next call
        row = np.int64(words[row + X_FOR])
    return row


@njit(cache=True, nogil=True, error_model="numpy")
def restart_countdown(words: Words, values: Values, number: int) -> None:
    """Restart the idle time of a body that was woken.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    number : int
        Number of the body, counted from 1 in ``H_IDLERS``; 0 means none.
    """
    if number != 0:
        row = np.int64(words[H_IDLERS]) + (np.int64(number) - 1) * IDLE_WORDS
        values[row + I_STEPS], values[row + I_TIME] = _STEPS, _TIME


@njit(cache=True, nogil=True, error_model="numpy")
def count_down(words: Words, values: Values, dt: float) -> None:
    """Count a step for the bodies that may sleep, as idle.count_down does.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    dt : float
        Step size [s].
    """
    for index in range(np.int64(words[H_IDLER_COUNT])):
        row = np.int64(words[H_IDLERS]) + index * IDLE_WORDS
        body = words[row + I_BODY]
        if not _is_enabled(body) or _joint_count(body) == 0:
            continue
        linear, angular = carray(_linear_velocity(body), (3,)), carray(_angular_velocity(body), (3,))
        if (linear[0] * linear[0] + linear[1] * linear[1] + linear[2] * linear[2] > _LINEAR * _LINEAR
                or angular[0] * angular[0] + angular[1] * angular[1] + angular[2] * angular[2] > _ANGULAR * _ANGULAR):
            values[row + I_STEPS], values[row + I_TIME] = _STEPS, _TIME
            continue
        values[row + I_STEPS] -= 1.0
        values[row + I_TIME] -= dt
        if values[row + I_STEPS] <= 0.0 and values[row + I_TIME] <= 0.0:
            _disable(body)
            _set_linear_velocity(body, 0.0, 0.0, 0.0)
            _set_angular_velocity(body, 0.0, 0.0, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _keep_state(words: Words, values: Values, index: int) -> None:
    """Store the state of a body before the next solution."""
    body, at = words[np.int64(words[H_BODIES]) + index], np.int64(words[H_STATES]) + index * STATE_WORDS
    position, quaternion = carray(_position(body), (3,)), carray(_quaternion(body), (4,))
    linear, angular = carray(_linear_velocity(body), (3,)), carray(_angular_velocity(body), (3,))
    force, torque = carray(_force(body), (3,)), carray(_torque(body), (3,))
    for axis in range(3):
        values[at + axis], values[at + 7 + axis] = position[axis], linear[axis]
        values[at + 10 + axis] = angular[axis]
        values[at + 13 + axis], values[at + 16 + axis] = force[axis], torque[axis]
    for axis in range(4):
        values[at + 3 + axis] = quaternion[axis]


@njit(cache=True, nogil=True, error_model="numpy")
def _restore_state(words: Words, values: Values, index: int) -> None:
    """Restore the state of a body from before the solution."""
    body, at = words[np.int64(words[H_BODIES]) + index], np.int64(words[H_STATES]) + index * STATE_WORDS
    _set_position(body, values[at], values[at + 1], values[at + 2])
    _set_quaternion(body, words[H_ADDRESS] + np.uint64(8 * (at + 3)))
    _set_linear_velocity(body, values[at + 7], values[at + 8], values[at + 9])
    _set_angular_velocity(body, values[at + 10], values[at + 11], values[at + 12])
    _set_force(body, values[at + 13], values[at + 14], values[at + 15])
    _set_torque(body, values[at + 16], values[at + 17], values[at + 18])


@njit(cache=True, nogil=True, error_model="numpy")
def _replace(words: Words, values: Values, index: int) -> None:
    """Replace a contact joint by one with friction limited by its normal force; the old joint stays, detached."""
    grip, at = (np.int64(words[H_GRIPS]) + index * GRIP_WORDS, np.int64(words[H_CONTACTS]) + index * CONTACT_WORDS)
    normal = values[grip + J_NORMAL]
    words[at + C_MODE] &= ~MODE_APPROX1
    values[at + C_MU] = values[grip + J_MU] * normal if normal > 0.0 else 0.0
    values[at + C_MU2] = values[grip + J_MU2] * normal if normal > 0.0 else 0.0
    _attach(words[grip + J_JOINT], np.uint64(0), np.uint64(0))
    joint = _create_contact(words[H_WORLD], words[H_GROUP], words[H_ADDRESS] + np.uint64(8 * at))
    _attach(joint, words[grip + J_FIRST], words[grip + J_SECOND])
    _set_feedback(joint, words[grip + J_FEEDBACK])
    words[grip + J_JOINT] = joint


@njit(cache=True, nogil=True, error_model="numpy")
def _recall(words: Words, values: Values) -> None:
    """Set the normal forces of contacts in coupled islands from the last step; new contacts have none."""
    count, seen = np.int64(words[H_FORMER_COUNT]), 0
    if words[H_FORMER_STEP] + np.uint64(1) != words[H_STEPS]:
        count = np.int64(0)
    for index in range(np.int64(words[H_KEPT])):
        grip = np.int64(words[H_GRIPS]) + index * GRIP_WORDS
        if words[np.int64(words[grip + J_ISLAND]) + X_AGAIN] == 0:
            continue
        values[grip + J_NORMAL] = -1.0
        if words[grip + J_FEEDBACK] == 0:
            words[grip + J_FEEDBACK] = words[H_ADDRESS] + np.uint64(8 * (grip + J_ROOM))
            _set_feedback(words[grip + J_JOINT], words[grip + J_FEEDBACK])
        for further in range(count):                    # the order is usually the same
            row = np.int64(words[H_FORMER]) + (seen + further) % count * FORMER_WORDS
            if words[row] == words[grip + J_KEY]:
                seen += further + 1
                values[grip + J_NORMAL] = values[row + 1]
                _replace(words, values, index)
                break


@njit(cache=True, nogil=True, error_model="numpy")
def _remember(words: Words, values: Values) -> None:
    """Store the normal forces of the contacts in coupled islands for the next step."""
    count = 0
    for index in range(np.int64(words[H_KEPT])):
        grip = np.int64(words[H_GRIPS]) + index * GRIP_WORDS
        if words[np.int64(words[grip + J_ISLAND]) + X_AGAIN] != 0:
            row = np.int64(words[H_FORMER]) + count * FORMER_WORDS
            words[row], values[row + 1] = words[grip + J_KEY], values[grip + J_NORMAL]
            count += 1
    words[H_FORMER_COUNT], words[H_FORMER_STEP] = np.uint64(count), words[H_STEPS]


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(words: Words, values: Values) -> None:
    """Find the islands with a coupled contact, and store the states of their bodies."""
    kept, grips = np.int64(words[H_KEPT]), np.int64(words[H_GRIPS])
    for index in range(kept):
        grip = grips + index * GRIP_WORDS
        island = stands_for(words, words[grip + J_MODEL])
        words[grip + J_ISLAND] = np.uint64(island)
        if words[grip + J_COUPLED] != 0:
            words[island + X_AGAIN] = np.uint64(AGAIN)
    for model in range(np.int64(words[H_SPACE_COUNT])):
        row = np.int64(words[H_SPACES]) + model * SPACE_WORDS
        again = words[stands_for(words, np.uint64(model)) + X_AGAIN] != 0
        for number in range(np.int64(words[row + S_BODY_COUNT])):
            body = np.int64(words[row + S_FIRST_BODY]) + number
            words[np.int64(words[H_STATES]) + body * STATE_WORDS + T_FROZEN] = np.uint64(0)
            if again:
                _keep_state(words, values, body)


@njit(cache=True, nogil=True, error_model="numpy")
def _normal_force(words: Words, values: Values, index: int) -> float:
    """Return the normal force of a contact from the last solution; 0 between sleeping bodies."""
    grip = np.int64(words[H_GRIPS]) + index * GRIP_WORDS
    normal = np.int64(words[H_CONTACTS]) + index * CONTACT_WORDS + C_NORMAL
    for body in (words[grip + J_FIRST], words[grip + J_SECOND]):
        if body != 0 and _is_enabled(body):
            at = np.int64((words[grip + J_FEEDBACK] - words[H_ADDRESS]) // np.uint64(8))
            return abs(values[at] * values[normal] + values[at + 1] * values[normal + 1]
                       + values[at + 2] * values[normal + 2])
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _limit(words: Words, values: Values) -> bool:
    """Compute the friction limits from the normal forces; return whether none of them has changed."""
    kept, grips = np.int64(words[H_KEPT]), np.int64(words[H_GRIPS])
    for index in range(kept):
        island = np.int64(words[grips + index * GRIP_WORDS + J_ISLAND])
        values[island + X_CHANGE] = values[island + X_GREATEST] = 0.0
    for index in range(kept):
        grip = grips + index * GRIP_WORDS
        island = np.int64(words[grip + J_ISLAND])
        if words[island + X_AGAIN] != AGAIN:
            continue
        felt, used = _normal_force(words, values, index), values[grip + J_NORMAL]
        values[grip + J_NORMAL] = felt if used < 0.0 else 0.5 * (used + felt)
        values[island + X_CHANGE] = max(values[island + X_CHANGE], abs(felt - max(used, 0.0)))
        values[island + X_GREATEST] = max(values[island + X_GREATEST], felt)
    agreed = True
    for index in range(kept):
        island = np.int64(words[grips + index * GRIP_WORDS + J_ISLAND])
        if words[island + X_AGAIN] == AGAIN:
            if values[island + X_CHANGE] <= _AGREED * values[island + X_GREATEST]:
                words[island + X_AGAIN] = np.uint64(AGREES)
            else:
                agreed = False
    return agreed


@njit(cache=True, nogil=True, error_model="numpy")
def _take_back(words: Words, values: Values) -> None:
    """Bring back the bodies and contacts of the islands to be solved again; all others keep still from here on."""
    for model in range(np.int64(words[H_SPACE_COUNT])):
        row = np.int64(words[H_SPACES]) + model * SPACE_WORDS
        again = words[stands_for(words, np.uint64(model)) + X_AGAIN] == AGAIN
        for number in range(np.int64(words[row + S_BODY_COUNT])):
            index = np.int64(words[row + S_FIRST_BODY]) + number
            body = words[np.int64(words[H_BODIES]) + index]
            if again:
                _restore_state(words, values, index)
            elif _is_enabled(body):
                words[np.int64(words[H_STATES]) + index * STATE_WORDS + T_FROZEN] = np.uint64(1)
                _disable(body)                          # libode does not solve sleeping bodies
    for contact in range(np.int64(words[H_KEPT])):
        grip = np.int64(words[H_GRIPS]) + contact * GRIP_WORDS
        if words[np.int64(words[grip + J_ISLAND]) + X_AGAIN] == AGAIN:
            _replace(words, values, contact)


@njit(cache=True, nogil=True, error_model="numpy")
def solve_coupled(words: Words, values: Values, world: int, dt: float) -> None:
    """Solve a step until limits of friction and normal forces agree, as coupled_friction.solve_coupled does.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    world : int
        Native handle of the world.
    dt : float
        Step size [s].
    """
    _gather(words, values)
    _recall(words, values)
    solves = np.int64(words[H_SOLVES])
    for solve in range(solves):
        _world_step(world, dt)
        if _limit(words, values) or solve + 1 == solves:
            break
        _take_back(words, values)
    _remember(words, values)
    for index in range(np.int64(words[H_BODY_COUNT])):
        if words[np.int64(words[H_STATES]) + index * STATE_WORDS + T_FROZEN] != 0:
            _enable(words[np.int64(words[H_BODIES]) + index])
