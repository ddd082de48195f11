# SPDX-License-Identifier: BSD-3-Clause
"""Physics engine with a compiled loop; gives the same numbers as PyodeEngine, several times faster.

The world is built with pyode, which provides the native handles of its objects.  The compiled loop calls libode with
these handles.  Its block of memory is filled again after bodies, geoms or joints have been added or removed.
"""
from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.model.types import Plane
from m2wr_sim.physics import native_ode, near_kernels
from m2wr_sim.physics import placing_kernels as placing
from m2wr_sim.physics import step_kernels as kernels
from m2wr_sim.physics import step_layout as layout
from m2wr_sim.physics.broad_phase_kernels import count_solids
from m2wr_sim.physics.contact_watch import hand_out
from m2wr_sim.physics.native_block import Block, classes_of
from m2wr_sim.physics.native_handles import body_handle, joint_handles, motor_handles, reach
from m2wr_sim.physics.ode_world import OdeWorld

if TYPE_CHECKING:
    import ode
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose
    from m2wr_sim.physics.contact_watch import ContactWatch
    from m2wr_sim.physics.engine import EngineSettings, ModelHandle
    from m2wr_sim.physics.moved_links import MovedLink
    from m2wr_sim.physics.native_handles import Handles
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.parts import LinkBody, ModelParts, Shape

log = logging.getLogger(__name__)

_LEVEL = 0.9            # least z component of the normal of a level plane; far above that of steep contacts


class NativeEngine(OdeWorld):
    """See :class:`~m2wr_sim.physics.engine.Engine`.

    With ``broad_phase_bounds = False`` each step tests all models against all static shapes; the results are the same.
    """

    broad_phase_bounds = True
    compiled = True

    def __init__(self, settings: EngineSettings) -> None:
        self._block: Optional[Block] = None
        self._handles: Handles = {}
        self._contact_pair_room = layout.CONTACT_PAIR_ROOM
        self._makeup = 0                        # increases when bodies, geoms or joints are added or removed
        self._library = native_ode.library()
        self._group = self._library.dJointGroupCreate(0)
        self._probe = self._library.dCreateBox(0, 1.0, 1.0, 1.0)
        super().__init__(settings)

    def _extend_lists(self, parts: ModelParts) -> None:
        super()._extend_lists(parts)
        self._forget_block()
        if not parts.static:
            self._makeup += 1
            self._handles.update((link, body_handle(self._library, link.body)) for link in parts.links)

    def _refresh_lists(self) -> None:
        super()._refresh_lists()
        self._forget_block()
        self._makeup += 1
        self._handles = {link: self._handles.get(link) or body_handle(self._library, link.body)
                         for parts in self._moving for link in parts.links}

    def remove_model(self, handle: ModelHandle) -> None:
        self._forget_block()            # stores the contacts while the model's names are still known
        super().remove_model(handle)

    def abandon_model(self, handle: ModelHandle) -> None:
        self._forget_block()
        super().abandon_model(handle)

    def _enable(self, link: Union[LinkBody, Shape]) -> None:
        super()._enable(link)
        if self._block is not None and link.countdown is not None:
            self._block.write_countdown(link.countdown)

    def let_slip(self, link: int, axis: Sequence[float]) -> None:
        super().let_slip(link, axis)
        self._forget_block()

    def set_slip(self, link: int, along: float, across: float) -> None:
        super().set_slip(link, along, across)
        if self._block is not None:
            for geom, _ in self._links[link].geoms:
                self._block.write_slip(self._shapes[geom])

    # ---- stepping --------------------------------------------------------------------------------------------------

    def step(self, count: int) -> None:
        self.version += 1
        if not self._moving:
            self._steps += count
            return
        block = self._block or self._fill_block()
        self._finish(block, kernels.run(block.words, count), count)

    def _finish(self, block: Block, taken: int, count: int) -> None:
        """Make the rest of ``count`` steps, after ``kernels.run`` has returned ``taken``."""
        run, words = kernels.run, block.words
        while True:
            self._steps += abs(taken)
            if taken == count:                      # it is less if a list is full, negative if there are events to read
                return
            count -= abs(taken)
            if taken < 0:
                self._read_events(block, count)
            if not count:
                break
            taken = run(words, count)
        if 2 * words[layout.H_BEFORE_COUNT] > self._contact_pair_room:
            self._make_room(block)

    @property
    def words(self) -> NDArray[np.uint64]:
        """The block for ``kernels.run``, filled for the present world; another array after a change of the world."""
        return (self._block or self._fill_block()).words

    def count_run(self, taken: int, count: int) -> None:
        """Take over steps that other compiled code has made by ``kernels.run``, and make what is left of them.

        Parameters
        ----------
        taken : int
            What ``kernels.run`` has returned.
        count : int
            What it was asked for.
        """
        self.version += 1
        if taken == count:
            self._steps += count
        else:
            self._finish(self._block or self._fill_block(), taken, count)

    def hinge_handle(self, joint: int) -> int:
        """Return the native handle of a hinge, for ``kernels.set_hinge_rate``; 0 if the joint is of another type."""
        block, drive = self._block or self._fill_block(), self._joints[joint]
        word = block.angle_word(drive)
        plain = word and block.words[word + 2] == kernels.HINGE and drive.access.group == 0
        return int(block.words[word - 1]) if plain else 0

    def _read_events(self, block: Block, left: int) -> None:
        words = block.words
        if words[layout.H_LOG_COUNT]:
            self._contact_events += block.drain_events()
        if words[layout.H_REPORT_COUNT]:
            self._read_reports(block)
        if words[layout.H_ITERATIVE]:
            words[layout.H_ITERATIVE] = 0
            self._warn_of_island(lambda: self._island_members(words), int(words[layout.H_LARGEST_ISLAND]))
        if words[layout.H_LOST]:
            words[layout.H_LOST] = 0
            raise self._lost(left)

    def _read_reports(self, block: Block) -> None:
        """Pass the contacts since the last call to the watches."""
        links = {link.name: link for link in self._links.values()}
        for step, shapes, contact, feedback in block.drain_reports():
            sides = [(shape.name, shape.moves, links[shape.link].pose[0]) for shape in shapes]
            hand_out(self._watches, step, sides, contact, feedback)

    def _island_members(self, words: NDArray[np.uint64]) -> List[str]:
        """Return the names of the models in the largest island of the last step."""
        start = int(words[layout.H_ISLANDS])
        rows = range(start, start + len(self._moving) * layout.ISLAND_WORDS, layout.ISLAND_WORDS)
        leaders: Dict[int, int] = {}
        for row in rows:                # the representative of a model comes before it
            if words[row + layout.X_STEP] == words[layout.H_STEPS]:
                leaders[row] = leaders.get(int(words[row + layout.X_FOR]), row)
        largest = [row for row, leader in leaders.items() if leader == row and words[row + layout.X_AWAKE]
                   and words[row + layout.X_CONTACTS] == words[layout.H_LARGEST_ISLAND]]
        return sorted(parts.name for parts, row in zip(self._moving, rows) if leaders.get(row) in largest[:1])

    def _make_room(self, block: Block) -> None:
        """Reserve more room for the contact pairs of a step before it is used up; log how many were lost."""
        count, missed = int(block.words[layout.H_BEFORE_COUNT]), int(block.words[layout.H_MISSED])
        if missed:
            log.warning("step %d: more pairs are in contact than there was room for; %d contacts are not reported",
                        self._steps, missed)
        if 2 * count > self._contact_pair_room:
            self._forget_block()
            self._contact_pair_room = 4 * count

    # ---- the block -------------------------------------------------------------------------------------------------

    def _forget_block(self) -> None:
        """Store what the block knows, and have it filled again before the next step."""
        if self._block is not None:
            self._pairs_before = self._block.pairs_in_contact()
            self._memory, self._loads = self._block.memory(), self._block.loads()
            self._block.read_state()
            self._block.release()
        self._block = None

    def _fill_block(self) -> Block:
        """Allocate and fill the block for the present world."""
        geoms = [(geom, self._shapes[geom]) for parts in self._parts.values() for geom in parts.geoms]
        classes, representatives = classes_of(shape for _, shape in geoms)
        self._contact_pair_room = max(self._contact_pair_room, 4 * sum(shape.moves for _, shape in geoms))
        wheels = sum(shape.skids for _, shape in geoms)
        block = self._block = Block(self._sizes(len(geoms), len(representatives), wheels))
        self._write_header(block)
        block.write_pairs(representatives, self.settings)
        block.write_idlers(self._idlers, self._handles)
        block.write_geoms(self._library, geoms, classes, self._moving, self._watched)
        block.write_bodies(self._moving, self._handles, self._damped_links)
        joints = joint_handles(self._library, self._moving, self._handles) \
            if self._hinges or self._damped_joints else {}
        motors = motor_handles(self._library, self._moving, self._handles) \
            if any(drive.pull for drive in self._damped_joints) else {}
        block.write_joints(self._hinges, self._damped_joints, joints, motors)
        self._write_bounds(block, geoms)
        block.keep_initial()
        block.write_pairs_in_contact(self._pairs_before, self._contact_pair_room)
        block.write_memory(self._memory)
        block.write_loads(self._loads)
        return block

    def _sizes(self, geoms: int, classes: int, wheels: int) -> Dict[int, int]:
        """Return the sizes of the sections of the block, in words."""
        most_kept, models, bodies = self._most_kept(), len(self._moving), len(self._handles)
        pairs = self._contact_pair_room * layout.CONTACT_PAIR_WORDS
        return {
            layout.H_CONTACTS: (most_kept + layout.MAX_FOUND) * layout.CONTACT_WORDS,
            layout.H_PAIRS: classes ** 2 * layout.PAIR_WORDS,
            layout.H_GEOMS: geoms * layout.GEOM_WORDS,
            layout.H_SPACES: models * layout.SPACE_WORDS,
            layout.H_HINGES: len(self._hinges) * layout.HINGE_WORDS,
            layout.H_DAMPED_JOINTS: len(self._damped_joints) * layout.DAMPED_WORDS,
            layout.H_DAMPED_LINKS: len(self._damped_links) * layout.DAMPED_WORDS,
            layout.H_BODIES: bodies,
            layout.H_BOUNDS: bodies * layout.BOUNDS_WORDS,
            layout.H_LOADS: wheels * layout.LOAD_WORDS,
            layout.H_ISLANDS: models * layout.ISLAND_WORDS,
            layout.H_NOW: pairs,
            layout.H_BEFORE: pairs,
            layout.H_LOG: (self._contact_pair_room + layout.SPARE_LOG) * layout.LOG_WORDS,
            layout.H_REPORTS: layout.MAX_REPORTS * layout.REPORT_WORDS if self._watches else 0,
            layout.H_GRIPS: most_kept * layout.GRIP_WORDS,
            layout.H_STATES: bodies * layout.STATE_WORDS,
            layout.H_IDLERS: len(self._idlers) * layout.IDLE_WORDS,
            layout.H_FORMER: most_kept * layout.FORMER_WORDS,
            layout.H_WORK: near_kernels.GROUND_WORK,
        }

    def _write_header(self, block: Block) -> None:
        words = block.words
        words[layout.H_WORLD] = self._library.dBodyGetWorld(next(iter(self._handles.values())))
        words[layout.H_GROUP] = self._group
        words[layout.H_CALLBACK] = near_kernels.near.address
        words[layout.H_CALLBACK_ITSELF] = near_kernels.near_itself.address
        words[layout.H_STATIC], words[layout.H_MOVING] = self._static_space._id(), self._moving_space._id()
        words[layout.H_CONTACT_PAIR_ROOM] = self._contact_pair_room
        words[layout.H_LOG_ROOM] = self._contact_pair_room + layout.SPARE_LOG
        block.values[layout.H_DT], words[layout.H_ISLAND_LIMIT] = self._dt, self.iterative_above
        words[layout.H_QUICK], words[layout.H_STEPS] = self._iterative, self._steps
        words[layout.H_SOLVES] = 0 if self._iterative else self.settings.friction_solves
        words[layout.H_KEPT_ROOM] = self._most_kept()
        words[layout.H_WATCHING] = bool(self._watches)

    def _write_bounds(self, block: Block, geoms: Sequence[Tuple[Geom, Shape]]) -> None:
        """Prepare the broad-phase bounds, which are exact in worlds with one ground plane.

        libode visits the smaller of two spaces first.  A model with more geoms than the static space would therefore be
        visited in another order, and gets no bounds.
        """
        words = block.words
        planes = [geom for geom, shape in geoms if isinstance(shape.collision.geometry, Plane)]
        words[layout.H_BOUNDED] = self.broad_phase_bounds and len(planes) == 1
        if not words[layout.H_BOUNDED]:
            return
        plane: ode.GeomPlane = planes[0]
        words[layout.H_PLANE], words[layout.H_PROBE] = plane._id(), self._probe
        words[layout.H_PROBE_CALLBACK] = count_solids.address
        # bodies that sleep on level ground are in no list of contacts, and watched ones never sleep
        words[layout.H_SLEEPERS] = not self._watches and plane.getParams()[0][2] > _LEVEL
        statics = self._library.dSpaceGetNumGeoms(self._static_space._id())
        counts = [self._library.dSpaceGetNumGeoms(parts.space._id()) for parts in self._moving]
        radii = reach(self._library, geoms)
        block.write_bounds([count if count < statics else 0 for count in counts],
                           [radii.get(handle, 0.0) for handle in self._handles.values()])

    # ---- state -----------------------------------------------------------------------------------------------------

    def joint_angle(self, joint: int) -> float:
        if self._block is not None:
            word = self._block.angle_word(self._joints[joint])
            if word:
                return float(self._block.values[word])
        return super().joint_angle(joint)

    def set_joint_angle(self, joint: int, angle: float) -> None:
        super().set_joint_angle(joint, angle)
        if self._block is not None:
            word = self._block.angle_word(self._joints[joint])
            if word:
                self._block.values[word] = angle

    def set_link_pose(self, link: int, pose: Pose) -> None:
        super().set_link_pose(link, pose)
        if self._links[link].body is None:
            self._forget_block()                # a static link has moved, and may now be inside the bounds of a body

    def configure(self, settings: EngineSettings) -> None:
        super().configure(settings)
        self._forget_block()

    def pose_reader(self, parts: Sequence[Tuple[int, Pose]], poses: NDArray[np.float64]) -> Callable[[], None]:
        if not parts or any(self._links[link].body is None for link, _ in parts):
            return super().pose_reader(parts, poses)
        if poses.shape != (len(parts), 7):              # compiled code would write outside of it
            raise ValueError("poses of %d shapes: an array of %s, expected (%d, 7)"
                             % (len(parts), poses.shape, len(parts)))
        return BodyReader(self, parts, kernels.read_poses, poses)

    def motion_reader(self, link: int, offset: Pose, motion: NDArray[np.float64]) -> Callable[[], None]:
        if self._links[link].body is None:
            return super().motion_reader(link, offset, motion)
        if motion.shape != (13,):                       # compiled code would write outside of it
            raise ValueError("motion of a link: an array of %s, expected (13,)" % (motion.shape,))
        return BodyReader(self, [(link, offset)], kernels.read_motion, motion[None, :])

    def link_mover(self, parts: Sequence[MovedLink], motions: NDArray[np.float64],
                   chosen: NDArray[np.int64]) -> Callable[[], None]:
        links = [self._links[part.link] for part in parts]
        if not all(link.body is not None and link.spec.kinematic and link.countdown is None for link in links):
            return super().link_mover(parts, motions, chosen)
        if motions.shape != (len(chosen), 13) or not all(0 <= part.row < len(chosen) for part in parts):
            raise ValueError("motions of %d models: an array of %s" % (len(chosen), motions.shape))
        table, makeup = np.zeros((len(parts), placing.MOVED_WORDS), np.uint64), -1
        values = table.view(np.float64)
        for row, part in enumerate(parts):
            table[row, placing.M_ROW] = part.row
            values[row, placing.M_POSITION:placing.M_SHIFT] = (*part.pose[0], *part.pose[1], *part.centre)

        def move() -> None:
            nonlocal makeup
            if makeup != self._makeup:          # a handle must not be used once its body may be gone
                table[:, placing.M_BODY] = [self._handles.get(link) or 0 for link in links]
                values[:, placing.M_SHIFT:placing.M_ROOM] = [link.com for link in links]
                makeup = self._makeup
            self.placements += placing.place(table, motions, chosen)
            self.version += 1

        return move

    def watch_contacts(self, names: Iterable[str]) -> ContactWatch:
        watch = super().watch_contacts(names)
        self._forget_block()
        return watch

    def end_watch(self, watch: ContactWatch) -> None:
        super().end_watch(watch)
        self._forget_block()

    def forget(self) -> None:
        if self._block is not None:
            self._block.rewind()
        super().forget()

    def close(self) -> None:
        if self._group is not None:
            self._library.dJointGroupDestroy(self._group)
            self._library.dGeomDestroy(self._probe)
            self._group = self._probe = None
        self._forget_block()
        super().close()


class BodyReader:
    """Calls a kernel with a table of shapes that are fixed to bodies, which it keeps up to date.

    Parameters
    ----------
    engine : NativeEngine
    parts : sequence of (int, pose)
        Number of the link, and pose of the shape in the link frame.
    kernel : callable
        ``kernel(table, out)``, see :func:`m2wr_sim.physics.step_kernels.read_poses`.
    out : (n, k) float64
        C-contiguous.

    Attributes
    ----------
    table : (n, SHAPE_WORDS) uint64
    out : (n, k) float64
    """

    def __init__(self, engine: NativeEngine, parts: Sequence[Tuple[int, Pose]], kernel: Callable[..., None],
                 out: NDArray[np.float64]) -> None:
        self._engine, self._kernel, self.out, self._makeup = engine, kernel, out, -1
        self._links = [link for link, _ in parts]
        self.table = np.zeros((len(parts), layout.SHAPE_WORDS), np.uint64)
        values = self.table.view(np.float64)
        values[:, layout.SHAPE_OFFSET:] = [tuple(position) + tuple(turn) for _, (position, turn) in parts]

    def update(self) -> bool:
        """Update the table; return False if a model has left the world and will be deleted."""
        engine = self._engine
        if self._makeup != engine._makeup:      # a handle must not be used once its body may be gone
            links = [engine._links[link] for link in self._links]
            handles = [engine._handles.get(link) for link in links]
            if None in handles:
                return False
            self.table[:, 0] = handles
            self.table.view(np.float64)[:, layout.SHAPE_SHIFT:layout.SHAPE_OFFSET] = [link.com for link in links]
            self._makeup = engine._makeup
        return True

    def __call__(self) -> None:
        if self.update():
            self._kernel(self.table, self.out)
