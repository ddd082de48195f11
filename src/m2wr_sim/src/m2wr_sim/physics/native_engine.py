# SPDX-License-Identifier: BSD-3-Clause
"""Physics engine with a compiled loop; gives the same numbers as PyodeEngine, several times faster.

The world is built with pyode, which provides the native handles of its objects.  The compiled loop calls libode with
these handles.  Its block of memory is filled again after bodies, geoms or joints have been added or removed.
"""
import ctypes
import logging
import math

import numpy as np
import ode

from m2wr_sim.model.types import Plane
from m2wr_sim.physics import native_ode
from m2wr_sim.physics import step_kernels as kernels
from m2wr_sim.physics import step_layout as layout
from m2wr_sim.physics.broad_phase_kernels import count_solids
from m2wr_sim.physics.contact_watch import hand_out
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.coupled_friction import Memory
from m2wr_sim.physics.engine import ContactEvent
from m2wr_sim.physics.pyode_engine import PyodeEngine

log = logging.getLogger(__name__)

_SECTIONS = (layout.H_CONTACTS, layout.H_PAIRS, layout.H_GEOMS, layout.H_SPACES, layout.H_HINGES,
             layout.H_DAMPED_JOINTS, layout.H_DAMPED_LINKS, layout.H_BODIES, layout.H_BOUNDS, layout.H_ISLANDS,
             layout.H_NOW, layout.H_BEFORE, layout.H_LOG, layout.H_REPORTS, layout.H_GRIPS, layout.H_STATES,
             layout.H_IDLERS, layout.H_FORMER)
_NOWHERE = 1e300        # m; position of bounds that are not computed yet
_MODEL_JOINTS = (1, 2, 3, 5, 7)     # dJointType: ball, hinge, slider, universal, fixed
_DAMPERS = (9, 10)                  # dJointType: angular and linear motor
_LEVEL = 0.9            # least z component of the normal of a level plane; far above that of steep contacts


class NativeEngine(PyodeEngine):
    """See :class:`~m2wr_sim.physics.engine.Engine`.

    With ``broad_phase_bounds = False`` each step tests all models against all static shapes; the results are the same.
    """

    broad_phase_bounds = True

    def __init__(self, settings):
        super().__init__(settings)
        self._library = native_ode.library()
        self._group = self._library.dJointGroupCreate(0)
        self._probe = self._library.dCreateBox(0, 1.0, 1.0, 1.0)
        self._words = self._values = None
        self._rows, self._row_shapes = [], []   # names of geoms, and the geoms' shapes, by row
        self._angles = {}                       # hinge -> where the block keeps its angle
        self._countdowns = {}                   # countdown -> where the block keeps it
        self._handles = {}                      # link -> handle of its body
        self._contact_pair_room = layout.CONTACT_PAIR_ROOM
        self._makeup = 0                        # increases when bodies, geoms or joints are added or removed

    def _refresh_lists(self):
        super()._refresh_lists()
        self._forget_block()
        self._makeup += 1
        self._handles = {link: self._handles.get(link) or self._body_handle(link)
                         for parts in self._moving for link in parts.links}

    def remove_model(self, handle):
        self._forget_block()            # stores the contacts while the model's names are still known
        super().remove_model(handle)

    def abandon_model(self, handle):
        self._forget_block()
        super().abandon_model(handle)

    def _forget_block(self):
        if self._words is not None:
            self._store_contacts()
            self._carry_forces()
            for drive, at in self._angles.items():
                drive.angle = float(self._values[at])
            for countdown, at in self._countdowns.items():
                countdown.steps, countdown.time = self._values[at + layout.I_STEPS:at + layout.IDLE_WORDS].tolist()
        self._words = self._values = None
        self._angles, self._countdowns = {}, {}

    def _enable(self, link):
        super()._enable(link)
        at = self._countdowns.get(link.countdown)
        if at is not None:
            self._values[at + layout.I_STEPS:at + layout.IDLE_WORDS] = link.countdown.steps, link.countdown.time

    def step(self, count):
        self.version += 1
        if not self._moving:
            self._steps += count
            return
        if self._words is None:
            self._fill_block()
        run, words = kernels.run, self._words
        while True:
            taken = run(words, count)               # fewer if a list is full; negative if there are events to read
            self._steps += abs(taken)
            if taken == count:
                return
            count -= abs(taken)
            if taken < 0:
                self._read_events(count)
            if not count:
                break
        if 2 * words[layout.H_BEFORE_COUNT] > self._contact_pair_room:
            self._make_room()

    def _read_events(self, left):
        words = self._words
        if words[layout.H_LOG_COUNT]:
            self._read_log()
        if words[layout.H_REPORT_COUNT]:
            self._read_reports()
        if words[layout.H_ITERATIVE]:
            words[layout.H_ITERATIVE] = 0
            self._warn_of_island(self._island_members, int(words[layout.H_LARGEST_ISLAND]))
        if words[layout.H_LOST]:
            words[layout.H_LOST] = 0
            raise self._lost(left)

    def _island_members(self):
        """Return the names of the models in the largest island of the last step."""
        words = self._words
        start = int(words[layout.H_ISLANDS])
        rows = range(start, start + len(self._moving) * layout.ISLAND_WORDS, layout.ISLAND_WORDS)
        leaders = {}
        for row in rows:                # the representative of a model comes before it
            if words[row + layout.X_STEP] == words[layout.H_STEPS]:
                leaders[row] = leaders.get(int(words[row + layout.X_FOR]), row)
        largest = [row for row, leader in leaders.items() if leader == row and words[row + layout.X_AWAKE]
                   and words[row + layout.X_CONTACTS] == words[layout.H_LARGEST_ISLAND]]
        return sorted(parts.name for parts, row in zip(self._moving, rows) if leaders.get(row) in largest[:1])

    def _make_room(self):
        """Reserve more room for the contact pairs of a step before it is used up; log how many were lost."""
        count, missed = int(self._words[layout.H_BEFORE_COUNT]), int(self._words[layout.H_MISSED])
        if missed:
            log.warning("step %d: more pairs are in contact than there was room for; %d contacts are not reported",
                        self._steps, missed)
        if 2 * count > self._contact_pair_room:
            self._forget_block()
            self._contact_pair_room = 4 * count

    # ---- the block ---------------------------------------------------------------------------------------------

    def _fill_block(self):
        """Allocate and fill the block for the present world."""
        geoms = [(geom, self._shapes[geom]) for parts in self._parts.values() for geom in parts.geoms]
        classes, representatives = self._classes(shape for _, shape in geoms)
        self._contact_pair_room = max(self._contact_pair_room, 4 * sum(shape.moves for _, shape in geoms))
        pairs = self._contact_pair_room * layout.CONTACT_PAIR_WORDS
        log_room = self._contact_pair_room + layout.SPARE_LOG
        most_kept = self._most_kept()
        sizes = ((most_kept + layout.MAX_FOUND) * layout.CONTACT_WORDS,
                 len(representatives) ** 2 * layout.PAIR_WORDS,
                 len(geoms) * layout.GEOM_WORDS, len(self._moving) * layout.SPACE_WORDS,
                 len(self._hinges) * layout.HINGE_WORDS, len(self._damped_joints) * layout.DAMPED_WORDS,
                 len(self._damped_links) * layout.DAMPED_WORDS, len(self._handles),
                 len(self._handles) * layout.BOUNDS_WORDS, len(self._moving) * layout.ISLAND_WORDS, pairs, pairs,
                 log_room * layout.LOG_WORDS,
                 layout.MAX_REPORTS * layout.REPORT_WORDS if self._watches else 0,
                 most_kept * layout.GRIP_WORDS, len(self._handles) * layout.STATE_WORDS,
                 len(self._idlers) * layout.IDLE_WORDS, most_kept * layout.FORMER_WORDS)
        words = np.zeros(layout.HEADER_WORDS + sum(sizes), np.uint64)
        starts = {}
        at = layout.HEADER_WORDS
        for section, size in zip(_SECTIONS, sizes):
            words[section] = starts[section] = at
            at += size
        self._words, self._values = words, words.view(np.float64)
        words[layout.H_WORLD] = self._library.dBodyGetWorld(next(iter(self._handles.values())))
        words[layout.H_GROUP], words[layout.H_ADDRESS] = self._group, words.ctypes.data
        words[layout.H_CALLBACK], words[layout.H_SIZE] = kernels.near.address, words.size
        words[layout.H_CALLBACK_ITSELF] = kernels.near_itself.address
        words[layout.H_STATIC], words[layout.H_MOVING] = self._static_space._id(), self._moving_space._id()
        words[layout.H_CLASS_COUNT] = len(representatives)
        words[layout.H_CONTACT_PAIR_ROOM], words[layout.H_LOG_ROOM] = self._contact_pair_room, log_room
        self._values[layout.H_DT], words[layout.H_ISLAND_LIMIT] = self._dt, self.iterative_above
        words[layout.H_QUICK], words[layout.H_STEPS] = self._iterative, self._steps
        words[layout.H_SOLVES] = 0 if words[layout.H_QUICK] else self.settings.friction_solves
        words[layout.H_KEPT_ROOM] = most_kept
        self._fill_pairs(self._values, starts[layout.H_PAIRS], representatives)
        self._fill_idlers(starts[layout.H_IDLERS])
        self._fill_geoms(starts[layout.H_GEOMS], geoms, classes)
        self._fill_bodies(starts)
        self._fill_joints(starts)
        self._fill_bounds(starts, geoms)
        self._restore_contacts()
        self._restore_forces(starts[layout.H_FORMER])

    def _fill_geoms(self, start, geoms, classes):
        meets_itself = {link.name: index + 1 for parts in self._moving if parts.self_colliding
                        for index, link in enumerate(parts.links) if link.spec.self_collide}
        models = {parts.name: index for index, parts in enumerate(self._moving)}
        idlers = {link.countdown: index + 1 for index, link in enumerate(self._idlers)}
        self._rows, self._row_shapes = [], [shape for _, shape in geoms]
        self._words[layout.H_WATCHING] = bool(self._watches)
        for index, (geom, shape) in enumerate(geoms):
            row = start + index * layout.GEOM_WORDS
            self._words[row + layout.G_CLASS] = classes[shape]
            self._words[row + layout.G_BODY] = self._library.dGeomGetBody(geom._id()) or 0
            self._words[row + layout.G_LINK] = meets_itself.get(shape.link, 0)
            self._words[row + layout.G_WATCHED] = shape.name in self._watched
            self._words[row + layout.G_MODEL] = models.get(shape.model, 0)
            self._words[row + layout.G_RESTLESS] = shape.restless
            self._words[row + layout.G_IDLER] = idlers.get(shape.countdown, 0)
            self._library.dGeomSetData(geom._id(), index + 1)
            self._rows.append(shape.name)

    def _fill_idlers(self, start):
        self._words[layout.H_IDLER_COUNT] = len(self._idlers)
        for index, link in enumerate(self._idlers):
            at = start + index * layout.IDLE_WORDS
            self._words[at + layout.I_BODY] = self._handles[link]
            self._values[at + layout.I_STEPS:at + layout.IDLE_WORDS] = link.countdown.steps, link.countdown.time
            self._countdowns[link.countdown] = at

    def _fill_bodies(self, starts):
        words, values = self._words, self._values
        words[layout.H_SPACE_COUNT], words[layout.H_BODY_COUNT] = len(self._moving), len(self._handles)
        bodies = 0
        for index, parts in enumerate(self._moving):
            row = starts[layout.H_SPACES] + index * layout.SPACE_WORDS
            words[row:row + layout.SPACE_WORDS] = (
                parts.space._id(), parts.self_colliding, 0, bodies, len(parts.links), 0)
            bodies += len(parts.links)
        first = starts[layout.H_BODIES]
        words[first:first + len(self._handles)] = list(self._handles.values())
        words[layout.H_DAMPED_LINK_COUNT] = len(self._damped_links)
        for index, link in enumerate(self._damped_links):
            row = starts[layout.H_DAMPED_LINKS] + index * layout.DAMPED_WORDS
            words[row] = self._handles[link]
            values[row + 1] = max(0.0, 1.0 - link.spec.linear_damping)
            values[row + 2] = max(0.0, 1.0 - link.spec.angular_damping)

    def _fill_joints(self, starts):
        words, values = self._words, self._values
        handles = self._joint_handles() if self._hinges or self._damped_joints else {}
        motors = self._motor_handles() if any(drive.pull for drive in self._damped_joints) else {}
        words[layout.H_HINGE_COUNT], words[layout.H_DAMPED_JOINT_COUNT] = len(self._hinges), len(self._damped_joints)
        for index, drive in enumerate(self._hinges):
            row = starts[layout.H_HINGES] + index * layout.HINGE_WORDS
            words[row], values[row + 1] = handles[drive], drive.angle
            self._angles[drive] = row + 1
        for index, drive in enumerate(self._damped_joints):
            row = starts[layout.H_DAMPED_JOINTS] + index * layout.DAMPED_WORDS
            words[row], values[row + 1], words[row + 2] = handles[drive], drive.damping, drive.hinge
            values[row + 3:row + 5] = drive.stiffness, drive.spec.axis.spring_reference
            if drive.pull:
                words[row + 5], values[row + 6] = motors[drive.dampers[0]], drive.pull

    def _fill_bounds(self, starts, geoms):
        """Prepare the broad-phase bounds, which are exact in worlds with one ground plane.

        libode visits the smaller of two spaces first.  A model with more geoms than the static space would therefore be
        visited in another order, and gets no bounds.
        """
        words, values = self._words, self._values
        planes = [geom for geom, shape in geoms if isinstance(shape.collision.geometry, Plane)]
        words[layout.H_BOUNDED] = self.broad_phase_bounds and len(planes) == 1
        if not words[layout.H_BOUNDED]:
            return
        words[layout.H_PLANE], words[layout.H_PROBE] = planes[0]._id(), self._probe
        words[layout.H_PROBE_CALLBACK] = count_solids.address
        # bodies that sleep on level ground are in no list of contacts, and watched ones never sleep
        words[layout.H_SLEEPERS] = not self._watches and planes[0].getParams()[0][2] > _LEVEL
        statics = self._library.dSpaceGetNumGeoms(self._static_space._id())
        for index, parts in enumerate(self._moving):
            count = self._library.dSpaceGetNumGeoms(parts.space._id())
            row = starts[layout.H_SPACES] + index * layout.SPACE_WORDS
            words[row + layout.S_GEOM_COUNT] = count if count < statics else 0
        reach = self._reach(geoms)
        for index, handle in enumerate(self._handles.values()):
            row = starts[layout.H_BOUNDS] + index * layout.BOUNDS_WORDS
            values[row:row + layout.BOUNDS_WORDS] = reach.get(handle, 0.0), _NOWHERE, _NOWHERE, _NOWHERE

    def _reach(self, geoms):
        """Return ``{body: radius}`` [m] of spheres around the bodies that contain their geoms in any orientation."""
        reach, box = {}, (ctypes.c_double * 6)()
        for geom, shape in geoms:
            body = self._library.dGeomGetBody(geom._id())
            if not body:
                continue
            self._library.dGeomGetAABB(geom._id(), box)
            at = shape.body.getPosition()
            radius = math.sqrt(sum(max(abs(box[2 * axis] - at[axis]), abs(box[2 * axis + 1] - at[axis])) ** 2
                                   for axis in range(3)))
            reach[body] = max(radius, reach.get(body, 0.0))
        return reach

    def _body_handle(self, link):
        """Return the native handle of a link's body, by means of a temporary geom."""
        probe = ode.GeomSphere(None, 1.0)
        probe.setBody(link.body)
        return self._library.dGeomGetBody(probe._id())

    def _joint_handles(self):
        """Return the native handles of all joints."""
        return self._handles_of(_MODEL_JOINTS, lambda parts: [(drive, drive.spec) for drive in reversed(parts.joints)])

    def _motor_handles(self):
        """Return the native handles of all dampers."""
        def newest_first(parts):
            made = [(damper, drive.spec) for drive in parts.joints for damper in drive.dampers.values()]
            return sorted(made, key=lambda entry: -entry[0].number)
        return self._handles_of(_DAMPERS, newest_first)

    def _handles_of(self, kinds, newest_first):
        """Return the native handles of joints or motors. The list of a body begins with the one attached last.

        Parameters
        ----------
        kinds : tuple of int
            Types of libode's joints.
        newest_first : callable
            ``newest_first(parts)`` returns those of a model, as (key of the result, Joint).

        Returns
        -------
        dict
            Key -> handle.
        """
        handles = {}
        for parts in self._moving:
            by_name = {link.spec.name: self._handles[link] for link in parts.links}
            waiting = {body: self._joints_of(body, kinds) for body in by_name.values()}
            for entry, spec in newest_first(parts):
                for end in {spec.child, spec.parent} - {"world"}:
                    handle = next(waiting[by_name[end]])
                    if end == spec.child:
                        handles[entry] = handle
        return handles

    def _joints_of(self, body, kinds):
        """Yield the native handles of a body's joints of some kinds, from the one attached last."""
        for index in range(self._library.dBodyGetNumJoints(body)):
            joint = self._library.dBodyGetJoint(body, index)
            if self._library.dJointGetType(joint) in kinds:
                yield joint

    @staticmethod
    def _classes(shapes):
        """Group shapes with the same contact parameters; return ``{shape: class}`` and one shape of each class."""
        numbers, classes, representatives = {}, {}, []
        for shape in shapes:
            collision = shape.collision
            key = (collision.surface, type(collision.geometry), collision.max_contacts, shape.wheel, shape.moves,
                   shape.stiffer)
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
                surface = pair_surface(one.collision, two.collision, one.wheel, two.wheel, both_move, self.settings,
                                       min(one.stiffer, two.stiffer))
                if surface is None:
                    continue
                at = start + (one_index * count + two_index) * layout.PAIR_WORDS
                values[at:at + 18] = (1.0, surface.mode, surface.mu, surface.mu2, surface.slip1, surface.slip2,
                                      surface.bounce, surface.bounce_velocity, surface.soft_erp,
                                      surface.soft_cfm, surface.max_contacts, surface.merge, surface.ground, both_move,
                                      *surface.along, surface.along_second)

    # ---- state -------------------------------------------------------------------------------------------------

    def joint_angle(self, joint):
        at = self._angles.get(self._joints[joint])
        return super().joint_angle(joint) if at is None else float(self._values[at])

    def set_joint_angle(self, joint, angle):
        super().set_joint_angle(joint, angle)
        at = self._angles.get(self._joints[joint])
        if at is not None:
            self._values[at] = angle

    def set_link_pose(self, link, pose):
        super().set_link_pose(link, pose)
        if self._links[link].body is None:
            self._forget_block()                # a static link has moved, and may now be inside the bounds of a body

    def configure(self, settings):
        super().configure(settings)
        self._forget_block()

    def pose_reader(self, parts, poses):
        entries = [self._links[link] for link, _ in parts]
        if not parts or any(entry.body is None for entry in entries):
            return super().pose_reader(parts, poses)
        if poses.shape != (len(parts), 7):              # compiled code would write outside of it
            raise ValueError("poses of %d shapes: an array of %s, expected (%d, 7)"
                             % (len(parts), poses.shape, len(parts)))
        table, makeup, read_poses = np.zeros((len(parts), layout.SHAPE_WORDS), np.uint64), -1, kernels.read_poses
        shifts, offsets = np.split(table.view(np.float64)[:, layout.SHAPE_SHIFT:],
                                   [layout.SHAPE_OFFSET - layout.SHAPE_SHIFT], axis=1)      # views
        offsets[:] = [tuple(position) + tuple(orientation) for _, (position, orientation) in parts]

        def read():
            nonlocal makeup
            if makeup != self._makeup:          # a handle must not be used once its body may be gone
                handles = [self._handles.get(self._links[link]) for link, _ in parts]
                if None in handles:             # its model has left the world and will be deleted
                    return
                table[:, 0] = handles
                shifts[:] = [self._links[link].com for link, _ in parts]
                makeup = self._makeup
            read_poses(table, poses)

        return read

    # ---- contacts ----------------------------------------------------------------------------------------------

    def _read_log(self):
        words, values = self._words, self._values
        for index in range(int(words[layout.H_LOG_COUNT])):
            at = int(words[layout.H_LOG]) + index * layout.LOG_WORDS
            one, two = sorted((self._rows[int(words[at + 1]) - 1], self._rows[int(words[at + 2]) - 1]))
            self._contact_events.append(
                ContactEvent(int(words[at]), one, two, tuple(values[at + 3:at + 6]), float(values[at + 6])))
        words[layout.H_LOG_COUNT] = 0

    def _read_reports(self):
        """Pass the contacts since the last call to the watches, from the oldest that is still in the block."""
        words, values = self._words, self._values
        count = int(words[layout.H_REPORT_COUNT])
        words[layout.H_REPORT_COUNT] = 0
        links = {link.name: link for link in self._links.values()}
        for index in range(max(0, count - layout.MAX_REPORTS), count):
            at = int(words[layout.H_REPORTS]) + index % layout.MAX_REPORTS * layout.REPORT_WORDS
            sides = [(shape.name, shape.moves, links[shape.link].pose[0])
                     for shape in (self._row_shapes[int(words[at + side]) - 1] for side in (1, 2))]
            numbers = values[at + 3:at + layout.REPORT_WORDS].tolist()
            geometry = (tuple(numbers[0:3]), tuple(numbers[3:6]), numbers[6])
            feedback = [tuple(numbers[first:first + 3]) for first in (7, 11, 15, 19)]
            hand_out(self._watches, int(words[at]), sides, geometry, feedback)

    def watch_contacts(self, names):
        watch = super().watch_contacts(names)
        self._forget_block()
        return watch

    def end_watch(self, watch):
        super().end_watch(watch)
        self._forget_block()

    def _store_contacts(self):
        """Store which pairs are in contact, by name, before the block changes."""
        words, values = self._words, self._values
        self._pairs_before = {}
        for index in range(int(words[layout.H_BEFORE_COUNT])):
            at = int(words[layout.H_BEFORE]) + index * layout.CONTACT_PAIR_WORDS
            names = tuple(sorted((self._rows[int(words[at]) - 1], self._rows[int(words[at + 1]) - 1])))
            self._pairs_before[names] = (tuple(values[at + 2:at + 5]), float(values[at + 5]))

    def _restore_contacts(self):
        words = self._words
        rows = {name: index + 1 for index, name in enumerate(self._rows)}
        kept = [names for names in self._pairs_before if names[0] in rows and names[1] in rows]
        kept = kept[:self._contact_pair_room]
        for index, names in enumerate(kept):
            at = int(words[layout.H_BEFORE]) + index * layout.CONTACT_PAIR_WORDS
            words[at], words[at + 1] = sorted((rows[names[0]], rows[names[1]]))
        words[layout.H_BEFORE_COUNT] = len(kept)

    def _carry_forces(self):
        """Store the normal forces of the last coupled step, as PyodeEngine does, before the block changes."""
        words = self._words
        start, count = int(words[layout.H_FORMER]), int(words[layout.H_FORMER_COUNT])
        forces = {}
        for at in range(start, start + count * layout.FORMER_WORDS, layout.FORMER_WORDS):
            rows, number = divmod(int(words[at]), layout.KEY_NUMBERS)
            names = sorted(self._rows[row - 1] for row in divmod(rows, layout.KEY_ROWS))
            forces[(*names, number)] = float(self._values[at + 1])
        self._memory = Memory(int(words[layout.H_FORMER_STEP]), forces)

    def _restore_forces(self, start):
        words, rows = self._words, {name: index + 1 for index, name in enumerate(self._rows)}
        words[layout.H_FORMER_STEP], count = self._memory.step, 0
        for (first, second, number), force in self._memory.forces.items():
            if first in rows and second in rows:
                one, two = sorted((rows[first], rows[second]))
                at = start + count * layout.FORMER_WORDS
                words[at] = (one * layout.KEY_ROWS + two) * layout.KEY_NUMBERS + number
                self._values[at + 1] = force
                count += 1
        words[layout.H_FORMER_COUNT] = count

    def forget(self):
        self._forget_block()
        super().forget()

    def close(self):
        if self._group is not None:
            self._library.dJointGroupDestroy(self._group)
            self._library.dGeomDestroy(self._probe)
            self._group = self._probe = None
        self._forget_block()
        self._rows, self._row_shapes = [], []       # shapes hold bodies, which must not outlive the world
        super().close()
