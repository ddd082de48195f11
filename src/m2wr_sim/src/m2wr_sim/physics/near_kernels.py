# SPDX-License-Identifier: BSD-3-Clause
"""The contact callback, compiled: finds the contacts of two geoms and makes their joints, as PyodeEngine does.

It works on one block of memory, see step_layout.  The symbols of libode must be known to the compiler before this
module is imported; see native_ode.publish_symbols.  Kernels may call those of other modules of this folder: after a
change in one of them all are compiled again, see :mod:`m2wr_node.kernel_cache`.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic

from m2wr_sim.physics.contact_kernels import (
    FACES,
    copy_contact,
    deepest_faces,
    is_repeated,
    merge,
    merge_faces,
    rotate,
    spread,
    with_direction,
)
from m2wr_sim.physics.coupled_kernels import restart_countdown, stands_for
from m2wr_sim.physics.height_field_kernels import tops_size
from m2wr_sim.physics.height_kernels import CONTACT, FIELD, MOST, NO_SHAPE, WORK, height_contacts
from m2wr_sim.physics.height_window_kernels import WINDOW
from m2wr_sim.physics.mesh_pair_kernels import are_meshes, mesh_contacts
from m2wr_sim.physics.sliding_kernels import feel_load, slide
from m2wr_sim.physics.step_layout import (
    C_ALONG,
    C_BOUNCE,
    C_BOUNCE_VELOCITY,
    C_DEPTH,
    C_GEOM_ONE,
    C_GEOM_TWO,
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
    FIELD_CELL,
    FIELD_COLUMNS,
    FIELD_HEIGHTS,
    FIELD_ROWS,
    FIELD_TOPS,
    G_BODY,
    G_CLASS,
    G_IDLER,
    G_KIND,
    G_LINK,
    G_LOAD,
    G_MODEL,
    G_RESTLESS,
    G_SIZE,
    G_SLIP1,
    G_SLIP2,
    G_WATCHED,
    GEOM_WORDS,
    GRIP_WORDS,
    H_ADDRESS,
    H_CALLBACK,
    H_CLASS_COUNT,
    H_CONTACT_PAIR_ROOM,
    H_CONTACTS,
    H_COUPLED,
    H_GEOMS,
    H_GRIPS,
    H_GROUP,
    H_KEPT,
    H_KEPT_ROOM,
    H_LARGEST_ISLAND,
    H_MISSED,
    H_NOW,
    H_NOW_COUNT,
    H_PAIRS,
    H_REPORT_COUNT,
    H_REPORTS,
    H_SIZE,
    H_STEPS,
    H_WATCHING,
    H_WORK,
    H_WORLD,
    HEADER_WORDS,
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
    L_STEP,
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
    P_SLIDES,
    P_SLIP1,
    P_SLIP2,
    P_SOFT_CFM,
    P_SOFT_ERP,
    P_VALID,
    PAIR_WORDS,
    R_FEEDBACK,
    R_GEOMETRY,
    RECENT,
    REPORT_WORDS,
    X_AWAKE,
    X_CONTACTS,
    X_FOR,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

_STEEP, _FLAT = 0.5, 0.8            # as in contacts
_NUMBERS = 19                       # two poses, size of a shape and of a cell
GROUND_WORK = _NUMBERS + WINDOW + MOST * CONTACT + WORK      # words of H_WORK
_ALONG_AT_LEAST, _MERGE_FACES, _MERGE_DEEPEST = 0.02, 2, 3

_handle = types.uintp
_is_space = types.ExternalFunction("dGeomIsSpace", types.int32(_handle))
_geom_data = types.ExternalFunction("dGeomGetData", _handle(_handle))
_geom_body = types.ExternalFunction("dGeomGetBody", _handle(_handle))
_collide = types.ExternalFunction("dCollide", types.int32(_handle, _handle, types.int32, _handle, types.int32))
_space_collide2 = types.ExternalFunction("dSpaceCollide2", types.void(_handle, _handle, _handle, _handle))
_geom_quaternion = types.ExternalFunction("dGeomGetQuaternion", types.void(_handle, _handle))
_geom_position = types.ExternalFunction("dGeomGetPosition", types.uintp(_handle))
_create_contact = types.ExternalFunction("dJointCreateContact", _handle(_handle, _handle, _handle))
_attach = types.ExternalFunction("dJointAttach", types.void(_handle, _handle, _handle))
_enable = types.ExternalFunction("dBodyEnable", types.void(_handle))
_is_enabled = types.ExternalFunction("dBodyIsEnabled", types.int32(_handle))
_set_feedback = types.ExternalFunction("dJointSetFeedback", types.void(_handle, _handle))
_connected = types.ExternalFunction("dAreConnected", types.int32(_handle, _handle))


@njit(cache=True, nogil=True, error_model="numpy")
def _add_contact(words: Words, values: Values, one: int, two: int, at: int) -> None:
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
def _report(words: Words, values: Values, joint: int, geom_one: int, geom_two: int, one: int, two: int, at: int) -> Any:
    """Store a contact of a watched geom, to which the solver adds the forces; return the address of the forces.

    After ``MAX_REPORTS`` contacts in a step the first ones are overwritten.  The contacts of a sleeping body have no
    forces, because it is not solved; so bodies in contact with a watched geom stay awake.
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
def _friction_direction(words: Words, values: Values, geom: int, pair: int, at: int) -> None:
    """Set the direction of mu of a contact, or leave it to ODE, as PyodeEngine does."""
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
def _join(words: Words, geom_one: int, geom_two: int, count: int) -> None:
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
def _reduce(values: Values, pair: int, first: int, count: int) -> int:
    """Reduce the contacts found for a pair, as contacts.reduced does; return how many remain, at the front."""
    limit = int(values[pair + P_MAX_CONTACTS])
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
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _drop_repeated(words: Words, values: Values, first: int, count: int, one: int, two: int, first_moves: bool) -> int:
    """Drop contacts with a static geom that are contacts with another one in this step already; return how many remain.

    As PyodeEngine does.  Those that remain are at the front, and know their geoms.
    """
    mover, static = (np.uint64(one), np.uint64(two)) if first_moves else (np.uint64(two), np.uint64(one))
    lowest, left = np.int64(words[H_CONTACTS]), 0
    if lowest < first - RECENT * CONTACT_WORDS:
        lowest = np.int64(first - RECENT * CONTACT_WORDS)
    for index in range(count):
        at, repeated = first + index * CONTACT_WORDS, False
        place = first - CONTACT_WORDS
        while place >= lowest and not repeated:
            side_one, side_two = words[place + C_GEOM_ONE], words[place + C_GEOM_TWO]
            if side_one == mover or side_two == mover:
                other = side_two if side_one == mover else side_one
                if other != static and _geom_body(other) == 0:
                    repeated = is_repeated(values, at, place, 1.0 if (side_one == mover) == first_moves else -1.0)
            place -= CONTACT_WORDS
        if repeated:
            continue
        if left != index:
            copy_contact(values, first + left * CONTACT_WORDS, at)
        left += 1
    return left


@njit(cache=True, nogil=True, error_model="numpy")
def _set_surface(words: Words, values: Values, pair: int, one: int, two: int, geom_one: int, geom_two: int,
                 count: int, at: int) -> None:
    """Set the surface parameters of a contact, one of ``count``, of the geoms with handles ``one`` and ``two``."""
    words[at + C_MODE] = np.uint64(values[pair + P_MODE])
    if words[at + C_MODE] & MODE_FDIR1:
        _friction_direction(words, values, two if values[pair + P_ALONG_SECOND] != 0.0 else one, pair, at)
    values[at + C_MU], values[at + C_MU2] = values[pair + P_MU], values[pair + P_MU2]
    values[at + C_BOUNCE] = values[pair + P_BOUNCE]
    values[at + C_BOUNCE_VELOCITY] = values[pair + P_BOUNCE_VELOCITY]
    values[at + C_SLIP1] = (values[pair + P_SLIP1] + values[geom_one + G_SLIP1] + values[geom_two + G_SLIP1]) * count
    values[at + C_SLIP2] = (values[pair + P_SLIP2] + values[geom_one + G_SLIP2] + values[geom_two + G_SLIP2]) * count
    values[at + C_SOFT_ERP], values[at + C_SOFT_CFM] = values[pair + P_SOFT_ERP], values[pair + P_SOFT_CFM]


@njit(cache=True, nogil=True, error_model="numpy")
def _store_grip(words: Words, values: Values, geom_one: int, geom_two: int, at: int, grip: int, joint: int,
                feedback: int) -> None:
    """Store a contact, at word ``at``, for further solutions of the step."""
    words[grip + J_JOINT], words[grip + J_FEEDBACK] = joint, feedback
    words[grip + J_FIRST], words[grip + J_SECOND] = words[geom_one + G_BODY], words[geom_two + G_BODY]
    values[grip + J_MU], values[grip + J_MU2] = values[at + C_MU], values[at + C_MU2]
    words[grip + J_MODEL] = words[(geom_one if words[geom_one + G_BODY] != 0 else geom_two) + G_MODEL]


@intrinsic
def _pointer(_: Any, address: Any) -> Any:
    """Return an address as a pointer."""
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
    return types.voidptr(address), generate


@njit(cache=True, nogil=True, error_model="numpy")
def _pose_of(words: Words, values: Values, geom: int, room: int, pose: Values) -> None:
    """Write position and quaternion x y z w of a geom; ``room``: four words that may be overwritten."""
    position = carray(_pointer(_geom_position(geom)), (3,), np.float64)
    _geom_quaternion(geom, words[H_ADDRESS] + np.uint64(8 * room))
    for axis in range(3):
        pose[axis], pose[3 + axis] = position[axis], values[room + 1 + axis]
    pose[6] = values[room]


@njit(cache=True, nogil=True, error_model="numpy")
def _ground_contacts(words: Words, values: Values, one: int, two: int, geom_one: int, geom_two: int,
                     first: int) -> int:
    """Write the contacts of a shape and a heightmap, as height_contacts.find does; return their number."""
    field, shape, row, other, sign = two, one, geom_two, geom_one, 1.0
    if words[geom_one + G_KIND] == FIELD:
        field, shape, row, other, sign = one, two, geom_one, geom_two, -1.0
    at = row + G_SIZE
    rows, columns = np.int64(words[at + FIELD_ROWS]), np.int64(words[at + FIELD_COLUMNS])
    heights = carray(_pointer(words[at + FIELD_HEIGHTS]), (rows, columns), np.float64)
    tops = carray(_pointer(words[at + FIELD_TOPS]), (tops_size(rows, columns),), np.float64)
    begin = words[H_ADDRESS] + np.uint64(8) * words[H_WORK]
    numbers = carray(_pointer(begin), (_NUMBERS,), np.float64)
    field_pose, pose, size, cell = numbers[:7], numbers[7:14], numbers[14:17], numbers[17:19]
    window = carray(_pointer(begin + np.uint64(8 * _NUMBERS)), (WINDOW,), np.int64)
    found = carray(_pointer(begin + np.uint64(8 * (_NUMBERS + WINDOW))), (MOST, CONTACT), np.float64)
    work = carray(_pointer(begin + np.uint64(8 * (_NUMBERS + WINDOW + MOST * CONTACT))), (WORK,), np.float64)
    room = first + C_GEOMETRY
    _pose_of(words, values, field, room, field_pose)
    _pose_of(words, values, shape, room, pose)
    for axis in range(3):
        size[axis] = values[other + G_SIZE + axis]
    for axis in range(2):
        cell[axis] = values[at + FIELD_CELL + axis]
    count = height_contacts(heights, tops, cell, field_pose, np.int64(words[other + G_KIND]), size, pose, found, work,
                            window)
    for index in range(count):
        place = first + index * CONTACT_WORDS
        for axis in range(3):
            values[place + C_POSITION + axis] = found[index, axis]
            values[place + C_NORMAL + axis] = sign * found[index, 3 + axis]
        values[place + C_DEPTH] = found[index, 6]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def make_contacts(words: Words, values: Values, one: int, two: int) -> None:
    """Make the contact joints of two geoms, as PyodeEngine does.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    one, two : int
        Native handles of the geoms.
    """
    row_one, row_two = _geom_data(one), _geom_data(two)
    if row_one == 0 or row_two == 0:
        return
    geom_one, geom_two = words[H_GEOMS] + (row_one - 1) * GEOM_WORDS, words[H_GEOMS] + (row_two - 1) * GEOM_WORDS
    cell = words[geom_one + G_CLASS] * words[H_CLASS_COUNT] + words[geom_two + G_CLASS]
    pair = np.int64(words[H_PAIRS] + cell * PAIR_WORDS)
    if values[pair + P_VALID] == 0.0:
        return
    kept, most = np.int64(words[H_KEPT]), np.int64(words[H_KEPT_ROOM])
    room = bool(kept < most)              # beyond, contacts are not stored and the step is solved once
    first = np.int64(words[H_CONTACTS]) + min(kept, most) * CONTACT_WORDS
    address = words[H_ADDRESS] + np.uint64(8 * first)
    kind_one, kind_two = words[geom_one + G_KIND], words[geom_two + G_KIND]
    if kind_one != NO_SHAPE and kind_two != NO_SHAPE and (kind_one == FIELD) != (kind_two == FIELD):
        count = _ground_contacts(words, values, one, two, geom_one, geom_two, first)
    elif kind_one == NO_SHAPE and kind_two == NO_SHAPE and are_meshes(one, two):
        count = with_direction(values, first, mesh_contacts(words, first, one, two))
    else:
        count = np.int64(_collide(one, two, MAX_FOUND, address + np.uint64(8 * C_GEOMETRY), 8 * CONTACT_WORDS))
        count = with_direction(values, first, count)
    if count == 0:
        return
    count = _reduce(values, pair, first, count)
    ground, both_move = values[pair + P_GROUND] != 0.0, values[pair + P_BOTH_MOVE] != 0.0
    if both_move:
        _join(words, geom_one, geom_two, count)
    else:
        count = _drop_repeated(words, values, first, count, one, two, words[geom_one + G_BODY] != 0)
        if count == 0:      # the first one is still there
            if not ground and -_STEEP < values[first + C_NORMAL + 2] < _STEEP:
                _add_contact(words, values, min(row_one, row_two), max(row_one, row_two), first)
            return
    restless = words[geom_one + G_RESTLESS] != 0 or words[geom_two + G_RESTLESS] != 0
    if room and kept + count <= most:
        words[H_KEPT] = np.uint64(kept + count)
    else:
        room = False
        words[H_KEPT] = np.uint64(most)
        words[H_COUPLED] = np.uint64(2)
    noted = bool(ground)    # libode reports a pair once per step; the event is that of its first contact
    load, other = np.int64(0), row_one
    if values[pair + P_SLIDES] != 0.0:
        if words[geom_one + G_LOAD] != 0:
            load, other = np.int64(words[geom_one + G_LOAD]), row_two
        else:
            load = np.int64(words[geom_two + G_LOAD])
        if words[load + L_STEP] == words[H_STEPS]:      # it has a contact in this step already
            load = np.int64(0)
    watched = words[H_WATCHING] != 0 and (words[geom_one + G_WATCHED] != 0 or words[geom_two + G_WATCHED] != 0)
    for index in range(count):
        at = first + index * CONTACT_WORDS
        words[at + C_GEOM_ONE], words[at + C_GEOM_TWO] = np.uint64(one), np.uint64(two)
        steep = -_STEEP < values[at + C_NORMAL + 2] < _STEEP
        coupled = restless and (both_move or -_FLAT < values[at + C_NORMAL + 2] < _FLAT)
        if coupled and words[H_COUPLED] == 0:
            words[H_COUPLED] = np.uint64(1)
        if not noted and (steep or both_move):
            noted = True
            _add_contact(words, values, min(row_one, row_two), max(row_one, row_two), at)
        _set_surface(words, values, pair, one, two, geom_one, geom_two, count, at)
        if load != 0:
            slide(words, values, geom_one, geom_two, other, load, pair, at)
        joint = _create_contact(words[H_WORLD], words[H_GROUP], words[H_ADDRESS] + np.uint64(8 * at))
        _attach(joint, words[geom_one + G_BODY], words[geom_two + G_BODY])
        feedback = np.uint64(0)
        if watched:
            feedback = _report(words, values, joint, geom_one, geom_two, row_one, row_two, at)
        if load != 0:
            feedback, load = feel_load(words, values, other, load, at, joint, feedback), np.int64(0)
        if room:
            grip = np.int64(words[H_GRIPS]) + (kept + index) * GRIP_WORDS
            rows = min(row_one, row_two) * np.uint64(KEY_ROWS) + max(row_one, row_two)
            _store_grip(words, values, geom_one, geom_two, at, grip, joint, feedback)
            words[grip + J_COUPLED] = np.uint64(coupled)
            words[grip + J_KEY] = rows * np.uint64(KEY_NUMBERS) + np.uint64(index)


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def near(data: Any, one: int, two: int) -> None:
    """ODE's near callback.

    Parameters
    ----------
    data : pointer
        The block.
    one, two : int
        Native handles of two geoms or spaces.
    """
    header = carray(data, (HEADER_WORDS,), np.uint64)
    if _is_space(one) or _is_space(two):
        _space_collide2(one, two, header[H_ADDRESS], header[H_CALLBACK])
        return
    words = carray(data, (np.int64(header[H_SIZE]),), np.uint64)
    values = carray(data, (np.int64(header[H_SIZE]),), np.float64)
    make_contacts(words, values, one, two)


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def near_itself(data: Any, one: int, two: int) -> None:
    """ODE's near callback inside a model: only for two links with self_collide that share no joint.

    Parameters
    ----------
    data : pointer
        The block.
    one, two : int
        Native handles of two geoms.
    """
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
        make_contacts(words, carray(data, (np.int64(header[H_SIZE]),), np.float64), one, two)
