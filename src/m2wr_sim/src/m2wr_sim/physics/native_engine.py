"""The world built with pyode and stepped in compiled code; the same numbers as PyodeEngine, several times faster.

pyode gives the native handles of what it builds; from there libode is driven without it.  The block of memory that the
compiled loop works on is filled anew whenever the world's make-up has changed.
"""
import numpy as np
import ode

from m2wr_sim.errors import SimError
from m2wr_sim.physics import native_ode, step_kernels as kernels
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.engine import Touch
from m2wr_sim.physics.pyode_bodies import PARAM_FMAX, PARAM_VEL
from m2wr_sim.physics.pyode_engine import PyodeEngine


_SECTIONS = (kernels.H_CONTACTS, kernels.H_PAIRS, kernels.H_GEOMS, kernels.H_SPACES, kernels.H_HINGES,
             kernels.H_DAMPED_JOINTS, kernels.H_DAMPED_LINKS, kernels.H_BODIES, kernels.H_NOW, kernels.H_BEFORE,
             kernels.H_LOG)


class NativeEngine(PyodeEngine):
    """See :class:`~m2wr_sim.physics.engine.Engine`."""

    def __init__(self, settings):
        super().__init__(settings)
        self._library = native_ode.library()
        self._group = self._library.dJointGroupCreate(0)
        self._words = self._values = None
        self._rows = []                         # names of geoms by row
        self._angles = {}                       # hinge -> where the block keeps its angle
        self._handles = {}                      # link -> handle of its body
        self._makeup = 0                        # grows with every change of what the world is made of

    def _refresh_lists(self):
        super()._refresh_lists()
        self._forget_block()
        self._makeup += 1
        self._handles = {link: self._handles.get(link) or self._body_handle(link)
                         for parts in self._moving for link in parts.links}

    def remove_model(self, handle):
        self._forget_block()            # carries the touches over while the model's names are still known
        super().remove_model(handle)

    def _forget_block(self):
        if self._words is not None:
            self._carry_touches()
            for drive, at in self._angles.items():
                drive.angle = float(self._values[at])
        self._words = self._values = None
        self._angles = {}

    def step(self, count):
        if not self._moving:
            self._steps += count
            return
        if self._words is None:
            self._fill_block()
        words = self._words
        kernels.run(words, self._values, count, self._dt)
        self._steps += count
        if words[kernels.H_LOG_COUNT]:
            self._read_log()
        if words[kernels.H_LOST]:
            self._tell_lost()

    def _tell_lost(self):
        """Say which body has been thrown out of the world, and what drove it."""
        steps = int(self._words[kernels.H_STEPS])
        parts, link = [(parts, link) for parts in self._moving for link in parts.links][
            int(self._words[kernels.H_LOST]) - 1]
        motors = ["%s %g with up to %g" % (drive.spec.name, drive.joint.getParam(PARAM_VEL),
                                           drive.joint.getParam(PARAM_FMAX))
                  for drive in parts.joints if drive.spec.kind in ("revolute", "prismatic")]
        raise SimError("step %d (%g ms each): %s is at %s and moves at %s m/s; the world has come apart and cannot go "
                       "on. Motors: %s" % (steps, 1e3 * self._dt, link.name, link.body.getPosition(),
                                           link.body.getLinearVel(), ", ".join(motors) or "none"))

    # ---- the block ---------------------------------------------------------------------------------------------

    def _fill_block(self):
        """Lay out the block for the world as it is now."""
        geoms = [(geom, self._shapes[geom]) for parts in self._parts.values() for geom in parts.geoms]
        classes, representatives = self._classes(shape for _, shape in geoms)
        touching = kernels.MAX_TOUCHING * kernels.TOUCH_WORDS
        sizes = (kernels.MAX_FOUND * kernels.CONTACT_WORDS, len(representatives) ** 2 * kernels.PAIR_WORDS,
                 len(geoms) * kernels.GEOM_WORDS, len(self._moving) * kernels.SPACE_WORDS,
                 len(self._hinges) * kernels.HINGE_WORDS, len(self._damped_joints) * kernels.DAMPED_WORDS,
                 len(self._damped_links) * kernels.DAMPED_WORDS, len(self._handles), touching, touching,
                 kernels.MAX_LOG * kernels.LOG_WORDS)
        words = np.zeros(kernels.HEADER_WORDS + sum(sizes), np.uint64)
        starts = {}
        at = kernels.HEADER_WORDS
        for section, size in zip(_SECTIONS, sizes):
            words[section] = starts[section] = at
            at += size
        self._words, self._values = words, words.view(np.float64)
        words[kernels.H_WORLD] = self._library.dBodyGetWorld(next(iter(self._handles.values())))
        words[kernels.H_GROUP], words[kernels.H_ADDRESS] = self._group, words.ctypes.data
        words[kernels.H_CALLBACK], words[kernels.H_SIZE] = kernels.near.address, words.size
        words[kernels.H_CALLBACK_ITSELF] = kernels.near_itself.address
        words[kernels.H_STATIC], words[kernels.H_MOVING] = self._static_space._id(), self._moving_space._id()
        words[kernels.H_CLASS_COUNT] = len(representatives)
        words[kernels.H_QUICK], words[kernels.H_STEPS] = self.settings.solver == "quick", self._steps
        self._fill_pairs(self._values, starts[kernels.H_PAIRS], representatives)
        self._fill_geoms(starts[kernels.H_GEOMS], geoms, classes)
        self._fill_bodies(starts)
        self._fill_joints(starts)
        self._restore_touches()

    def _fill_geoms(self, start, geoms, classes):
        meets_itself = {link.name: index + 1 for parts in self._moving if parts.self_colliding
                        for index, link in enumerate(parts.links) if link.spec.self_collide}
        self._rows = []
        for index, (geom, shape) in enumerate(geoms):
            row = start + index * kernels.GEOM_WORDS
            self._words[row + kernels.G_CLASS] = classes[shape]
            self._words[row + kernels.G_BODY] = self._library.dGeomGetBody(geom._id()) or 0
            self._words[row + kernels.G_LINK] = meets_itself.get(shape.link, 0)
            self._library.dGeomSetData(geom._id(), index + 1)
            self._rows.append(shape.name)

    def _fill_bodies(self, starts):
        words, values = self._words, self._values
        words[kernels.H_SPACE_COUNT], words[kernels.H_BODY_COUNT] = len(self._moving), len(self._handles)
        for index, parts in enumerate(self._moving):
            row = starts[kernels.H_SPACES] + index * kernels.SPACE_WORDS
            words[row], words[row + 1] = parts.space._id(), parts.self_colliding
        first = starts[kernels.H_BODIES]
        words[first:first + len(self._handles)] = list(self._handles.values())
        words[kernels.H_DAMPED_LINK_COUNT] = len(self._damped_links)
        for index, link in enumerate(self._damped_links):
            row = starts[kernels.H_DAMPED_LINKS] + index * kernels.DAMPED_WORDS
            words[row] = self._handles[link]
            values[row + 1] = max(0.0, 1.0 - link.spec.linear_damping)
            values[row + 2] = max(0.0, 1.0 - link.spec.angular_damping)

    def _fill_joints(self, starts):
        words, values = self._words, self._values
        handles = self._joint_handles() if self._hinges or self._damped_joints else {}
        words[kernels.H_HINGE_COUNT], words[kernels.H_DAMPED_JOINT_COUNT] = len(self._hinges), len(self._damped_joints)
        for index, drive in enumerate(self._hinges):
            row = starts[kernels.H_HINGES] + index * kernels.HINGE_WORDS
            words[row], values[row + 1] = handles[drive], drive.angle
            self._angles[drive] = row + 1
        for index, drive in enumerate(self._damped_joints):
            row = starts[kernels.H_DAMPED_JOINTS] + index * kernels.DAMPED_WORDS
            words[row], values[row + 1], words[row + 2] = handles[drive], abs(drive.spec.axis.damping), drive.hinge

    def _body_handle(self, link):
        """Return the native handle of a link's body: asked of a geom on it, which may be there just for that."""
        probe = ode.GeomSphere(None, 1.0)
        probe.setBody(link.body)
        return self._library.dGeomGetBody(probe._id())

    def _joint_handles(self):
        """Return the native handles of all joints: a body lists its joints from the one attached last."""
        handles = {}
        for parts in self._moving:
            by_name, seen = {link.spec.name: self._handles[link] for link in parts.links}, {}
            for drive in reversed(parts.joints):
                ends = [by_name[end] for end in {drive.spec.child, drive.spec.parent} if end != "world"]
                handles[drive] = self._library.dBodyGetJoint(
                    by_name[drive.spec.child], seen.get(by_name[drive.spec.child], 0))
                for end in ends:
                    seen[end] = seen.get(end, 0) + 1
        return handles

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

    # ---- state -------------------------------------------------------------------------------------------------

    def joint_angle(self, joint):
        at = self._angles.get(self._joints[joint])
        return super().joint_angle(joint) if at is None else float(self._values[at])

    def set_joint_angle(self, joint, angle):
        super().set_joint_angle(joint, angle)
        at = self._angles.get(self._joints[joint])
        if at is not None:
            self._values[at] = angle

    def pose_reader(self, parts):
        entries = [self._links[link] for link, _ in parts]
        if not parts or any(entry.body is None for entry in entries):
            return super().pose_reader(parts)
        bodies, makeup = None, -1
        shifts = np.array([entry.com for entry in entries], dtype=float)
        offsets = np.array([tuple(position) + tuple(orientation) for _, (position, orientation) in parts], dtype=float)

        def read(positions, orientations):
            nonlocal bodies, makeup
            if makeup != self._makeup:          # a handle must not be used once its body may be gone
                makeup = self._makeup
                bodies = np.array([self._handles[self._links[link]] for link, _ in parts], np.uint64)
            kernels.read_poses(bodies, shifts, offsets, positions, orientations)

        return read

    # ---- touches -----------------------------------------------------------------------------------------------

    def _read_log(self):
        words, values = self._words, self._values
        for index in range(int(words[kernels.H_LOG_COUNT])):
            at = int(words[kernels.H_LOG]) + index * kernels.LOG_WORDS
            one, two = sorted((self._rows[int(words[at + 1]) - 1], self._rows[int(words[at + 2]) - 1]))
            self._touches.append(
                Touch(int(words[at]), one, two, tuple(values[at + 3:at + 6]), float(values[at + 6])))
        words[kernels.H_LOG_COUNT] = 0

    def _carry_touches(self):
        """Keep which pairs touch, by name, over a change of the block or a step by pyode."""
        words, values = self._words, self._values
        self._touching = {}
        for index in range(int(words[kernels.H_BEFORE_COUNT])):
            at = int(words[kernels.H_BEFORE]) + index * kernels.TOUCH_WORDS
            names = tuple(sorted((self._rows[int(words[at]) - 1], self._rows[int(words[at + 1]) - 1])))
            self._touching[names] = (tuple(values[at + 2:at + 5]), float(values[at + 5]))

    def _restore_touches(self):
        words = self._words
        rows = {name: index + 1 for index, name in enumerate(self._rows)}
        kept = [names for names in self._touching if names[0] in rows and names[1] in rows][:kernels.MAX_TOUCHING]
        for index, names in enumerate(kept):
            at = int(words[kernels.H_BEFORE]) + index * kernels.TOUCH_WORDS
            words[at], words[at + 1] = sorted((rows[names[0]], rows[names[1]]))
        words[kernels.H_BEFORE_COUNT] = len(kept)

    def forget(self):
        self._forget_block()
        super().forget()

    def close(self):
        if self._group is not None:
            self._library.dJointGroupDestroy(self._group)
            self._group = None
        super().close()
