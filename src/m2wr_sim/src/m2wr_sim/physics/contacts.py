# SPDX-License-Identifier: BSD-3-Clause
"""Selects the contacts of a pair of collisions, and combines their surfaces. Uses no objects of the engine.

A contact is a tuple ``(position, normal, depth)``; the normal points from the second shape into the first.
"""
from __future__ import annotations

import math
from collections import namedtuple
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

from m2wr_sim.model.types import Box, Heightmap, Mesh, Plane, Sphere
from m2wr_sim.physics.limits import SOFTEST
from m2wr_sim.physics.step_layout import SAME_DEPTH, SAME_DIRECTION, SAME_PLACE

if TYPE_CHECKING:
    from m2wr_sim.geometry import Vector
    from m2wr_sim.model.types import Collision
    from m2wr_sim.physics.engine import EngineSettings

    #: Position, normal, depth.
    Contact = Tuple[Vector, Vector, float]

MODE_MU2 = 0x001
MODE_FDIR1 = 0x002
MODE_BOUNCE = 0x004
MODE_SOFT_ERP = 0x008
MODE_SOFT_CFM = 0x010
MODE_SLIP1 = 0x100
MODE_SLIP2 = 0x200
MODE_APPROX1 = 0x7000       # friction proportional to the normal force; ODE 0.16's value, not the Python binding's

MIN_SOFT_CFM = 1e-6         # with stiffer contacts the direct solver becomes inaccurate
HEAVY = 100.0               # kg; above, the stiffness of contacts is proportional to the mass
# m/s/N, of friction on heightmaps, in place of the world's compliance: what stands on a slope would creep by 0.1 mm a
# second.  At walls that compliance lets a robot come down that has jammed with its nose up, so other shapes keep it.
GROUND_SLIP = 1e-9
BOX_CONTACTS = 4            # one for each corner of a face
MESH_CONTACTS = 8           # for shapes made of triangles, each of which may give several contacts
MERGE_ALL, MERGE_FACES, MERGE_DEEPEST = 1, 2, 3
FACES = 4                   # greatest number of separate contacts of one wheel or ball with one mesh
SAME_FACE = 0.8             # cosine of the angle between normals that still belong to one place: 37 degrees
SAME_PLANE = 0.998          # the same for a ball, which has one contact with a plane: 4 degrees
ALONG_AT_LEAST = 0.02       # least sine of the angle between a friction direction and the normal
STEEP = 0.5                 # |normal z| below this: reported as a contact event, not ground

# Cosine of the steepest face (37 degrees) on which a robot counts as standing; such contacts alone are solved once.  If
# one plane carries a robot, friction changes how the load is shared, but not the load.  m2wr, driven from rest at 0.4
# and 0.5 m/s for 1.5 s, then differs by 6 mm (of 0.65 m) from the result with all contacts coupled; by 7 mm on a slope
# of 10 degrees, and by 60 mm at 20.
FLAT = 0.8

# Greatest error of a friction limit, relative to the greatest normal force of its island.  Friction has the same error:
# less than the 1 % within which sliding along walls agrees with its closed form (test_coupled_friction).
AGREED = 0.001

PairSurface = namedtuple(
    "PairSurface",
    "mode mu mu2 slip1 slip2 bounce bounce_velocity soft_erp soft_cfm max_contacts merge ground "
    "along along_second slides")


def load_class(mass: float) -> float:
    """Return the factor, a power of two, by which the contacts of a model of that mass [kg] are stiffer than usual.

    With the world's compliance a contact carries at most ``max_correcting_velocity / cfm`` (10 kN), so that models of
    several tons would sink into the ground.  With a stiffness proportional to the mass, the contact depth of a heavy
    model is that of a model of :data:`HEAVY`.
    """
    return 2.0 ** math.ceil(math.log2(mass / HEAVY)) if HEAVY < mass < math.inf else 1.0


def pair_surface(first: Collision, second: Collision, first_is_wheel: bool, second_is_wheel: bool, both_move: bool,
                 settings: EngineSettings, stiffer: float = 1.0, skids: bool = False,
                 slips: bool = False) -> Optional[PairSurface]:
    """Combine the surfaces of two collisions by Gazebo's rules.

    Friction and restitution are the smaller of the two values, slips are added, and stiffnesses combine as springs in
    series.  Gazebo's default stiffness (1e12) means a rigid contact.  A lower one is converted to ERP and CFM for this
    step size, and CFM is at least :data:`MIN_SOFT_CFM`.

    Parameters
    ----------
    first, second : Collision
    first_is_wheel, second_is_wheel : bool
        The contacts of a wheel are merged into one.
    both_move : bool
        Whether both belong to moving bodies; a contact between two of them is never one with the ground.
    settings : EngineSettings
    stiffer : float
        The :func:`load_class` of the lighter moving body.
    skids : bool
        Whether one of them is a wheel of a model with wheels on several axles.
    slips : bool
        Whether one of them slips by a compliance that changes.

    Returns
    -------
    PairSurface or None
        None if the pair never has contacts.  ``slides``: whether its friction is that of :mod:`.sliding`.
    """
    one, two = first.surface, second.surface
    if not one.collide_bitmask & two.collide_bitmask or one.collide_without_contact or two.collide_without_contact:
        return None
    mu, mu2 = _smaller_friction(one.mu, two.mu), _smaller_friction(one.mu2, two.mu2)
    wheel = first_is_wheel or second_is_wheel
    mode = MODE_APPROX1 | (MODE_MU2 if mu2 != mu else 0)
    slip1, slip2 = one.slip1 + two.slip1, one.slip2 + two.slip2
    if slip1 > 0.0 and mu > 0.0:
        mode |= MODE_SLIP1
    if slip2 > 0.0 and mu2 > 0.0:
        mode |= MODE_SLIP2
    if not both_move and any(isinstance(side.geometry, Heightmap) for side in (first, second)):
        mode |= MODE_SLIP1 | MODE_SLIP2         # in place of the compliance of the world
        slip1, slip2 = max(slip1, GROUND_SLIP), max(slip2, GROUND_SLIP)
    bounce = min(one.restitution, two.restitution)
    if bounce > 0.0:
        mode |= MODE_BOUNCE
    soft_erp = soft_cfm = 0.0
    if one.kp < 1e12 or two.kp < 1e12:
        step = settings.step_ns * 1e-9
        stiffness = 1.0 / (1.0 / max(one.kp, 1e-9) + 1.0 / max(two.kp, 1e-9))
        damping = max(0.0, one.kd + two.kd)
        soft_erp = step * stiffness / (step * stiffness + damping)
        soft_cfm = min(max(MIN_SOFT_CFM / stiffer, 1.0 / (step * stiffness + damping)), SOFTEST)
        mode |= MODE_SOFT_ERP | MODE_SOFT_CFM
    elif stiffer > 1.0:
        soft_cfm = settings.cfm / stiffer
        mode |= MODE_SOFT_CFM
    limit, merging = _reduction(first, second, wheel, settings.max_contacts)
    along, along_second = _friction_direction(one.fdir1, two.fdir1)
    if any(along):
        mode |= MODE_FDIR1 | MODE_MU2
    slides = skids and first_is_wheel != second_is_wheel and 0.0 < mu < math.inf and 0.0 < mu2 < math.inf
    if slides or slips:
        mode |= MODE_SLIP1 | MODE_SLIP2
    ground = not both_move and (isinstance(first.geometry, Plane) or isinstance(second.geometry, Plane))
    return PairSurface(mode, mu, mu2, slip1, slip2, bounce, min(one.restitution_threshold, two.restitution_threshold),
                       soft_erp, soft_cfm, limit, merging, ground, along, along_second, slides)


def _reduction(first: Collision, second: Collision, wheel: bool, most: int) -> Tuple[int, int]:
    """Return the greatest number of contacts of a pair, and how they are merged; ``wheel``: whether one is a wheel."""
    limit = min(most, max(1, first.max_contacts), max(1, second.max_contacts))
    shapes, merging = (first.geometry, second.geometry), MERGE_ALL if wheel else 0
    if any(isinstance(shape, Heightmap) for shape in shapes) and not any(isinstance(shape, Mesh) for shape in shapes):
        limit, merging = min(limit, MESH_CONTACTS), 0       # height_kernels find one contact for each place
    elif any(isinstance(shape, (Mesh, Heightmap)) for shape in shapes):
        limit = min(limit, MESH_CONTACTS)
        if any(isinstance(shape, Sphere) for shape in shapes):
            merging = MERGE_DEEPEST
        elif wheel:
            merging = MERGE_FACES
    if any(isinstance(shape, Box) for shape in shapes):
        limit = min(limit, BOX_CONTACTS)
    return limit, merging


def _friction_direction(one: Sequence[float], two: Sequence[float]) -> Tuple[Tuple[float, ...], bool]:
    """Return the direction of mu, as a unit vector in the frame of a shape, and whether that is the second shape.

    The first shape takes precedence.  Zeros if neither defines a direction: ODE then uses the normal only.
    """
    for vector, second in ((one, False), (two, True)):
        length = math.sqrt(sum(value * value for value in vector))
        if length > 0.0:
            return tuple(value / length for value in vector), second
    return (0.0, 0.0, 0.0), False


def next_limit(used: float, felt: float) -> float:
    """Return the normal force that limits the friction of a contact in the next iteration.

    It is the mean of the last one and the computed one.  Consider wheels of radius r and friction mu that push against
    a wall, with the other support at a distance d behind them.  A greater force on the wall reduces the load on the
    ground, and a greater load on the ground increases the force on the wall.  With the computed forces, the error would
    grow by a factor rho in each iteration, with rho^2 = mu (r + mu (d + r)) / d: 1.3 for mu = 1 and d = 3 r.  With the
    mean, the factor is sqrt(1 + rho^2) / 2, which is below 1 up to rho = 1.7.

    Parameters
    ----------
    used : float
        Normal force from which the limit of the last iteration was computed, below 0 if unknown [N].
    felt : float
        Normal force computed in the last iteration [N].

    Returns
    -------
    float
        [N].
    """
    return felt if used < 0.0 else 0.5 * (used + felt)


def along_surface(direction: Sequence[float], normal: Sequence[float]) -> Optional[Vector]:
    """Return the unit vector of the projection of a direction onto a surface; None if it is nearly normal to it.

    The direction of friction rotates with its shape.  Without the projection, that of a rolling wheel would point into
    the ground.

    Parameters
    ----------
    direction, normal : (3,) sequence of float
        Unit vectors in the same frame.

    Returns
    -------
    tuple of 3 floats or None
    """
    into = direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2]
    x, y, z = direction[0] - into * normal[0], direction[1] - into * normal[1], direction[2] - into * normal[2]
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > ALONG_AT_LEAST else None


def _smaller_friction(one: float, two: float) -> float:
    """Return the smaller coefficient; a negative one stands for infinite friction."""
    one, two = (math.inf if value < 0.0 else value for value in (one, two))
    return min(one, two)


def is_repeated(one: Contact, other: Contact) -> bool:
    """Return whether two contacts of a shape, with two static shapes, are one: at one place, in one direction, as deep.

    Floors that lie in one plane give each wheel a contact for each of them.  The solver's matrix is singular then, and
    a robot that drives straight on turns at random.

    Parameters
    ----------
    one, other : (position, normal, depth)
        Both normals into the shape, or both out of it.
    """
    (x, y, z), (nx, ny, nz), depth = one
    (ox, oy, oz), (mx, my, mz), other_depth = other
    if not (abs(depth - other_depth) < SAME_DEPTH and nx * mx + ny * my + nz * mz > SAME_DIRECTION):
        return False
    x, y, z = x - ox, y - oy, z - oz
    along = x * nx + y * ny + z * nz
    return x * x + y * y + z * z - along * along < SAME_PLACE * SAME_PLACE


def has_direction(normal: Sequence[float]) -> bool:
    """Return whether the normal of a contact is a unit vector.

    If the centre of a sphere is on the axis of a cylinder, libode returns NaN, which would make it abort the process.
    """
    return 0.5 < normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2] < 2.0


def merge(contacts: List[Contact]) -> Contact:
    """Average the contacts of a wheel into one, in the middle plane of the wheel.

    A cylinder on a plane has contacts at both rim edges.  While the robot rotates, the solver would let one of them
    stick, and the track width would be wrong by the wheel's width.  The mean point with the mean normal and the
    greatest depth rolls correctly.  Contacts whose normals cancel (a wheel between two faces) cannot be averaged; the
    deepest one remains.
    """
    px = py = pz = nx = ny = nz = depth = 0.0
    deepest = contacts[0]
    for contact in contacts:
        position, normal, contact_depth = contact
        px += position[0]
        py += position[1]
        pz += position[2]
        nx += normal[0]
        ny += normal[1]
        nz += normal[2]
        if contact_depth > depth:
            depth, deepest = contact_depth, contact
    count = len(contacts)
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 0.5 * count:
        return deepest
    return ((px / count, py / count, pz / count), (nx / norm, ny / norm, nz / norm), depth)


def merge_faces(contacts: List[Contact], limit: int) -> List[Contact]:
    """Average the contacts of a wheel with a mesh or heightmap, one for each group of similar normals.

    Neighbouring triangles give several contacts for one face, while a floor and a wall of one mesh are two faces.  A
    contact joins the first group whose first normal is similar to its own.

    Parameters
    ----------
    contacts : list of (position, normal, depth)
    limit : int
        Greatest number of groups; contacts of further groups are dropped.

    Returns
    -------
    list of (position, normal, depth)
    """
    places: List[List[Contact]] = []
    for contact in contacts:
        normal = contact[1]
        for place in places:
            seed = place[0][1]
            if seed[0] * normal[0] + seed[1] * normal[1] + seed[2] * normal[2] > SAME_FACE:
                place.append(contact)
                break
        else:
            if len(places) < min(FACES, limit):
                places.append([contact])
    return [merge(place) if len(place) > 1 else place[0] for place in places]


def deepest_faces(contacts: List[Contact], limit: int) -> List[Contact]:
    """Select the deepest contact of each plane, of those of a ball with a mesh or heightmap.

    The triangles around the one below the ball give contacts at their edges.  An average of all would be beside the
    lowest point of the ball and make it roll.

    Parameters
    ----------
    contacts : list of (position, normal, depth)
    limit : int
        Greatest number of contacts to return.

    Returns
    -------
    list of (position, normal, depth)
        Deepest first.
    """
    left = list(contacts)
    kept: List[Contact] = []
    while left and len(kept) < min(FACES, limit):
        best = max(range(len(left)), key=lambda index: (left[index][2], -index))
        seed = left[best][1]
        kept.append(left[best])
        left = [contact for index, contact in enumerate(left) if index != best and not (
            seed[0] * contact[1][0] + seed[1] * contact[1][1] + seed[2] * contact[1][2] > SAME_PLANE)]
    return kept


def reduced(contacts: List[Contact], surface: PairSurface) -> List[Contact]:
    """Return the contacts to use, of several that were found for a pair.

    Parameters
    ----------
    contacts : list of (position, normal, depth)
    surface : PairSurface

    Returns
    -------
    list of (position, normal, depth)
    """
    if surface.merge == MERGE_ALL:
        return [merge(contacts)]
    if surface.merge == MERGE_FACES:
        return merge_faces(contacts, surface.max_contacts)
    if surface.merge == MERGE_DEEPEST:
        return deepest_faces(contacts, surface.max_contacts)
    return spread(contacts, surface.max_contacts) if len(contacts) > surface.max_contacts else contacts


def spread(contacts: List[Contact], limit: int) -> List[Contact]:
    """Select ``limit`` contacts that support the pair as well as all of them do.

    The first is the deepest one.  Each further one is the one farthest from those selected; among equals, the first.

    Parameters
    ----------
    contacts : list of (position, normal, depth)
    limit : int

    Returns
    -------
    list of (position, normal, depth)
        In their order.
    """
    chosen = [max(range(len(contacts)), key=lambda index: (contacts[index][2], -index))]
    nearest = [math.inf] * len(contacts)
    while len(chosen) < limit:
        last = contacts[chosen[-1]][0]
        best, best_distance = -1, -1.0
        for index, (position, _, _) in enumerate(contacts):
            distance = ((position[0] - last[0]) ** 2 + (position[1] - last[1]) ** 2 + (position[2] - last[2]) ** 2)
            if distance < nearest[index]:
                nearest[index] = distance
            if nearest[index] > best_distance and index not in chosen:
                best, best_distance = index, nearest[index]
        chosen.append(best)
    return [contacts[index] for index in sorted(chosen)]
