# SPDX-License-Identifier: BSD-3-Clause
"""Stores the contacts of selected collisions, with the forces from the solver, until they are read."""
from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING, Dict, Iterable, List, Sequence, Tuple

from m2wr_sim.geometry import cross

if TYPE_CHECKING:
    from m2wr_sim.geometry import Vector

ContactReport = namedtuple("ContactReport", "step first second position normal depth force torque")
"""One contact point in one step, of two collisions ``first`` and ``second`` with names ``model::link::collision``.

``position`` [m]; the unit ``normal``, which points into the first; ``depth`` [m]; ``force`` [N] and ``torque`` [N m] of
the contact on the first one's link, about its centre of mass (about its frame's origin if it is static).  All vectors
are in the world frame.
"""


class ContactWatch:
    """The newest contacts of some collisions: of each pair those of the last step with a contact.

    Parameters
    ----------
    names : iterable of str
        ``model::link::collision`` names of the watched collisions.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.names = frozenset(names)
        self._newest: Dict[Tuple[str, str], List[ContactReport]] = {}

    def add(self, report: ContactReport) -> None:
        """Add a report; the first one of a later step replaces those of the same pair."""
        kept = self._newest.setdefault((report.first, report.second), [])
        if kept and kept[0].step != report.step:
            del kept[:]
        kept.append(report)

    def drain(self) -> List[List[ContactReport]]:
        """Return one list of :class:`ContactReport` for each pair, sorted by names, and remove them."""
        newest, self._newest = self._newest, {}
        return [newest[pair] for pair in sorted(newest)]


def hand_out(watches: Sequence[ContactWatch], step: int, sides: Sequence[Tuple[str, bool, Vector]],
             geometry: Tuple[Vector, Vector, float], feedback: Sequence[Vector]) -> None:
    """Add one contact point to every watch of one of its two collisions.

    Parameters
    ----------
    watches : list of ContactWatch
    step : int
        Number of the step.
    sides : ((str, bool, tuple), (str, bool, tuple))
        For each collision: name, whether its link moves, and position of the link.
    geometry : (tuple, tuple, float)
        Position, normal into the first, depth.
    feedback : sequence of 4 tuples
        From ODE: force and torque on its first body, force and torque on its second body.  If only one link moves, it
        is ODE's first body in any case, and the values of the second body are not valid.
    """
    (one, one_moves, one_at), (two, two_moves, two_at) = sides
    position, normal, depth = geometry
    if one_moves:
        on_one = feedback[0], feedback[1]
        on_two = (feedback[2], feedback[3]) if two_moves else _reaction(feedback[0], position, two_at)
    else:
        on_two = feedback[0], feedback[1]
        on_one = _reaction(feedback[0], position, one_at)
    for watch in watches:
        if one in watch.names:
            watch.add(ContactReport(step, one, two, position, normal, depth, *on_one))
        elif two in watch.names:
            watch.add(ContactReport(step, two, one, position, tuple(-value for value in normal), depth, *on_two))


def _reaction(force: Vector, position: Vector, origin: Vector) -> Tuple[Vector, Vector]:
    """Return force and torque of a contact on a static link, from the force on the other link."""
    x, y, z = (-value for value in force)
    force = x, y, z
    return force, cross(tuple(a - b for a, b in zip(position, origin)), force)
