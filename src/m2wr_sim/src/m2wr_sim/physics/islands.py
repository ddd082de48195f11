# SPDX-License-Identifier: BSD-3-Clause
"""Islands: which movable models are in contact with one another, directly or through others, and in how many places.

The direct solver's time grows with the cube of that number: it is for robots and what they push.  Larger islands are
solved iteratively, see :class:`~m2wr_sim.physics.engine.Engine`.
"""
import logging
import math

log = logging.getLogger(__name__)

# Contacts between movable models that hang together.  The solvers cost the same at about 20; up to here the direct one,
# which is exact, takes some 2 ms a step (10 where all stand on the ground too), then 12 ms for 138 contacts, 49 for
# 230, seconds for 840, against 0.4, 0.7 and 3 ms.  Ten robots that drive at one another make 19, a robot that runs into
# a wall of nine bricks 53.
ITERATIVE_ABOVE = 64
WARNING_PERIOD = 10.0   # s of simulated time between two warnings
_NAMED = 5              # models in a message


class Islands:
    """Finds the largest island of a step that is not asleep as a whole, and warns of it."""

    def __init__(self):
        self.largest = 0            # contacts in it
        self._for, self._contacts, self._awake = {}, {}, set()
        self._warned = -math.inf

    def clear(self):
        """Begin a step."""
        if self._for:
            self._for, self._contacts, self._awake = {}, {}, set()
        self.largest = 0

    def join(self, one, two, count, awake):
        """Note that two models, known by name, touch in ``count`` places, and whether either of the links is awake."""
        one, two = self.stands_for(one), self.stands_for(two)
        total = self._contacts.get(one, 0) + count
        if one != two:
            self._for[two] = one
            total += self._contacts.pop(two, 0)
            awake = awake or two in self._awake
        self._contacts[one] = total
        if awake:
            self._awake.add(one)
        if one in self._awake and total > self.largest:
            self.largest = total

    def stands_for(self, name):
        """Return a model that is the same for all models that hang together with the one of that name."""
        self._for.setdefault(name, name)
        while self._for[name] != name:
            self._for[name] = self._for[self._for[name]]        # shorter the next time
            name = self._for[name]
        return name

    def members(self):
        """Return the names of the models in the largest island, sorted."""
        leaders = [name for name, total in self._contacts.items() if total == self.largest and name in self._awake]
        return sorted(name for name in self._for if self.stands_for(name) in leaders[:1])

    def warn(self, step, dt, names, contacts, iterations):
        """Log which models are in an island and how it is solved, at most once in :data:`WARNING_PERIOD`.

        Parameters
        ----------
        step : int
        dt : float
            Length of a step [s].
        names : callable
            Returns the names of the models.
        contacts : int
        iterations : int
            Of the iterative solver.
        """
        if abs(step - self._warned) * dt < WARNING_PERIOD:
            return
        self._warned, names = step, names()
        more = " and %d more" % (len(names) - _NAMED) if len(names) > _NAMED else ""
        log.warning("step %d (%g ms each): %d models touch one another in %d places: %s%s. The exact solver is too "
                    "slow for that, so as long as it lasts steps are solved in %d iterations. If they were spawned "
                    "into one another, put them apart or delete some", step, 1e3 * dt, len(names), contacts,
                    ", ".join(names[:_NAMED]), more, iterations)
