# SPDX-License-Identifier: BSD-3-Clause
"""The stepping loop and the contact callback, compiled: libode is called by name, without Python objects.

Both work on one block of memory, see step_layout.  The symbols of libode must be known to the compiler before this
module is imported; see native_ode.publish_symbols.
"""
import math

import numpy as np
from numba import carray, cfunc, njit, types

from m2wr_sim.physics.broad_phase_kernels import is_free, sleeps_apart
from m2wr_sim.physics.contact_kernels import FACES, deepest_faces, merge, merge_faces, rotate, spread, with_direction
from m2wr_sim.physics.coupled_kernels import count_down, restart_countdown, solve_coupled, stands_for
from m2wr_sim.physics.step_layout import (
    C_ALONG,
    C_BOUNCE,
    C_BOUNCE_VELOCITY,
    C_DEPTH,
    C_GEOMETRY,
    C_MODE,
    C_MU,
    C_MU2,
    C_NORMAL,
    C_POSITION,
    C_SLIP1,
    C_SLIP2,
    C_SOFT_CFM,
    C_SOFT_ERP,
    CONTACT_PAIR_WORDS,
    CONTACT_WORDS,
    DAMPED_WORDS,
    G_BODY,
    G_CLASS,
    G_IDLER,
    G_LINK,
    G_MODEL,
    G_RESTLESS,
    G_WATCHED,
    GEOM_WORDS,
    GRIP_WORDS,
    H_ADDRESS,
    H_BEFORE,
    H_BEFORE_COUNT,
    H_BODIES,
    H_BODY_COUNT,
    H_BOUNDED,
    H_CALLBACK,
    H_CALLBACK_ITSELF,
    H_CLASS_COUNT,
    H_CONTACT_PAIR_ROOM,
    H_CONTACTS,
    H_COUPLED,
    H_DAMPED_JOINT_COUNT,
    H_DAMPED_JOINTS,
    H_DAMPED_LINK_COUNT,
    H_DAMPED_LINKS,
    H_DT,
    H_GEOMS,
    H_GRIPS,
    H_GROUP,
    H_HINGE_COUNT,
    H_HINGES,
    H_IDLER_COUNT,
    H_ISLAND_LIMIT,
    H_ITERATIVE,
    H_KEPT,
    H_KEPT_ROOM,
    H_LARGEST_ISLAND,
    H_LOG,
    H_LOG_COUNT,
    H_LOG_ROOM,
    H_LOST,
    H_MISSED,
    H_MOVING,
    H_NOW,
    H_NOW_COUNT,
    H_PAIRS,
    H_PLANE,
    H_QUICK,
    H_REPORT_COUNT,
    H_REPORTS,
    H_SIZE,
    H_SLEEPERS,
    H_SOLVES,
    H_SPACE_COUNT,
    H_SPACES,
    H_STATIC,
    H_STEPS,
    H_WATCHING,
    H_WORLD,
    HEADER_WORDS,
    HINGE_WORDS,
    J_COUPLED,
    J_FEEDBACK,
    J_FIRST,
    J_JOINT,
    J_KEY,
    J_MODEL,
    J_MU,
    J_MU2,
    J_SECOND,
    KEY_NUMBERS,
    KEY_ROWS,
    LOG_WORDS,
    MANY_REPORTS,
    MAX_FOUND,
    MAX_REPORTS,
    MODE_FDIR1,
    P_ALONG_SECOND,
    P_ALONG_X,
    P_ALONG_Y,
    P_ALONG_Z,
    P_BOTH_MOVE,
    P_BOUNCE,
    P_BOUNCE_VELOCITY,
    P_GROUND,
    P_MAX_CONTACTS,
    P_MERGE,
    P_MODE,
    P_MU,
    P_MU2,
    P_SLIP1,
    P_SLIP2,
    P_SOFT_CFM,
    P_SOFT_ERP,
    P_VALID,
    PAIR_WORDS,
    R_FEEDBACK,
    R_GEOMETRY,
    REPORT_WORDS,
    S_GEOM_COUNT,
    S_MEETS_ITSELF,
    SHAPE_OFFSET,
    SHAPE_SHIFT,
    SPACE_WORDS,
    X_AWAKE,
    X_CONTACTS,
    X_FOR,
)

_TOO_FAST, _TOO_FAR = 1e9, 1e8      # m/s and rad/s, m; as in engine
_PARAM_VEL = 2
_UNWRAP_AFTER, _ASTRAY = 8, 1.0     # steps, and rad of error of the integrated rates, before rotations are counted
_STEEP, _FLAT = 0.5, 0.8            # as in contacts
_ALONG_AT_LEAST, _MERGE_FACES, _MERGE_DEEPEST = 0.02, 2, 3

_handle = types.uintp
_numbers = types.CPointer(types.float64)
_is_space = types.ExternalFunction("dGeomIsSpace", types.int32(_handle))
_geom_data = types.ExternalFunction("dGeomGetData", _handle(_handle))
_collide = types.ExternalFunction("dCollide", types.int32(_handle, _handle, types.int32, _handle, types.int32))
_space_collide = types.ExternalFunction("dSpaceCollide", types.void(_handle, _handle, _handle))
_space_collide2 = types.ExternalFunction("dSpaceCollide2", types.void(_handle, _handle, _handle, _handle))
_space_geom = types.ExternalFunction("dSpaceGetGeom", _handle(_handle, types.int32))
_geom_quaternion = types.ExternalFunction("dGeomGetQuaternion", types.void(_handle, _handle))
_create_contact = types.ExternalFunction("dJointCreateContact", _handle(_handle, _handle, _handle))
_attach = types.ExternalFunction("dJointAttach", types.void(_handle, _handle, _handle))
_enable = types.ExternalFunction("dBodyEnable", types.void(_handle))
_is_enabled = types.ExternalFunction("dBodyIsEnabled", types.int32(_handle))
_set_feedback = types.ExternalFunction("dJointSetFeedback", types.void(_handle, _handle))
_group_empty = types.ExternalFunction("dJointGroupEmpty", types.void(_handle))
_connected = types.ExternalFunction("dAreConnected", types.int32(_handle, _handle))
_hinge_angle = types.ExternalFunction("dJointGetHingeAngle", types.float64(_handle))
_hinge_rate = types.ExternalFunction("dJointGetHingeAngleRate", types.float64(_handle))
_slider_at = types.ExternalFunction("dJointGetSliderPosition", types.float64(_handle))
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
def _add_contact(words, values, one, two, at):
    """Store that two geoms are in contact in this step, and where."""
    count = words[H_NOW_COUNT]
    if count == words[H_CONTACT_PAIR_ROOM]:
        words[H_MISSED] += np.uint64(1)
        return
    row = words[H_NOW] + count * CONTACT_PAIR_WORDS
    words[row], words[row + 1] = one, two
    for axis in range(3):
        values[row + np.uint64(2 + axis)] = values[at + C_POSITION + axis]
    values[row + np.uint64(5)] = values[at + C_DEPTH]
    words[H_NOW_COUNT] = count + np.uint64(1)


@njit(cache=True, nogil=True, error_model="numpy")
def _report(words, values, joint, geom_one, geom_two, one, two, at):
    """Store a contact, to which the solver adds the forces; return the address of the forces.

    Beyond ``MAX_REPORTS`` in a step the first ones are overwritten.
    A sleeping body is not solved, and its contacts have no forces; so bodies in contact with a watched geom stay awake.
    """
    for geom in (geom_one, geom_two):
        if words[geom + G_BODY] != 0:
            _enable(words[geom + G_BODY])
            restart_countdown(words, values, words[geom + G_IDLER])
    count = words[H_REPORT_COUNT]
    row = np.int64(words[H_REPORTS] + count % np.uint64(MAX_REPORTS) * np.uint64(REPORT_WORDS))
    words[row], words[row + 1], words[row + 2] = words[H_STEPS], one, two
    for axis in range(3):
        values[row + R_GEOMETRY + axis] = values[at + C_POSITION + axis]
        values[row + R_GEOMETRY + 3 + axis] = values[at + C_NORMAL + axis]
    values[row + R_GEOMETRY + 6] = values[at + C_DEPTH]
    for word in range(R_FEEDBACK, REPORT_WORDS):
        values[row + word] = 0.0
    feedback = words[H_ADDRESS] + np.uint64(8 * (row + R_FEEDBACK))
    _set_feedback(joint, feedback)
    words[H_REPORT_COUNT] = count + np.uint64(1)
    return feedback


@njit(cache=True, nogil=True, error_model="numpy")
def _friction_direction(words, values, geom, pair, at):
    """Write the direction of mu into a contact, or leave it to ODE, as PyodeEngine does."""
    along, normal = at + C_ALONG, at + C_NORMAL
    _geom_quaternion(geom, words[H_ADDRESS] + np.uint64(8 * along))
    w, qx, qy, qz = values[along], values[along + 1], values[along + 2], values[along + 3]
    x, y, z = rotate(qx, qy, qz, w, values[pair + P_ALONG_X], values[pair + P_ALONG_Y], values[pair + P_ALONG_Z])
    into = x * values[normal] + y * values[normal + 1] + z * values[normal + 2]
    x, y, z = x - into * values[normal], y - into * values[normal + 1], z - into * values[normal + 2]
    length = math.sqrt(x * x + y * y + z * z)
    if length > _ALONG_AT_LEAST:
        values[along], values[along + 1], values[along + 2] = x / length, y / length, z / length
    else:
        words[at + C_MODE] &= ~MODE_FDIR1


@njit(cache=True, nogil=True, error_model="numpy")
def _join(words, geom_one, geom_two, count):
    """Count contacts between two movable models, as Islands does."""
    first, second = stands_for(words, words[geom_one + G_MODEL]), stands_for(words, words[geom_two + G_MODEL])
    row, other = min(first, second), max(first, second)
    if row != other:
        words[other + X_FOR] = np.uint64(row)
        words[row + X_CONTACTS] += words[other + X_CONTACTS]
        words[row + X_AWAKE] |= words[other + X_AWAKE]
    words[row + X_CONTACTS] += np.uint64(count)
    if words[row + X_AWAKE] == 0 and (_is_enabled(words[geom_one + G_BODY]) or _is_enabled(words[geom_two + G_BODY])):
        words[row + X_AWAKE] = np.uint64(1)
    if words[row + X_AWAKE] != 0 and words[row + X_CONTACTS] > words[H_LARGEST_ISLAND]:
        words[H_LARGEST_ISLAND] = words[row + X_CONTACTS]


@njit(cache=True, nogil=True, error_model="numpy")
def _contacts(words, values, one, two):
    """Make the contact joints of two geoms, as PyodeEngine does."""
    row_one, row_two = _geom_data(one), _geom_data(two)
    if row_one == 0 or row_two == 0:
        return
    geom_one, geom_two = words[H_GEOMS] + (row_one - 1) * GEOM_WORDS, words[H_GEOMS] + (row_two - 1) * GEOM_WORDS
    cell = words[geom_one + G_CLASS] * words[H_CLASS_COUNT] + words[geom_two + G_CLASS]
    pair = np.int64(words[H_PAIRS] + cell * PAIR_WORDS)
    if values[pair + P_VALID] == 0.0:
        return
    kept, most = np.int64(words[H_KEPT]), np.int64(words[H_KEPT_ROOM])
    room = kept < most              # beyond, contacts are not stored and the step is solved once
    first = np.int64(words[H_CONTACTS]) + min(kept, most) * CONTACT_WORDS
    address = words[H_ADDRESS] + np.uint64(8 * first)
    count = np.int64(_collide(one, two, MAX_FOUND, address + np.uint64(8 * C_GEOMETRY), 8 * CONTACT_WORDS))
    count = with_direction(values, first, count)
    if count == 0:
        return
    limit = np.int64(values[pair + P_MAX_CONTACTS])
    if count > 1 and values[pair + P_MERGE] == _MERGE_FACES:
        count = merge_faces(values, first, count, min(limit, FACES))
    elif count > 1 and values[pair + P_MERGE] == _MERGE_DEEPEST:
        count = deepest_faces(values, first, count, min(limit, FACES))
    elif count > 1 and values[pair + P_MERGE] != 0.0:
        merge(values, first, count)
        count = 1
    elif count > limit:
        spread(values, first, count, limit)
        count = limit
    ground, both_move = values[pair + P_GROUND] != 0.0, values[pair + P_BOTH_MOVE] != 0.0
    if both_move:
        _join(words, geom_one, geom_two, count)
    restless = words[geom_one + G_RESTLESS] != 0 or words[geom_two + G_RESTLESS] != 0
    if room and kept + count <= most:
        words[H_KEPT] = np.uint64(kept + count)
    else:
        room = False
        words[H_KEPT] = np.uint64(most)
        words[H_COUPLED] = np.uint64(2)
    noted = ground          # libode reports a pair once per step; the event is that of its first contact
    watched = words[H_WATCHING] != 0 and (words[geom_one + G_WATCHED] != 0 or words[geom_two + G_WATCHED] != 0)
    for index in range(count):
        at = first + index * CONTACT_WORDS
        mu, mu2 = values[pair + P_MU], values[pair + P_MU2]
        steep = -_STEEP < values[at + C_NORMAL + 2] < _STEEP
        coupled = restless and (both_move or -_FLAT < values[at + C_NORMAL + 2] < _FLAT)
        if coupled and words[H_COUPLED] == 0:
            words[H_COUPLED] = np.uint64(1)
        if not noted and (steep or both_move):
            noted = True
            _add_contact(words, values, min(row_one, row_two), max(row_one, row_two), at)
        words[at + C_MODE] = np.uint64(values[pair + P_MODE])
        if words[at + C_MODE] & MODE_FDIR1:
            _friction_direction(words, values, two if values[pair + P_ALONG_SECOND] != 0.0 else one, pair, at)
        values[at + C_MU], values[at + C_MU2] = mu, mu2
        values[at + C_BOUNCE] = values[pair + P_BOUNCE]
        values[at + C_BOUNCE_VELOCITY] = values[pair + P_BOUNCE_VELOCITY]
        values[at + C_SLIP1], values[at + C_SLIP2] = values[pair + P_SLIP1] * count, values[pair + P_SLIP2] * count
        values[at + C_SOFT_ERP], values[at + C_SOFT_CFM] = values[pair + P_SOFT_ERP], values[pair + P_SOFT_CFM]
        joint = _create_contact(words[H_WORLD], words[H_GROUP], words[H_ADDRESS] + np.uint64(8 * at))
        _attach(joint, words[geom_one + G_BODY], words[geom_two + G_BODY])
        feedback = np.uint64(0)
        if watched:
            feedback = _report(words, values, joint, geom_one, geom_two, row_one, row_two, at)
        if room:
            grip = np.int64(words[H_GRIPS]) + (kept + index) * GRIP_WORDS
            words[grip + J_JOINT], words[grip + J_FEEDBACK] = joint, feedback
            words[grip + J_FIRST], words[grip + J_SECOND] = words[geom_one + G_BODY], words[geom_two + G_BODY]
            values[grip + J_MU], values[grip + J_MU2] = mu, mu2
            words[grip + J_MODEL] = words[(geom_one if words[geom_one + G_BODY] != 0 else geom_two) + G_MODEL]
            words[grip + J_COUPLED] = np.uint64(coupled)
            words[grip + J_KEY] = (min(row_one, row_two) * np.uint64(KEY_ROWS) + max(row_one, row_two)) * np.uint64(
                KEY_NUMBERS) + np.uint64(index)


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def near(data, one, two):
    """ODE's near callback."""
    header = carray(data, (HEADER_WORDS,), np.uint64)
    if _is_space(one) or _is_space(two):
        _space_collide2(one, two, header[H_ADDRESS], header[H_CALLBACK])
        return
    words = carray(data, (np.int64(header[H_SIZE]),), np.uint64)
    values = carray(data, (np.int64(header[H_SIZE]),), np.float64)
    _contacts(words, values, one, two)


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def near_itself(data, one, two):
    """ODE's near callback inside a model: only for two links with self_collide that share no joint."""
    header = carray(data, (HEADER_WORDS,), np.uint64)
    words = carray(data, (np.int64(header[H_SIZE]),), np.uint64)
    row_one, row_two = _geom_data(one), _geom_data(two)
    if row_one == 0 or row_two == 0:
        return
    geom_one, geom_two = words[H_GEOMS] + (row_one - 1) * GEOM_WORDS, words[H_GEOMS] + (row_two - 1) * GEOM_WORDS
    link_one, link_two = words[geom_one + G_LINK], words[geom_two + G_LINK]
    if link_one == 0 or link_two == 0 or link_one == link_two:
        return
    if not _connected(words[geom_one + G_BODY], words[geom_two + G_BODY]):
        _contacts(words, carray(data, (np.int64(header[H_SIZE]),), np.float64), one, two)


@njit(cache=True, nogil=True, error_model="numpy")
def _damp(words, values):
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
def _turn(words, values, dt):
    """Add up how far the hinges turn in a step by their rates, which is cheaper than to read where they are.

    Returns how much that may be off [rad]: libode turns a body by ``2 atan(0.5 rate dt)``.
    """
    astray = 0.0
    for index in range(np.int64(words[H_HINGE_COUNT])):
        row = np.int64(words[H_HINGES]) + index * HINGE_WORDS
        way = _hinge_rate(words[row]) * dt
        values[row + 2] += way
        astray = max(astray, abs(way * way * way) / 12.0)
    return astray


@njit(cache=True, nogil=True, error_model="numpy")
def _unwrap(words, values):
    """Count full turns: of the angles that fit the reading, take the one nearest to what the rates predict."""
    for index in range(np.int64(words[H_HINGE_COUNT])):
        row = np.int64(words[H_HINGES]) + index * HINGE_WORDS
        raw = _hinge_angle(words[row])
        predicted = values[row + 1] + values[row + 2]
        values[row + 2] = 0.0
        # plus zero, because -0 rotations are 0: a hinge at rest reads 0, never -0
        values[row + 1] = raw + (2.0 * math.pi * np.rint((predicted - raw) / (2.0 * math.pi)) + 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _lost_body(words):
    """Return the number, counted from 1, of the first body that is nowhere or too fast; 0 where there is none.

    It must be found while it is still somewhere: libode ends the process when it meets what is no number.
    """
    first = np.int64(words[H_BODIES])
    for index in range(np.int64(words[H_BODY_COUNT])):
        body = words[first + index]
        at, speed = carray(_position(body), (3,)), carray(_linear_velocity(body), (3,))
        turn = carray(_angular_velocity(body), (3,))
        fast = abs(speed[0]) + abs(speed[1]) + abs(speed[2]) + abs(turn[0]) + abs(turn[1]) + abs(turn[2])
        if not (abs(at[0]) + abs(at[1]) + abs(at[2]) < _TOO_FAR and fast < _TOO_FAST):
            return index + 1
    return 0


@njit(cache=True, nogil=True, error_model="numpy")
def _log_contacts(words, values):
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
def _solve(words, values, world, dt, quick):
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
def run(words, steps):
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
        ``H_LOST``.  It is negative if there are events to read in the block, so that the caller need not look for them.
    """
    values = words.view(np.float64)
    dt = values[H_DT]
    world, group, data, callback = words[H_WORLD], words[H_GROUP], words[H_ADDRESS], words[H_CALLBACK]
    spaces, space_count = np.int64(words[H_SPACES]), np.int64(words[H_SPACE_COUNT])
    bounded, quick, sleepers = words[H_BOUNDED] != 0, words[H_QUICK] != 0, words[H_SLEEPERS] != 0
    damped = words[H_DAMPED_JOINT_COUNT] + words[H_DAMPED_LINK_COUNT] != 0
    idlers = words[H_IDLER_COUNT] != 0
    taken = looked = 0
    astray = 0.0
    while (taken < steps and words[H_LOG_COUNT] + words[H_CONTACT_PAIR_ROOM] <= words[H_LOG_ROOM]
           and words[H_REPORT_COUNT] < MANY_REPORTS and not words[H_ITERATIVE]):
        taken += 1
        words[H_STEPS] += np.uint64(1)
        if damped:
            _damp(words, values)
        words[H_LARGEST_ISLAND] = words[H_KEPT] = words[H_COUPLED] = np.uint64(0)
        asked = 0
        for index in range(space_count):
            row = spaces + index * SPACE_WORDS
            free = bounded and words[row + S_GEOM_COUNT] != 0 and is_free(words, values, row)
            if free and sleepers and words[row + S_MEETS_ITSELF] == 0 and sleeps_apart(words, values, row):
                continue
            asked += 1
            if free:
                for number in range(np.int64(words[row + S_GEOM_COUNT])):
                    _contacts(words, values, words[H_PLANE], _space_geom(words[row], number))
            else:
                _space_collide2(words[row], words[H_STATIC], data, callback)
            if words[row + S_MEETS_ITSELF]:
                _space_collide(words[row], data, words[H_CALLBACK_ITSELF])
        if asked > 1:
            _space_collide(words[H_MOVING], data, callback)
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
        astray += _turn(words, values, dt)
        if taken - looked == _UNWRAP_AFTER or astray > _ASTRAY:
            _unwrap(words, values)
            looked, astray = taken, 0.0
    if taken != looked:
        _unwrap(words, values)
    nearly_full = np.uint64(2) * words[H_BEFORE_COUNT] > words[H_CONTACT_PAIR_ROOM]
    return -taken if words[H_LOG_COUNT] or words[H_REPORT_COUNT] or words[H_ITERATIVE] or nearly_full else taken


@njit(cache=True, nogil=True, error_model="numpy")
def read_poses(shapes, poses):
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
        at, turn = carray(_position(shapes[k, 0]), (3,)), carray(_quaternion(shapes[k, 0]), (4,))
        shift, offset = values[k, SHAPE_SHIFT:SHAPE_OFFSET], values[k, SHAPE_OFFSET:]
        w, x, y, z = turn[0], turn[1], turn[2], turn[3]
        cx, cy, cz = rotate(x, y, z, w, shift[0], shift[1], shift[2])
        dx, dy, dz = rotate(x, y, z, w, offset[0], offset[1], offset[2])
        poses[k, 0], poses[k, 1], poses[k, 2] = at[0] - cx + dx, at[1] - cy + dy, at[2] - cz + dz
        qx, qy, qz, qw = offset[3], offset[4], offset[5], offset[6]
        poses[k, 3] = w * qx + x * qw + y * qz - z * qy
        poses[k, 4] = w * qy - x * qz + y * qw + z * qx
        poses[k, 5] = w * qz + x * qy - y * qx + z * qw
        poses[k, 6] = w * qw - x * qx - y * qy - z * qz
