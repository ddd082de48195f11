# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of chosen collisions as they come out of the solver, kept for whoever asked until they are fetched."""
from collections import namedtuple

from m2wr_sim.geometry import cross

ContactReport = namedtuple("ContactReport", "step first second position normal depth force torque")
"""One contact point of one step, as the ``first`` of two ``model::link::collision`` names meets it.

``position`` [m], the unit ``normal`` that points into the first, ``depth`` [m], and what the contact does to the
first's link: ``force`` [N] and ``torque`` [N m] about its centre of mass (about its frame's origin where it is static).
All vectors are in world axes.
"""


class ContactWatch:
    """The newest contacts of some collisions: of each pair those of the last step in which it touched.

    Parameters
    ----------
    names : iterable of str
        ``model::link::collision`` names of what is watched.
    """

    def __init__(self, names):
        self.names = frozenset(names)
        self._newest = {}

    def add(self, report):
        """Take a report; one of a later step replaces those of the pair that are there."""
        kept = self._newest.setdefault((report.first, report.second), [])
        if kept and kept[0].step != report.step:
            del kept[:]
        kept.append(report)

    def drain(self):
        """Return one list of :class:`ContactReport` a pair, ordered by names, and forget them."""
        newest, self._newest = self._newest, {}
        return [newest[pair] for pair in sorted(newest)]


def hand_out(watches, step, sides, geometry, feedback):
    """Give one contact point to every watch that one of its two sides belongs to.

    Parameters
    ----------
    watches : list of ContactWatch
    step : int
        Number of the step.
    sides : ((str, bool, tuple), (str, bool, tuple))
        Of the two collisions: name, whether the link moves, and where the link is.
    geometry : (tuple, tuple, float)
        Position, normal into the first, depth.
    feedback : sequence of 4 tuples
        ODE's: force and torque on its first body, force and torque on its second body.  Where only one side moves,
        that one is ODE's first body, whichever side it is, and the second pair means nothing.
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


def _reaction(force, position, origin):
    """Return what a contact does to a link that cannot move, from the force on the other side."""
    force = tuple(-value for value in force)
    return force, cross(tuple(a - b for a, b in zip(position, origin)), force)
