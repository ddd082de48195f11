# SPDX-License-Identifier: BSD-3-Clause
"""Merging links over fixed joints, and the names that collisions and visuals bear afterwards (Gazebo's rules).

Works on mutable records: a :class:`Body` for each URDF link, a :class:`Connection` for each URDF joint.
"""
from dataclasses import dataclass, field
from typing import Any, List, Optional, Tuple

import numpy as np

from m2wr_sim.geometry import IDENTITY, compose, matrix_from_quaternion
from m2wr_sim.model.sdf.shapes import inertia_matrix
from m2wr_sim.model.types import Axis, Inertial, Pose, Surface

WORLD = "world"
LUMP_MARK = "_fixed_joint_lump__"


@dataclass
class Part:
    """A collision or visual on its way: URDF name ('' where unnamed), link it came from, shape, pose, extras."""

    name: str
    origin: str
    geometry: Any
    pose: Pose = IDENTITY
    surface: Surface = Surface()
    rgba: Optional[Tuple[float, float, float, float]] = None


@dataclass
class Body:
    """A URDF link; ``lumped`` holds (link name, that link's frame in this one's) of what was merged into it."""

    name: str
    inertial: Optional[Inertial] = None
    collisions: List[Part] = field(default_factory=list)
    visuals: List[Part] = field(default_factory=list)
    lumped: List[Tuple[str, Pose]] = field(default_factory=list)


@dataclass
class Connection:
    """A URDF joint; ``pose`` is the child link's (= joint's) frame in the parent link's frame.

    ``reduced``: a fixed joint that is removed by merging.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose = IDENTITY
    axis: Axis = Axis()
    reduced: bool = False


def merge_inertials(base, added, base_from_added=IDENTITY):
    """Return the inertial of two bodies joined rigidly.

    Parameters
    ----------
    base, added : Inertial or None
        None counts as no mass.
    base_from_added : Pose
        The added link's frame in the base link's frame.

    Returns
    -------
    Inertial or None
        In the base link's frame: masses added, common centre of mass, tensors moved by the parallel axis theorem and
        expressed in the orientation of the base's inertial frame (identity where ``base`` is None).
    """
    if added is None:
        return base
    base = Inertial(0.0, IDENTITY, (0.0,) * 6) if base is None else base
    added_pose = compose(base_from_added, added.pose)
    mass = base.mass + added.mass
    orientation = base.pose[1]
    base_centre, added_centre = np.array(base.pose[0]), np.array(added_pose[0])
    centre = added_centre if mass <= 0.0 else (base.mass * base_centre + added.mass * added_centre) / mass
    tensor = _about(base, orientation, base_centre - centre) + _about(added, added_pose[1], added_centre - centre)
    turn = matrix_from_quaternion(orientation)
    tensor = turn.T @ tensor @ turn
    return Inertial(mass, (tuple(float(value) for value in centre), orientation),
                    tuple(float(value) for value in tensor[np.triu_indices(3)]))


def _about(inertial, orientation, offset):
    """Return a tensor in link axes about a point that lies ``-offset`` from the inertial's centre of mass."""
    turn = matrix_from_quaternion(orientation)
    return turn @ inertia_matrix(inertial) @ turn.T + inertial.mass * (
        offset @ offset * np.eye(3) - np.outer(offset, offset))


def children_of(connections):
    """Return link name -> its child connections, in alphabetical order of joint names."""
    children = {}
    for connection in sorted(connections, key=lambda connection: connection.name):
        children.setdefault(connection.parent, []).append(connection)
    return children


def depth_first(root, children):
    """Yield link names, root first, depth first, siblings in the order of ``children``."""
    stack = [root]
    while stack:
        name = stack.pop()
        yield name
        stack.extend(connection.child for connection in reversed(children.get(name, ())))


def lump(bodies, connections, root):
    """Merge every link behind a reduced joint into its parent, deepest first; works in place.

    Parameters
    ----------
    bodies : dict
        Link name -> Body; merged ones are taken out.
    connections : list of Connection
        Reduced ones are taken out; the others get the surviving parent and their pose in it.
    root : str
        Name of the root link; no link is merged into a root called ``world``.

    Returns
    -------
    list of str
        Names of the surviving links, in the order in which Gazebo lists them.
    """
    children = children_of(connections)
    order = list(depth_first(root, children))
    by_child = {connection.child: connection for connection in connections}
    reduced = {name: [connection for connection in children.get(name, ()) if connection.reduced and name != WORLD]
               for name in order}
    for name in reversed(order):        # children before their parents
        for connection in reduced[name]:
            bodies[name].inertial = merge_inertials(bodies[name].inertial, bodies[connection.child].inertial,
                                                    connection.pose)
    frames = {}                         # merged link -> the body that carries it, and its frame in that
    for name in order:
        carrier, frame = frames.get(name, (bodies[name], None))
        for connection in reduced[name]:
            frames[connection.child] = carrier, _within(frame, connection.pose)
        if frame is not None:
            _merge(carrier, bodies.pop(name), frame)
    connections[:] = [connection for connection in connections if connection.child not in frames]
    for connection in connections:
        if connection.parent in frames:
            carrier, frame = frames[connection.parent]
            connection.parent, connection.pose = carrier.name, _within(frame, connection.pose)
    return [name for name in order if name not in frames or by_child.get(name) is None]


def _within(frame, pose):
    return pose if frame is None else compose(frame, pose)


def _merge(carrier, body, frame):
    """Hand the parts of a merged link over to the one that carries it."""
    for mine, others in ((carrier.collisions, body.collisions), (carrier.visuals, body.visuals)):
        for part in others:
            part.name, part.pose = part.name or part.origin, compose(frame, part.pose)
            mine.append(part)
    carrier.lumped.append((body.name, frame))


def part_names(link, parts, suffix):
    """Return the SDF names of a link's collisions (``suffix`` ``_collision``) or visuals (``_visual``).

    The name is the URDF name, or the old link's where there is none, plus the suffix; from the second part on plus
    ``_n``; a name that does not begin with the carrying link's gets ``<link>_fixed_joint_lump__`` in front.
    """
    names = []
    for index, part in enumerate(parts):
        name = (part.name or part.origin) + suffix + ("_{}".format(index) if index else "")
        names.append(name if name.startswith(link) else link + LUMP_MARK + name)
    return names
