"""The world built with pyode and stepped in compiled code; the same numbers as PyodeEngine, several times faster.

pyode gives the native handles of what it builds; from there libode is driven without it.  The block of memory that the
compiled loop works on is filled anew whenever the world's make-up has changed.
"""
import numpy as np
import ode

from m2wr_sim.physics import native_ode, step_kernels as kernels
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.engine import Touch
from m2wr_sim.physics.pyode_engine import PyodeEngine


class NativeEngine(PyodeEngine):
    """See :class:`~m2wr_sim.physics.engine.Engine`.

    Worlds with damping, or with models whose links collide among themselves, are stepped by pyode.
    """

    def __init__(self, settings):
        super().__init__(settings)
        self._library = native_ode.library()
        self._group = self._library.dJointGroupCreate(0)
        self._words = self._values = None
        self._rows = []                         # names of geoms by row

    def _refresh_lists(self):
        super()._refresh_lists()
        self._forget_block()

    def _forget_block(self):
        if self._words is not None:
            self._carry_touches()
        self._words = self._values = None

    def step(self, count):
        if not self._moving:
            self._steps += count
            return
        if self._damped_joints or self._damped_links or any(parts.self_colliding for parts in self._moving):
            self._forget_block()
            super().step(count)
            return
        if self._words is None:
            self._fill_block()
        kernels.run(self._words, self._values, count, self._dt)
        self._steps += count
        if self._words[kernels.H_LOG_COUNT]:
            self._read_log()
        self._unwrap(count)

    def _fill_block(self):
        """Lay out the block for the world as it is now."""
        geoms = [(geom, self._shapes[geom]) for parts in self._parts.values() for geom in parts.geoms]
        classes, representatives = self._classes(shape for _, shape in geoms)
        sizes = ((kernels.H_CONTACTS, kernels.MAX_FOUND * kernels.CONTACT_WORDS),
                 (kernels.H_PAIRS, len(representatives) ** 2 * kernels.PAIR_WORDS),
                 (kernels.H_GEOMS, len(geoms) * kernels.GEOM_WORDS), (kernels.H_SPACES, len(self._moving)),
                 (kernels.H_NOW, kernels.MAX_TOUCHING * kernels.TOUCH_WORDS),
                 (kernels.H_BEFORE, kernels.MAX_TOUCHING * kernels.TOUCH_WORDS),
                 (kernels.H_LOG, kernels.MAX_LOG * kernels.LOG_WORDS))
        words = np.zeros(kernels.HEADER_WORDS + sum(size for _, size in sizes), np.uint64)
        values = words.view(np.float64)
        start = kernels.HEADER_WORDS
        for section, size in sizes:
            words[section] = start
            start += size
        body = next(link.body for parts in self._moving for link in parts.links)
        words[kernels.H_WORLD] = self._world_handle(body)
        words[kernels.H_GROUP], words[kernels.H_ADDRESS] = self._group, words.ctypes.data
        words[kernels.H_CALLBACK], words[kernels.H_SIZE] = kernels.near.address, words.size
        words[kernels.H_STATIC], words[kernels.H_MOVING] = self._static_space._id(), self._moving_space._id()
        words[kernels.H_SPACE_COUNT], words[kernels.H_CLASS_COUNT] = len(self._moving), len(representatives)
        words[kernels.H_QUICK], words[kernels.H_STEPS] = self.settings.solver == "quick", self._steps
        first = int(words[kernels.H_SPACES])
        words[first:first + len(self._moving)] = [parts.space._id() for parts in self._moving]
        self._fill_pairs(values, int(words[kernels.H_PAIRS]), representatives)
        self._rows = []
        for index, (geom, shape) in enumerate(geoms):
            row = int(words[kernels.H_GEOMS]) + index * kernels.GEOM_WORDS
            words[row + kernels.G_CLASS] = classes[shape]
            words[row + kernels.G_BODY] = self._library.dGeomGetBody(geom._id()) or 0
            self._library.dGeomSetData(geom._id(), index + 1)
            self._rows.append(shape.name)
        self._words, self._values = words, values
        self._restore_touches()

    def _world_handle(self, body):
        for parts in self._moving:
            for geom in parts.geoms:
                handle = self._library.dGeomGetBody(geom._id())
                if handle:
                    return self._library.dBodyGetWorld(handle)
        probe = self._probe_geom(body)
        return self._library.dBodyGetWorld(self._library.dGeomGetBody(probe._id()))

    @staticmethod
    def _probe_geom(body):
        """Return a geom on a body that has none, just to learn the body's handle; it dies with its last use."""
        geom = ode.GeomSphere(None, 1.0)
        geom.setBody(body)
        return geom

    @staticmethod
    def _classes(shapes):
        """Group shapes that make the same contacts; returns ``{shape: class}`` and one shape of each class."""
        numbers, classes, representatives = {}, {}, []
        for shape in shapes:
            collision = shape.collision
            key = (collision.surface, type(collision.geometry), collision.max_contacts, shape.wheel, shape.moves)
            if key not in numbers:
                numbers[key] = len(representatives)
                representatives.append(shape)
            classes[shape] = numbers[key]
        return classes, representatives

    def _fill_pairs(self, values, start, representatives):
        count = len(representatives)
        for one_index, one in enumerate(representatives):
            for two_index, two in enumerate(representatives):
                if not (one.moves or two.moves):
                    continue
                both_move = one.moves and two.moves
                surface = pair_surface(one.collision, two.collision, one.wheel, two.wheel, both_move, self.settings)
                if surface is None:
                    continue
                at = start + (one_index * count + two_index) * kernels.PAIR_WORDS
                values[at:at + 15] = (1.0, surface.mode, surface.mu, surface.mu2, surface.steep_mu, surface.slip1,
                                      surface.slip2, surface.bounce, surface.bounce_velocity, surface.soft_erp,
                                      surface.soft_cfm, surface.max_contacts, surface.merge, surface.ground, both_move)

    # ---- touches -----------------------------------------------------------------------------------------------

    def _read_log(self):
        words, values = self._words, self._values
        for index in range(int(words[kernels.H_LOG_COUNT])):
            at = int(words[kernels.H_LOG]) + index * kernels.LOG_WORDS
            one, two = self._rows[int(words[at + 1]) - 1], self._rows[int(words[at + 2]) - 1]
            self._touches.append(
                Touch(int(words[at]), one, two, tuple(values[at + 3:at + 6]), float(values[at + 6])))
        words[kernels.H_LOG_COUNT] = 0

    def _carry_touches(self):
        """Keep which pairs touch, by name, over a change of the block or a step by pyode."""
        words, values = self._words, self._values
        self._touching = {}
        for index in range(int(words[kernels.H_BEFORE_COUNT])):
            at = int(words[kernels.H_BEFORE]) + index * kernels.TOUCH_WORDS
            names = (self._rows[int(words[at]) - 1], self._rows[int(words[at + 1]) - 1])
            self._touching[names] = (tuple(values[at + 2:at + 5]), float(values[at + 5]))

    def _restore_touches(self):
        words = self._words
        rows = {name: index + 1 for index, name in enumerate(self._rows)}
        kept = [names for names in self._touching if names[0] in rows and names[1] in rows][:kernels.MAX_TOUCHING]
        for index, names in enumerate(kept):
            at = int(words[kernels.H_BEFORE]) + index * kernels.TOUCH_WORDS
            words[at], words[at + 1] = rows[names[0]], rows[names[1]]
        words[kernels.H_BEFORE_COUNT] = len(kept)

    def close(self):
        if self._group is not None:
            self._library.dJointGroupDestroy(self._group)
            self._group = None
        super().close()
