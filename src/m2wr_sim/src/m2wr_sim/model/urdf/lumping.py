# SPDX-License-Identifier: BSD-3-Clause
"""Merges links over fixed joints, and names collisions and visuals afterwards, by Gazebo's rules.

Works on mutable records: a :class:`Body` for each URDF link, a :class:`Connection` for each URDF joint.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.geometry import IDENTITY, compose, matrix_from_quaternion
from m2wr_sim.model.sdf.shapes import inertia_matrix
from m2wr_sim.model.types import Axis, Inertial, Pose, Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Quaternion

WORLD = "world"
LUMP_MARK = "_fixed_joint_lump__"


@dataclass
class Part:
    """A collision or visual: URDF name (empty if it has none), link of the URDF, shape, pose, surface or colour."""

    name: str
    origin: str
    geometry: Any           # a Geometry, or of a visual a VisualGeometry
    pose: Pose = IDENTITY
    surface: Surface = Surface()
    rgba: Optional[Tuple[float, float, float, float]] = None


@dataclass
class Body:
    """A URDF link; ``lumped`` has (name, pose in this link) of each link that was merged into it."""

    name: str
    inertial: Optional[Inertial] = None
    collisions: List[Part] = field(default_factory=list)
    visuals: List[Part] = field(default_factory=list)
    lumped: List[Tuple[str, Pose]] = field(default_factory=list)


@dataclass
class Connection:
    """A URDF joint; ``pose`` is the child link's (= joint's) frame in the parent link's frame.

    ``reduced``: a fixed joint that is removed by merging.  ``mimic``: the joint that it follows, multiplier, offset.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose = IDENTITY
    axis: Axis = Axis()
    reduced: bool = False
    mimic: Optional[Tuple[str, float, float]] = None


def merge_inertials(base: Optional[Inertial], added: Optional[Inertial],
                    base_from_added: Pose = IDENTITY) -> Optional[Inertial]:
    """Return the inertial of two bodies joined rigidly.

    Parameters
    ----------
    base, added : Inertial or None
        None means no mass.
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
    base = Inertial(0.0, IDENTITY, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) if base is None else base
    added_pose = compose(base_from_added, added.pose)
    mass = base.mass + added.mass
    orientation = base.pose[1]
    base_centre, added_centre = np.array(base.pose[0]), np.array(added_pose[0])
    centre = added_centre if mass <= 0.0 else (base.mass * base_centre + added.mass * added_centre) / mass
    tensor = _about(base, orientation, base_centre - centre) + _about(added, added_pose[1], added_centre - centre)
    rotation = matrix_from_quaternion(orientation)
    tensor = rotation.T @ tensor @ rotation
    x, y, z = centre.tolist()
    xx, xy, xz, yy, yz, zz = tensor[np.triu_indices(3)].tolist()
    return Inertial(mass, ((x, y, z), orientation), (xx, xy, xz, yy, yz, zz))


def _about(inertial: Inertial, orientation: Quaternion, offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a tensor in link axes about a point at ``-offset`` from the centre of mass of the inertial."""
    rotation = matrix_from_quaternion(orientation)
    return rotation @ inertia_matrix(inertial) @ rotation.T + inertial.mass * (
        offset @ offset * np.eye(3) - np.outer(offset, offset))


def children_of(connections: Iterable[Connection]) -> Dict[str, List[Connection]]:
    """Return link name -> its child connections, in alphabetical order of joint names."""
    children: Dict[str, List[Connection]] = {}
    for connection in sorted(connections, key=lambda connection: connection.name):
        children.setdefault(connection.parent, []).append(connection)
    return children


def depth_first(root: str, children: Mapping[str, Sequence[Connection]]) -> Iterator[str]:
    """Yield link names, root first, depth first, siblings in the order of ``children``.

    Parameters
    ----------
    root : str
    children : dict
        See :func:`children_of`.
    """
    stack = [root]
    while stack:
        name = stack.pop()
        yield name
        stack.extend(connection.child for connection in reversed(children.get(name, ())))


def lump(bodies: Dict[str, Body], connections: List[Connection], root: str) -> List[str]:
    """Merge every link behind a reduced joint into its parent, deepest first; works in place.

    Parameters
    ----------
    bodies : dict
        Link name -> Body; merged ones are removed.
    connections : list of Connection
        Reduced ones are removed; the others get the remaining parent and their pose in it.
    root : str
        Name of the root link; no link is merged into a root called ``world``.

    Returns
    -------
    list of str
        Names of the remaining links, in the order of Gazebo.
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
    frames: Dict[str, Tuple[Body, Pose]] = {}       # merged link -> the body that carries it, and its frame in that
    for name in order:
        carrier, frame = frames[name] if name in frames else (bodies[name], None)
        for connection in reduced[name]:
            frames[connection.child] = carrier, _within(frame, connection.pose)
        if frame is not None:
            _merge(carrier, bodies.pop(name), frame)
    connections[:] = [connection for connection in connections if connection.child not in frames]
    for connection in connections:
        if connection.parent in frames:
            carrier, frame = frames[connection.parent]
            connection.parent, connection.pose = carrier.name, compose(frame, connection.pose)
    return [name for name in order if name not in frames or by_child.get(name) is None]


def _within(frame: Optional[Pose], pose: Pose) -> Pose:
    return pose if frame is None else compose(frame, pose)


def _merge(carrier: Body, body: Body, frame: Pose) -> None:
    """Move the parts of a merged link to the one that carries it."""
    for mine, others in ((carrier.collisions, body.collisions), (carrier.visuals, body.visuals)):
        for part in others:
            part.name, part.pose = part.name or part.origin, compose(frame, part.pose)
            mine.append(part)
    carrier.lumped.append((body.name, frame))


def part_names(link: str, parts: Sequence[Part], suffix: str) -> List[str]:
    """Return the SDF names of a link's collisions or visuals.

    The name is the URDF name, or that of the original link if there is none, plus the suffix; from the second part on
    plus ``_n``.  A name that does not begin with the name of the carrying link gets the prefix
    ``<link>_fixed_joint_lump__``.

    Parameters
    ----------
    link : str
        Link that carries the parts.
    parts : list of Part
    suffix : str
        ``_collision`` or ``_visual``.

    Returns
    -------
    list of str
    """
    names = []
    for index, part in enumerate(parts):
        name = (part.name or part.origin) + suffix + ("_{}".format(index) if index else "")
        names.append(name if name.startswith(link) else link + LUMP_MARK + name)
    return names
