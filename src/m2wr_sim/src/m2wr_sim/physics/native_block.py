# SPDX-License-Identifier: BSD-3-Clause
"""Fills and reads the block of memory of the compiled loop; see step_layout for its layout."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, FrozenSet, Iterable, List, Sequence, Tuple

import numpy as np

from m2wr_sim.physics import height_contacts
from m2wr_sim.physics import step_layout as layout
from m2wr_sim.physics.contacts import pair_surface
from m2wr_sim.physics.coupled_friction import Memory
from m2wr_sim.physics.engine import ContactEvent
from m2wr_sim.physics.height_kernels import FIELD

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Vector
    from m2wr_sim.physics.contacts import Contact
    from m2wr_sim.physics.coupled_friction import Key
    from m2wr_sim.physics.dampers import Damper
    from m2wr_sim.physics.engine import EngineSettings
    from m2wr_sim.physics.idle import Countdown
    from m2wr_sim.physics.native_handles import Handles
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.ode_world import Names
    from m2wr_sim.physics.parts import JointDrive, LinkBody, ModelParts, Shape
    from m2wr_sim.physics.sliding import Loads

_NOWHERE = 1e300        # m; position of bounds that are not computed yet


def classes_of(shapes: Iterable[Shape]) -> Tuple[Dict[Shape, int], List[Shape]]:
    """Group shapes with the same contact parameters.

    Returns
    -------
    classes : dict
        Shape -> number of its class.
    representatives : list of Shape
        One of each class.
    """
    numbers: Dict[Tuple[Any, ...], int] = {}
    classes: Dict[Shape, int] = {}
    representatives: List[Shape] = []
    for shape in shapes:
        collision = shape.collision
        key = (collision.surface, type(collision.geometry), collision.max_contacts, shape.wheel, shape.moves,
               shape.stiffer, shape.yields, shape.skids, shape.slip is not None)
        if key not in numbers:
            numbers[key] = len(representatives)
            representatives.append(shape)
        classes[shape] = numbers[key]
    return classes, representatives


class Block:
    """The block of memory, and which geom, joint and body is where in it.

    Parameters
    ----------
    sizes : dict
        Header word of each section, for instance ``H_CONTACTS`` -> its number of words; in their order.

    Attributes
    ----------
    words : (W,) uint64
    values : (W,) float64
        The same memory.
    """

    def __init__(self, sizes: Dict[int, int]) -> None:
        self.words: NDArray[np.uint64] = np.zeros(layout.HEADER_WORDS + sum(sizes.values()), np.uint64)
        self.values: NDArray[np.float64] = self.words.view(np.float64)
        self._starts: Dict[int, int] = {}
        at = layout.HEADER_WORDS
        for section, size in sizes.items():
            self.words[section] = self._starts[section] = at
            at += size
        self.words[layout.H_ADDRESS], self.words[layout.H_SIZE] = self.words.ctypes.data, self.words.size
        self._rows: List[str] = []                      # name of each geom
        self._shapes: List[Shape] = []                  # shape of each geom
        self._angles: Dict[JointDrive, int] = {}        # hinge -> word with its angle
        self._countdowns: Dict[Countdown, int] = {}     # countdown -> its row
        self._wheels: Dict[str, int] = {}               # name of the geom of a wheel -> word of its load
        self._slips: Dict[Shape, int] = {}              # shape that slips -> row of its geom
        self._initial: NDArray[np.uint64] = self.words[:0]

    # ---- filling ---------------------------------------------------------------------------------------------------

    def write_pairs(self, representatives: Sequence[Shape], settings: EngineSettings) -> None:
        """Write the surfaces of all pairs of classes.

        Parameters
        ----------
        representatives : list of Shape
            One shape of each class.
        settings : EngineSettings
        """
        count = len(representatives)
        self.words[layout.H_CLASS_COUNT] = count
        for one_index, one in enumerate(representatives):
            for two_index, two in enumerate(representatives):
                if not (one.yields or two.yields):
                    continue
                both_move = one.moves and two.moves
                surface = pair_surface(one.collision, two.collision, one.wheel, two.wheel, both_move, settings,
                                       min(one.stiffer, two.stiffer), one.skids or two.skids,
                                       one.slip is not None or two.slip is not None)
                if surface is None:
                    continue
                at = self._starts[layout.H_PAIRS] + (one_index * count + two_index) * layout.PAIR_WORDS
                self.values[at:at + layout.PAIR_WORDS] = (
                    1.0, surface.mode, surface.mu, surface.mu2, surface.slip1, surface.slip2, surface.bounce,
                    surface.bounce_velocity, surface.soft_erp, surface.soft_cfm, surface.max_contacts, surface.merge,
                    surface.ground, both_move, *surface.along, surface.along_second, surface.slides)

    def write_idlers(self, idlers: Sequence[LinkBody], handles: Handles) -> None:
        """Write the bodies that may sleep.

        Parameters
        ----------
        idlers : list of LinkBody
        handles : dict
            Link -> native handle of its body.
        """
        self.words[layout.H_IDLER_COUNT] = len(idlers)
        for index, link in enumerate(idlers):
            if link.countdown is not None:
                at = self._starts[layout.H_IDLERS] + index * layout.IDLE_WORDS
                self.words[at + layout.I_BODY] = handles[link]
                self._countdowns[link.countdown] = at
                self.write_countdown(link.countdown)

    def write_geoms(self, library: Any, geoms: Sequence[Tuple[Geom, Shape]], classes: Dict[Shape, int],
                    moving: Sequence[ModelParts], watched: FrozenSet[str]) -> None:
        """Write the geoms, after the bodies that may sleep, and give each geom the number of its row, from 1.

        Parameters
        ----------
        library : ctypes.CDLL
            libode.
        geoms : list of (geom, Shape)
        classes : dict
            Shape -> number of its class.
        moving : list of ModelParts
            The movable models.
        watched : frozenset of str
            Names of the collisions whose contacts are reported.
        """
        words = self.words
        meets_itself = {link.name: index + 1 for parts in moving if parts.self_colliding
                        for index, link in enumerate(parts.links) if link.spec.self_collide}
        models = {parts.name: index for index, parts in enumerate(moving)}
        idlers = {countdown: index + 1 for index, countdown in enumerate(self._countdowns)}
        self._rows, self._shapes = [shape.name for _, shape in geoms], [shape for _, shape in geoms]
        for index, (geom, shape) in enumerate(geoms):
            row = self._starts[layout.H_GEOMS] + index * layout.GEOM_WORDS
            words[row + layout.G_CLASS] = classes[shape]
            words[row + layout.G_BODY] = library.dGeomGetBody(geom._id()) or 0
            words[row + layout.G_LINK] = meets_itself.get(shape.link, 0)
            words[row + layout.G_WATCHED] = shape.name in watched
            words[row + layout.G_MODEL] = models.get(shape.model, 0)
            words[row + layout.G_RESTLESS] = shape.restless
            words[row + layout.G_IDLER] = 0 if shape.countdown is None else idlers.get(shape.countdown, 0)
            self._write_size(row, geom, shape)
            if shape.slip is not None:
                self._slips[shape] = row
                self.write_slip(shape)
            library.dGeomSetData(geom._id(), index + 1)
            if shape.skids:
                words[row + layout.G_LOAD] = self._starts[layout.H_LOADS] + len(self._wheels) * layout.LOAD_WORDS
                self._wheels[shape.name] = int(words[row + layout.G_LOAD])

    def _write_size(self, row: int, geom: Geom, shape: Shape) -> None:
        """Write what height_kernels needs of a geom."""
        kind, at = height_contacts.kind_of(shape), row + layout.G_SIZE
        self.words[row + layout.G_KIND] = kind
        if kind != FIELD:
            self.values[at:at + 3] = height_contacts.size_of(shape)
            return
        data = geom.heights         # type: ignore[union-attr]
        self.words[at + layout.FIELD_HEIGHTS], self.words[at + layout.FIELD_TOPS] = (
            data.heights.ctypes.data, data.tops.ctypes.data)
        self.words[at + layout.FIELD_ROWS], self.words[at + layout.FIELD_COLUMNS] = data.heights.shape
        self.values[at + layout.FIELD_CELL:at + layout.FIELD_CELL + 2] = data.cell

    def write_slip(self, shape: Shape) -> None:
        """Write the compliances of a shape that slips."""
        at = self._slips[shape]
        self.values[at + layout.G_SLIP1], self.values[at + layout.G_SLIP2] = shape.slip or (0.0, 0.0)

    def write_bodies(self, moving: Sequence[ModelParts], handles: Handles, damped: Sequence[LinkBody]) -> None:
        """Write the movable models and their bodies.

        Parameters
        ----------
        moving : list of ModelParts
        handles : dict
            Link -> native handle of its body, in the order of the models.
        damped : list of LinkBody
            Links with linear or angular damping.
        """
        words, values = self.words, self.values
        words[layout.H_SPACE_COUNT], words[layout.H_BODY_COUNT] = len(moving), len(handles)
        bodies = 0
        for index, parts in enumerate(moving):
            row = self._starts[layout.H_SPACES] + index * layout.SPACE_WORDS
            words[row:row + layout.SPACE_WORDS] = (
                parts.space._id(), parts.self_colliding, 0, bodies, len(parts.links), 0)
            bodies += len(parts.links)
        first = self._starts[layout.H_BODIES]
        words[first:first + len(handles)] = list(handles.values())
        words[layout.H_DAMPED_LINK_COUNT] = len(damped)
        for index, link in enumerate(damped):
            row = self._starts[layout.H_DAMPED_LINKS] + index * layout.DAMPED_WORDS
            words[row] = handles[link]
            values[row + 1] = max(0.0, 1.0 - link.spec.linear_damping)
            values[row + 2] = max(0.0, 1.0 - link.spec.angular_damping)

    def write_joints(self, hinges: Sequence[JointDrive], damped: Sequence[JointDrive], joints: Dict[JointDrive, int],
                     motors: Dict[Damper, int]) -> None:
        """Write the axes that rotate, and the damped joints.

        Parameters
        ----------
        hinges : list of JointDrive
        damped : list of JointDrive
            Joints with damping or a spring.
        joints, motors : dict
            Native handles of the joints and of the dampers of springs.
        """
        words, values = self.words, self.values
        words[layout.H_HINGE_COUNT], words[layout.H_DAMPED_JOINT_COUNT] = len(hinges), len(damped)
        for index, drive in enumerate(hinges):
            row = self._starts[layout.H_HINGES] + index * layout.HINGE_WORDS
            words[row], values[row + 1], words[row + 3] = joints[drive], drive.angle, drive.access.reading
            self._angles[drive] = row + 1
        for index, drive in enumerate(damped):
            row = self._starts[layout.H_DAMPED_JOINTS] + index * layout.DAMPED_WORDS
            words[row], values[row + 1], words[row + 2] = joints[drive], drive.damping, drive.hinge
            values[row + 3:row + 5] = drive.stiffness, drive.spec.axis.spring_reference
            if drive.pull:
                words[row + 5], values[row + 6] = motors[drive.dampers[0]], drive.pull

    def write_bounds(self, geom_counts: Sequence[int], radii: Sequence[float]) -> None:
        """Write what the broad-phase bounds are computed from.

        Parameters
        ----------
        geom_counts : list of int
            Number of geoms of each movable model; 0 if it gets no bounds.
        radii : list of float
            Of a sphere around each body with all its geoms [m].
        """
        for index, count in enumerate(geom_counts):
            row = self._starts[layout.H_SPACES] + index * layout.SPACE_WORDS
            self.words[row + layout.S_GEOM_COUNT] = count
        for index, radius in enumerate(radii):
            row = self._starts[layout.H_BOUNDS] + index * layout.BOUNDS_WORDS
            self.values[row:row + layout.BOUNDS_WORDS] = radius, _NOWHERE, _NOWHERE, _NOWHERE

    # ---- state -----------------------------------------------------------------------------------------------------

    def keep_initial(self) -> None:
        """Keep what has been written, for :meth:`rewind`; from H_NOW on there are only lists, which begin empty."""
        self._initial = self.words[:self._starts[layout.H_NOW]].copy()

    def rewind(self) -> None:
        """Restore the state before the first step, without any contact; angles and countdowns stay as they are."""
        self.read_state()
        self.words[:self._initial.size] = self._initial
        states = self._starts[layout.H_STATES]
        self.words[states:self._starts[layout.H_IDLERS]] = 0
        self.words[layout.H_STEPS] = 0
        self.write_memory(Memory())
        for row in self._wheels.values():
            self.words[row:row + layout.LOAD_WORDS] = 0
        for drive, at in self._angles.items():
            self.values[at] = drive.angle
        for countdown in self._countdowns:
            self.write_countdown(countdown)
        for shape in self._slips:
            self.write_slip(shape)

    def write_countdown(self, countdown: Countdown) -> None:
        """Write how long a body has to be idle before it sleeps, if it is in the block."""
        at = self._countdowns.get(countdown)
        if at is not None:
            self.values[at + layout.I_STEPS:at + layout.IDLE_WORDS] = countdown.steps, countdown.time

    def angle_word(self, drive: JointDrive) -> int:
        """Return the word with the angle of a hinge [rad]; 0 if it is not in the block."""
        return self._angles.get(drive, 0)

    def read_state(self) -> None:
        """Store the angles of the hinges, and how long bodies still have to be idle, in their records."""
        for drive, at in self._angles.items():
            drive.angle = float(self.values[at])
        for countdown, at in self._countdowns.items():
            countdown.steps, countdown.time = self.values[at + layout.I_STEPS:at + layout.IDLE_WORDS].tolist()

    def release(self) -> None:
        """Drop all references to objects of ODE, which must not outlive the world; a traceback may keep the block."""
        self._shapes, self._angles, self._countdowns = [], {}, {}

    # ---- contacts --------------------------------------------------------------------------------------------------

    def drain_events(self) -> List[ContactEvent]:
        """Return the logged first steps of contacts, and clear the log."""
        words, values, events = self.words, self.values, []
        for index in range(int(words[layout.H_LOG_COUNT])):
            at = int(words[layout.H_LOG]) + index * layout.LOG_WORDS
            one, two = self._names(int(words[at + 1]), int(words[at + 2]))
            events.append(ContactEvent(int(words[at]), one, two, _vector(values, at + 3), float(values[at + 6])))
        words[layout.H_LOG_COUNT] = 0
        return events

    def drain_reports(self) -> List[Tuple[int, Tuple[Shape, Shape], Contact, List[Vector]]]:
        """Return the reported contacts from the oldest that is still in the block, and remove them.

        Returns
        -------
        list of (int, (Shape, Shape), (position, normal, depth), list of 4 tuples)
            Number of the step, the two shapes, the contact, and ODE's feedback: force and torque on each body.
        """
        words, values, reports = self.words, self.values, []
        count = int(words[layout.H_REPORT_COUNT])
        words[layout.H_REPORT_COUNT] = 0
        for index in range(max(0, count - layout.MAX_REPORTS), count):
            at = int(words[layout.H_REPORTS]) + index % layout.MAX_REPORTS * layout.REPORT_WORDS
            shapes = self._shapes[int(words[at + 1]) - 1], self._shapes[int(words[at + 2]) - 1]
            geometry = at + layout.R_GEOMETRY
            contact = _vector(values, geometry), _vector(values, geometry + 3), float(values[geometry + 6])
            feedback = [_vector(values, at + layout.R_FEEDBACK + word) for word in (0, 4, 8, 12)]
            reports.append((int(words[at]), shapes, contact, feedback))
        return reports

    def pairs_in_contact(self) -> Dict[Names, Tuple[Vector, float]]:
        """Return the pairs in contact in the last step, by name: position and depth [m]."""
        words, values, pairs = self.words, self.values, {}
        for index in range(int(words[layout.H_BEFORE_COUNT])):
            at = int(words[layout.H_BEFORE]) + index * layout.CONTACT_PAIR_WORDS
            pairs[self._names(int(words[at]), int(words[at + 1]))] = _vector(values, at + 2), float(values[at + 5])
        return pairs

    def write_pairs_in_contact(self, pairs: Iterable[Names], most: int) -> None:
        """Write which pairs were in contact in the last step.

        Parameters
        ----------
        pairs : iterable of (str, str)
            Names of the collisions; unknown ones are ignored.
        most : int
            Greatest number of pairs.
        """
        rows = {name: index + 1 for index, name in enumerate(self._rows)}
        kept = [names for names in pairs if names[0] in rows and names[1] in rows][:most]
        for index, names in enumerate(kept):
            at = int(self.words[layout.H_BEFORE]) + index * layout.CONTACT_PAIR_WORDS
            self.words[at], self.words[at + 1] = sorted((rows[names[0]], rows[names[1]]))
        self.words[layout.H_BEFORE_COUNT] = len(kept)

    def memory(self) -> Memory:
        """Return the normal forces of the last coupled step."""
        words = self.words
        start, count = int(words[layout.H_FORMER]), int(words[layout.H_FORMER_COUNT])
        forces: Dict[Key, float] = {}
        for at in range(start, start + count * layout.FORMER_WORDS, layout.FORMER_WORDS):
            rows, number = divmod(int(words[at]), layout.KEY_NUMBERS)
            one, two = self._names(*divmod(rows, layout.KEY_ROWS))
            forces[one, two, number] = float(self.values[at + 1])
        return Memory(int(words[layout.H_FORMER_STEP]), forces)

    def write_memory(self, memory: Memory) -> None:
        """Write the normal forces of the last coupled step; contacts of unknown collisions are ignored."""
        words, rows = self.words, {name: index + 1 for index, name in enumerate(self._rows)}
        words[layout.H_FORMER_STEP], count = memory.step, 0
        for (first, second, number), force in memory.forces.items():
            if first in rows and second in rows:
                one, two = sorted((rows[first], rows[second]))
                at = self._starts[layout.H_FORMER] + count * layout.FORMER_WORDS
                words[at] = (one * layout.KEY_ROWS + two) * layout.KEY_NUMBERS + number
                self.values[at + 1] = force
                count += 1
        words[layout.H_FORMER_COUNT] = count

    def loads(self) -> Loads:
        """Return the normal forces of the last contacts of the wheels."""
        words, values, loads = self.words, self.values, {}
        for name, row in self._wheels.items():
            step, other, at = words[row + layout.L_STEP:row + layout.L_AT + 1].tolist()
            force = float(values[row + layout.L_FORCE])
            if at:
                normal = values[row + layout.L_NORMAL:row + layout.L_ROOM]
                force = float(abs(values[at] * normal[0] + values[at + 1] * normal[1] + values[at + 2] * normal[2]))
            if step:
                loads[name] = step, self._rows[other - 1], force
        return loads

    def write_loads(self, loads: Loads) -> None:
        """Write the normal forces of the last contacts of the wheels; contacts of unknown collisions are ignored."""
        words, rows = self.words, {name: index + 1 for index, name in enumerate(self._rows)}
        for name, (step, other, force) in loads.items():
            if name in self._wheels and other in rows:
                row = self._wheels[name]
                words[row + layout.L_STEP:row + layout.L_AT + 1] = step, rows[other], 0
                self.values[row + layout.L_FORCE] = force

    def _names(self, row: int, other: int) -> Names:
        """Return the sorted names of two geoms, given by their rows, from 1."""
        one, two = self._rows[row - 1], self._rows[other - 1]
        return (one, two) if one <= two else (two, one)


def _vector(values: NDArray[np.float64], at: int) -> Vector:
    x, y, z = values[at:at + 3].tolist()
    return (x, y, z)
