# SPDX-License-Identifier: BSD-3-Clause
"""Which contacts a pair of collisions makes, and with what surface: pure arithmetic, no engine objects.

A contact is a tuple ``(position, normal, depth)``; the normal points from the second shape into the first.
"""
import math
from collections import namedtuple

from m2wr_sim.model.types import Box, Heightmap, Mesh, Plane, Sphere
from m2wr_sim.physics.limits import SOFTEST

MODE_MU2 = 0x001
MODE_FDIR1 = 0x002
MODE_BOUNCE = 0x004
MODE_SOFT_ERP = 0x008
MODE_SOFT_CFM = 0x010
MODE_SLIP1 = 0x100
MODE_SLIP2 = 0x200
MODE_APPROX1 = 0x7000       # friction proportional to the normal force; ODE 0.16's value, not the Python binding's

MIN_SOFT_CFM = 1e-6         # stiffer contacts than this make the direct solver lose track
HEAVY = 100.0               # kg: above that, contacts get stiffer with the mass
BOX_CONTACTS = 4            # a face needs no more than its corners
MESH_CONTACTS = 8           # of any other shape with triangles, which each may give several
MERGE_ALL, MERGE_FACES, MERGE_DEEPEST = 1, 2, 3
FACES = 4                   # most differently inclined places at which one wheel or ball touches one mesh
SAME_FACE = 0.8             # cosine of the angle between normals that still belong to one place: 37 degrees
SAME_PLANE = 0.998          # the same for a ball, which touches a plane in one point: 4 degrees
ALONG_AT_LEAST = 0.02       # sine of the angle to the normal below which a friction direction means nothing
STEEP = 0.5                 # |normal z| below this: a touch that is told, not ground

# Cosine of the steepest face (37 degrees) that a robot stands on, which alone is solved once.  Where a plane carries
# all of a robot friction changes how the load is shared, not the load.  m2wr driven from rest at 0.4 and 0.5 m/s for
# 1.5 s is then 6 mm (of 0.65 m) from where it gets if every contact is coupled, 7 mm at 10 degrees, 60 mm at 20.
FLAT = 0.8

# Part of the greatest normal force of an island that a limit of friction may be off.  Friction is as far off, so less
# than the 1 % by which sliding along walls agrees with its closed form (test_coupled_friction).
AGREED = 0.001

PairSurface = namedtuple(
    "PairSurface",
    "mode mu mu2 slip1 slip2 bounce bounce_velocity soft_erp soft_cfm max_contacts merge ground "
    "along along_second")


def load_class(mass):
    """Return how many times stiffer than usual the contacts of a model of that mass [kg] must be, a power of two.

    The world's compliance lets a contact carry ``max_correcting_velocity / cfm`` (10 kN) and no more: what weighs tons
    would sink without end.  Compliance in proportion to mass gives heavy things the depth, and the solver the numbers,
    of :data:`HEAVY`.
    """
    return 2.0 ** math.ceil(math.log2(mass / HEAVY)) if HEAVY < mass < math.inf else 1.0


def pair_surface(first, second, first_is_wheel, second_is_wheel, both_move, settings, stiffer=1.0):
    """Combine two collisions into one :class:`PairSurface`, by Gazebo's rules.

    Friction and restitution take the smaller value, slip adds up, stiffness combines as springs in series.  Gazebo's
    default stiffness (1e12) means a rigid contact; anything softer is converted to ERP and CFM for this step and
    kept above :data:`MIN_SOFT_CFM`.

    Parameters
    ----------
    first, second : Collision
    first_is_wheel, second_is_wheel : bool
        Wheels get a single merged contact.
    both_move : bool
        Whether both belong to bodies; a contact between two bodies is never "standing on the ground".
    settings : EngineSettings
    stiffer : float
        The :func:`load_class` of the lighter of those that move.

    Returns
    -------
    PairSurface or None
        None where the pair never makes contacts.
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
    limit = min(settings.max_contacts, max(1, first.max_contacts), max(1, second.max_contacts))
    shapes, merging = (first.geometry, second.geometry), MERGE_ALL if wheel else 0
    if any(isinstance(shape, (Mesh, Heightmap)) for shape in shapes):
        limit = min(limit, MESH_CONTACTS)
        if any(isinstance(shape, Sphere) for shape in shapes):
            merging = MERGE_DEEPEST
        elif wheel:
            merging = MERGE_FACES
    if any(isinstance(shape, Box) for shape in shapes):
        limit = min(limit, BOX_CONTACTS)
    along, along_second = _friction_direction(one.fdir1, two.fdir1)
    if any(along):
        mode |= MODE_FDIR1 | MODE_MU2
    ground = not both_move and (isinstance(first.geometry, Plane) or isinstance(second.geometry, Plane))
    return PairSurface(mode, mu, mu2, slip1, slip2, bounce, min(one.restitution_threshold, two.restitution_threshold),
                       soft_erp, soft_cfm, limit, merging, ground, along, along_second)


def _friction_direction(one, two):
    """Return the direction of a pair's mu, as a unit vector in a shape's axes, and whether that is the second shape.

    The first shape's counts; zeros where neither has one: ODE then chooses by the normal alone.
    """
    for vector, second in ((one, False), (two, True)):
        length = math.sqrt(sum(value * value for value in vector))
        if length > 0.0:
            return tuple(value / length for value in vector), second
    return (0.0, 0.0, 0.0), False


def next_limit(used, felt):
    """Return the normal force [N] from which the limits of a contact's friction are taken in the next solve.

    Half way between the last one and the one felt.  Where wheels of radius r and friction mu drive at a wall, their
    other support d behind them, the ground carries less the harder the wall is pressed, and the wall is pressed the
    harder the more the ground carries: from solve to solve the forces turn about their solution by a factor rho, with
    rho^2 = mu (r + mu (d + r)) / d, 1.3 for mu = 1 and d = 3 r.  Taken in full they would run away from it.  Half way,
    a solve leaves sqrt(1 + rho^2) / 2 of a deviation, less than all of it up to rho = 1.7.

    Parameters
    ----------
    used, felt : float
        Normal force that the last solve's limit was taken from, below 0 where none was known, and what it found [N].
    """
    return felt if used < 0.0 else 0.5 * (used + felt)


def along_surface(direction, normal):
    """Return the unit vector of a direction's part along a surface, or None where it points nearly into it.

    The direction of friction turns with its shape; without this a rolling wheel's would dive into the ground.
    """
    into = direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2]
    x, y, z = direction[0] - into * normal[0], direction[1] - into * normal[1], direction[2] - into * normal[2]
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > ALONG_AT_LEAST else None


def _smaller_friction(one, two):
    """Return the smaller coefficient; a negative one stands for infinite friction."""
    one, two = (math.inf if value < 0.0 else value for value in (one, two))
    return min(one, two)


def has_direction(normal):
    """Return whether a contact's normal is the unit vector that it should be.

    libode finds none where a sphere's centre lies on a cylinder's axis: not a number, for which it ends the process.
    """
    return 0.5 < normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2] < 2.0


def merge(contacts):
    """Average the contacts of one wheel into one, in the wheel's middle plane.

    A cylinder on a plane touches at both rim edges; in a turn the solver would let one of them stick and the track
    width would be wrong by the wheel's width.  The mean point with the mean normal and the greatest depth rolls true.
    Contacts whose normals cancel out (a wheel jammed between two faces) cannot be averaged: the deepest one stays.
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


def merge_faces(contacts, limit):
    """Average the contacts of a wheel with a mesh or heightmap, those of each place it touches at into one.

    Neighbouring triangles tell of one touch several times over, while a floor and a wall in one mesh are two.  A
    contact belongs to the first place whose first normal is like its own; places past the limit are left out.
    """
    places = []
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


def deepest_faces(contacts, limit):
    """Keep of a ball's contacts with a mesh or heightmap the deepest of each plane, deepest first.

    The triangles around the one under the ball answer, too, at their edges: averaged with those the contact would lie
    beside the ball's lowest point and set it rolling.
    """
    kept, left = [], list(contacts)
    while left and len(kept) < min(FACES, limit):
        best = max(range(len(left)), key=lambda index: (left[index][2], -index))
        seed = left[best][1]
        kept.append(left[best])
        left = [contact for index, contact in enumerate(left) if index != best and not (
            seed[0] * contact[1][0] + seed[1] * contact[1][1] + seed[2] * contact[1][2] > SAME_PLANE)]
    return kept


def reduced(contacts, surface):
    """Return the contacts that a pair makes of those found, more than one, as its PairSurface says."""
    if surface.merge == MERGE_ALL:
        return [merge(contacts)]
    if surface.merge == MERGE_FACES:
        return merge_faces(contacts, surface.max_contacts)
    if surface.merge == MERGE_DEEPEST:
        return deepest_faces(contacts, surface.max_contacts)
    return spread(contacts, surface.max_contacts) if len(contacts) > surface.max_contacts else contacts


def spread(contacts, limit):
    """Choose ``limit`` contacts that support the pair as well as all of them do.

    The deepest comes first, then always the one farthest from those chosen; ties go to the earlier one, so the choice
    depends on nothing but the contacts.
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
