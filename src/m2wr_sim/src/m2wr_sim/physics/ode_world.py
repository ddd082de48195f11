# SPDX-License-Identifier: BSD-3-Clause
"""The ODE world of an engine: builds models in it, and reads and changes the state of links and joints.

The classes derived from it make the steps.  Two rules are necessary.  Python frees an object of the binding with its
last reference, so lists hold every geom and joint.  A world must be freed after its bodies and joints, otherwise libode
crashes; see :mod:`m2wr_sim.physics.world_order`.
"""
from __future__ import annotations

import itertools
import logging
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Callable, Dict, FrozenSet, Iterable, List, Optional, Sequence, Tuple, TypeVar, Union

import ode

from m2wr_sim.errors import LostError, ModelError
from m2wr_sim.geometry import cross, rotate, rotate_inverse
from m2wr_sim.model.types import Heightmap, Plane
from m2wr_sim.physics import dampers, native_ode
from m2wr_sim.physics import pyode_bodies as bodies
from m2wr_sim.physics.centre_of_mass import move_centre
from m2wr_sim.physics.contact_watch import ContactWatch
from m2wr_sim.physics.contacts import load_class
from m2wr_sim.physics.coupled_friction import Memory
from m2wr_sim.physics.engine import TOO_FAR, TOO_FAST, ContactEvent, Engine, EngineSettings, LinkState, ModelHandle
from m2wr_sim.physics.islands import Islands
from m2wr_sim.physics.joint_axes import axis_access
from m2wr_sim.physics.limits import check_leverage, check_model, too_mobile
from m2wr_sim.physics.native_shapes import enter_space, leave_space
from m2wr_sim.physics.parts import JointDrive, LinkBody, ModelParts, Shape
from m2wr_sim.physics.rows import Row
from m2wr_sim.physics.step_layout import KEPT_PER_GEOM, LEAST_KEPT
from m2wr_sim.physics.wheels import initial_link_pose, skids, wheel_poses
from m2wr_sim.physics.world_order import keep_until_collected

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.types import Axis, Collision, Inertial, Joint, Model
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.sliding import Loads

    #: Names of two collisions in contact, sorted.
    Names = Tuple[str, str]

log = logging.getLogger(__name__)

_Entry = TypeVar("_Entry")
_QUADTREE_EXTENT, _QUADTREE_DEPTH = 100.0, 6      # m half width; leaves of about 3 m; geoms outside still collide
_MOST_DOUBLINGS = 3         # of the extent, with leaves of the same size; beyond 800 m the tree needs too much memory
_SETTLED = 256              # so many new static geoms are put into the leaves together: libode searches a list for each


class OdeWorld(Engine):
    """What the engines have in common. See :class:`~m2wr_sim.physics.engine.Engine`."""

    def __init__(self, settings: EngineSettings) -> None:
        self._world = ode.World()
        keep_until_collected(self, self._world)
        self._world.setAutoDisableFlag(False)       # see idle
        self._doublings = 0                         # of the quadtree's extent
        self._static_space = _quadtree(0)
        self._unsettled: List[Geom] = []            # static geoms that were added last
        self._moving_space = ode.HashSpace()
        self._parts: Dict[str, ModelParts] = {}
        self._links: Dict[int, LinkBody] = {}
        self._joints: Dict[int, JointDrive] = {}
        self._placed: Dict[int, int] = {}           # static link -> version of the engine when it was moved last
        self._next_id = 0
        self._shapes: Dict[Geom, Shape] = {}
        self._moving: List[ModelParts] = []         # those with bodies, in load order
        self._damped_joints: List[JointDrive] = []
        self._damped_links: List[LinkBody] = []
        self._hinges: List[JointDrive] = []
        self._idlers: List[LinkBody] = []
        self._steps = 0
        self._pairs_before: Dict[Names, Tuple[Vector, float]] = {}      # in contact in the last step: position, depth
        self._contact_events: List[ContactEvent] = []
        self._watches: List[ContactWatch] = []
        self._watched: FrozenSet[str] = frozenset()
        self._felt_since: Dict[int, int] = {}       # joint -> number of the step before its first measurement
        self._memory = Memory()
        self._loads: Loads = {}         # of wheels, for the next step
        self._rows: Dict[Tuple[LinkBody, Optional[LinkBody]], Row] = {}
        self._islands = Islands()
        self._iterative = False         # whether all steps are solved iteratively
        self._messages = native_ode.MessageCounter()
        OdeWorld.configure(self, settings)

    # ---- building -----------------------------------------------------------------------------------------------

    def add_model(self, model: Model, pose: Pose, name: Optional[str] = None) -> ModelHandle:
        name = name or model.name
        check_model(model, name)
        native_ode.note_model(name)
        parts = ModelParts(name, model.static)
        try:
            self._build(parts, model, pose)
        except Exception:
            self._release(parts)
            raise
        self._parts[name] = parts
        handle = ModelHandle(name, {}, {})
        for link in parts.links:
            handle.links[link.spec.name] = self._register(self._links, link)
        for drive in parts.drives():
            handle.joints[drive.name[len(name) + 2:]] = self._register(self._joints, drive)
        self._note_mobility(parts)
        if not parts.static:
            self._moving.append(parts)
        self._extend_lists(parts)
        return handle

    def _register(self, table: Dict[int, _Entry], entry: _Entry) -> int:
        self._next_id += 1
        table[self._next_id] = entry
        return self._next_id

    def _build(self, parts: ModelParts, model: Model, pose: Pose) -> None:
        parts.stiffer = load_class(sum(link.inertial.mass for link in model.links))
        wheels = wheel_poses(model.links, model.joints)
        parts.skids = skids(model.links, wheels)
        parts.sleeps = model.allow_auto_disable and not (model.joints or any(link.sensors for link in model.links))
        if not parts.static:
            parts.space = ode.SimpleSpace(self._moving_space)
        by_name = {}
        for spec in model.links:
            full_name = "%s::%s" % (parts.name, spec.name)
            at = initial_link_pose(pose, spec)
            body = None if parts.static else bodies.make_body(self._world, spec, full_name, at)
            link = LinkBody(full_name, spec, body, spec.inertial.pose[0], at, parts.sleeps)
            parts.links.append(link)
            by_name[spec.name] = link
            parts.self_colliding = parts.self_colliding or spec.self_collide
            for collision in spec.collisions:
                self._add_geom(parts, link, collision, wheels.get((spec.name, collision.name)))
        for joint in model.joints:
            full_name = "%s::%s" % (parts.name, joint.name)
            ends = [joint.child] if joint.parent == "world" else [joint.parent, joint.child]
            for end in ends:
                if end not in by_name:
                    raise ModelError("joint %s connects link %s, which %s does not have (it has %s)"
                                     % (full_name, end, parts.name, ", ".join(by_name)))
            if parts.static:
                continue
            parent = None if joint.parent == "world" else by_name[joint.parent]
            parts.joints.append(bodies.make_joint(self._world, joint, full_name, parent, by_name[joint.child]))

    def join(self, handle: ModelHandle, joint: Joint) -> int:
        name, parts = "%s::%s" % (handle.name, joint.name), self._parts[handle.name]
        if joint.name in handle.joints:
            raise ModelError("joint %s: the model has one of this name; expected another name" % name)
        if parts.static:
            raise ModelError("joint %s: the model is static; expected one that can move" % name)
        ends = {link.spec.name: link for link in parts.links}
        for end in (joint.child,) if joint.parent == "world" else (joint.child, joint.parent):
            if end not in ends:
                raise ModelError("joint %s connects link %s, which %s does not have (it has %s)"
                                 % (name, end, parts.name, ", ".join(ends)))
        drive = bodies.make_joint(self._world, joint, name, ends.get(joint.parent), ends[joint.child])
        parts.joints.append(drive)
        self._keep_awake(parts)
        number = handle.joints[joint.name] = self._register(self._joints, drive)
        self._refresh_lists()
        self._wake()
        return number

    def _keep_awake(self, parts: ModelParts) -> None:
        """Let the bodies of a model never sleep again, as those of all models with joints."""
        for link in parts.links:
            self._enable(link)
            link.countdown = None
        for geom in parts.geoms:
            shape = self._shapes[geom]
            shape.countdown, shape.restless = None, shape.moves

    def part(self, joint: int) -> None:
        drive = self._joints[joint]
        for parts in self._moving:
            if drive in parts.joints:
                parts.joints.remove(drive)
                _detach(drive)
        _make_readable(drive)
        self._refresh_lists()
        self._wake()

    def let_slip(self, link: int, axis: Sequence[float]) -> None:
        entry = self._links[link]
        if entry.body is None:
            return
        direction = rotate(bodies.link_pose(entry)[1], axis)
        for geom, _ in entry.geoms:
            shape, (w, x, y, z) = self._shapes[geom], geom.getQuaternion()
            surface = replace(shape.collision.surface, fdir1=rotate_inverse((x, y, z, w), direction))
            shape.collision = replace(shape.collision, surface=surface)
            shape.slip = shape.slip or (0.0, 0.0)

    def set_slip(self, link: int, along: float, across: float) -> None:
        for geom, _ in self._links[link].geoms:
            self._shapes[geom].slip = along, across

    def _add_geom(self, parts: ModelParts, link: LinkBody, collision: Collision, wheel_pose: Optional[Pose]) -> None:
        where = "%s::%s" % (link.name, collision.name)
        grounded = parts.space is None or isinstance(collision.geometry, Heightmap)     # an empty space is falsy
        space = self._static_space if grounded else parts.space
        if isinstance(collision.geometry, Plane):
            geom: Geom = bodies.make_plane(collision, collision.geometry, link.pose, self._static_space)
            body = None
        else:
            geom = bodies.make_geom(collision, space, where)
            body = None if grounded else link.body
            if body is not None:
                bodies.attach_geom(geom, body, link.com, wheel_pose or collision.pose)
            else:
                bodies.place_geom(geom, link.pose, collision.pose)
        geom.setCategoryBits(bodies.CATEGORY_MOVING if body is not None else bodies.CATEGORY_STATIC)
        geom.setCollideBits(bodies.COLLIDE_EVERYTHING if body is not None else 0)
        self._shapes[geom] = Shape(where, collision, wheel_pose is not None, parts.name, link.name, body,
                                   parts.stiffer, link.countdown, link.spec.kinematic, parts.skids)
        link.geoms.append((geom, collision))
        parts.geoms.append(geom)
        if body is None and not isinstance(collision.geometry, Plane):
            self._unsettled.append(geom)
            if len(self._unsettled) == _SETTLED:
                self._settle_static()

    def _settle_static(self) -> None:
        """Put the static geoms that were added last into the leaves of the quadtree, which grows if they are outside.

        libode would do it before the next step, in a time that grows with the square of their number; and each step
        visits all geoms outside of the tree.
        """
        native_ode.clean_space(self._static_space)
        farthest = native_ode.farthest(self._unsettled)
        self._unsettled = []
        doublings = self._doublings
        while doublings < _MOST_DOUBLINGS and farthest > _QUADTREE_EXTENT * 2.0 ** doublings:
            doublings += 1
        if doublings == self._doublings:
            return
        former, self._static_space, self._doublings = self._static_space, _quadtree(doublings), doublings
        grounded = [geom for geom, shape in self._shapes.items() if not shape.moves]
        for number, geom in enumerate(grounded):
            leave_space(geom, former)
            enter_space(geom, self._static_space)
            if number % _SETTLED == 0:
                native_ode.clean_space(self._static_space)
        native_ode.clean_space(self._static_space)

    def abandon_model(self, handle: ModelHandle) -> None:
        parts = self._parts.pop(handle.name)
        self._moving.remove(parts)
        for number in handle.joints.values():
            _make_readable(self._joints[number])
        self._release(parts)
        self._refresh_lists()
        self._wake()
        self.version += 1

    def remove_model(self, handle: ModelHandle) -> None:
        parts = self._parts.pop(handle.name, None)
        if parts in self._moving:
            self._moving.remove(parts)
        for table, ids in ((self._links, handle.links), (self._joints, handle.joints)):
            for number in ids.values():
                table.pop(number, None)
                self._placed.pop(number, None)
        if parts is not None:           # else it was abandoned before
            self._release(parts)
        self._refresh_lists()
        self._wake()

    def _wake(self) -> None:
        """Wake every sleeping body: its support may have been removed, which ODE does not notice."""
        for parts in self._moving:
            for link in parts.links:
                self._enable(link)

    def _enable(self, link: Union[LinkBody, Shape]) -> None:
        """Wake a body, if it sleeps, and restart its idle time."""
        link.body.enable()
        if link.countdown is not None:
            link.countdown.restart()

    def _release(self, parts: ModelParts) -> None:
        """Free a model's ODE objects: joints, then geoms, then bodies."""
        gone_links = set(parts.links)
        for pair_of_links in [key for key in self._rows if not gone_links.isdisjoint(key)]:
            self._rows.pop(pair_of_links).remove()
        for drive in parts.joints:
            _detach(drive)
        parts.joints = []
        for geom in parts.geoms:
            leave_space(geom, parts.space if self._shapes[geom].moves else self._static_space)
            del self._shapes[geom]
        if parts.static and self._unsettled:
            gone = set(parts.geoms)
            self._unsettled = [geom for geom in self._unsettled if geom not in gone]
        names = tuple(link.name + "::" for link in parts.links)
        for pair in [pair for pair in self._pairs_before if any(side.startswith(names) for side in pair)]:
            del self._pairs_before[pair]
        self._loads = {name: load for name, load in self._loads.items() if not name.startswith(names)}
        for link in parts.links:
            link.geoms, link.body = [], None
        parts.geoms = []
        if parts.space is not None:
            self._moving_space.remove(parts.space)
            parts.space = None

    def _extend_lists(self, parts: ModelParts) -> None:
        """Add the objects of a new model to those that are processed in every step, as :meth:`_refresh_lists` would."""
        if parts.static:
            return
        dampers.settle(self._world, parts, self._dt)
        self._hinges += [drive for drive in parts.drives() if drive.hinge]
        self._idlers += [link for link in parts.links if link.countdown is not None]
        self._damped_joints += _damped(parts.joints)
        self._damped_links += _damped_links(parts.links)
        self._iterative = self._iterative or self.settings.solver == "quick" or bool(parts.too_mobile)

    def _refresh_lists(self) -> None:
        """Collect the objects that are processed in every step."""
        self._hinges = [drive for drive in self._joints.values() if drive.hinge]
        self._idlers = [link for link in self._links.values() if link.body is not None and link.countdown is not None]
        self._settle_damping()
        self._iterative = self.settings.solver == "quick" or any(parts.too_mobile for parts in self._moving)
        self._damped_links = _damped_links(self._links.values())

    def _note_mobility(self, parts: ModelParts) -> None:
        """Check whether the direct solver can handle a model; if not, all steps are solved iteratively."""
        parts.too_mobile = None if parts.static else too_mobile(link.spec for link in parts.links)
        if parts.too_mobile and self.settings.solver != "quick":
            log.warning("%s::%s: %s. While it is in the world, every step is solved iteratively, which is less exact",
                        parts.name, *parts.too_mobile)

    def _settle_damping(self) -> None:
        """Choose how joints are damped, which depends on the step size."""
        for parts in self._moving:
            dampers.settle(self._world, parts, self._dt)
        self._damped_joints = _damped(self._joints.values())

    # ---- for steps ----------------------------------------------------------------------------------------------

    def _lost(self, left: int) -> LostError:
        """Return an error that names all models with a body that is not finite, too far or too fast."""
        found: Dict[str, str] = {}
        for parts in self._moving:
            for link in parts.links:
                body = link.body
                if parts.name not in found and not (
                        sum(map(abs, body.getLinearVel() + body.getAngularVel())) < TOO_FAST
                        and sum(map(abs, body.getPosition())) < TOO_FAR):
                    found[parts.name] = bodies.describe_loss(self._steps, self._dt, parts, link)
        return LostError("; ".join(found.values()), found, left)

    def _most_kept(self) -> int:
        """Return the greatest number of contacts of a step that is solved more than once."""
        return max(LEAST_KEPT, KEPT_PER_GEOM * sum(len(self._bodies_geoms(parts)) for parts in self._moving))

    def _warn_of_island(self, names: Callable[[], List[str]], contacts: int) -> None:
        """Log a warning about a large island, and call ``between``."""
        self._islands.warn(self._steps, self._dt, names, contacts, self.settings.iterations)
        if self.between is not None:
            self.between()

    def _bodies_geoms(self, parts: ModelParts) -> List[Geom]:
        """Return the geoms in the space of a model; planes, for instance, are not in it."""
        return [geom for geom in parts.geoms if self._shapes[geom].moves]

    # ---- state --------------------------------------------------------------------------------------------------

    def link_pose(self, link: int) -> Pose:
        return bodies.link_pose(self._links[link])

    def link_state(self, link: int) -> LinkState:
        entry = self._links[link]
        if entry.body is None:
            return LinkState(entry.pose[0], entry.pose[1], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        position, orientation = bodies.link_pose(entry)
        angular, linear = entry.body.getAngularVel(), entry.body.getLinearVel()
        arm = cross(angular, rotate(orientation, entry.com))
        return LinkState(position, orientation, (linear[0] - arm[0], linear[1] - arm[1], linear[2] - arm[2]), angular)

    def set_link_pose(self, link: int, pose: Pose) -> None:
        entry = self._links[link]
        if entry.body is None or not entry.spec.kinematic:      # a kinematic body is awake, and so is what it meets
            self._wake()
        self.placements += 1
        self.version += 1
        if entry.body is not None:
            bodies.place_body(entry.body, entry.com, pose)
            return
        entry.pose = pose
        self._placed.pop(link, None)            # so that the latest are last
        self._placed[link] = self.version
        for geom, collision in entry.geoms:
            if not isinstance(collision.geometry, Plane):
                bodies.place_geom(geom, pose, collision.pose)

    def placed_since(self, version: int) -> List[int]:
        return list(itertools.takewhile(lambda link: self._placed[link] > version, reversed(self._placed)))

    def set_link_velocity(self, link: int, linear: Sequence[float], angular: Sequence[float]) -> None:
        if not math.isfinite(sum(linear) + sum(angular)):       # ODE would abort the process
            raise ModelError("velocity %s m/s, %s rad/s of %s; expected finite numbers" % (
                tuple(linear), tuple(angular), self._links[link].name))
        body = self._links[link].body
        if body is not None:
            body.setLinearVel(tuple(linear))
            body.setAngularVel(tuple(angular))
            self._enable(self._links[link])

    def joint_angle(self, joint: int) -> float:
        drive = self._joints[joint]
        return drive.angle if drive.hinge else drive.access.position()

    def joint_rate(self, joint: int) -> float:
        return self._joints[joint].access.rate()

    def set_joint_motor(self, joint: int, rate: float, max_force: float) -> None:
        drive = self._joints[joint]
        put, group = drive.joint.setParam, drive.access.group
        put(group + bodies.PARAM_VEL, rate)
        put(group + bodies.PARAM_FMAX, max_force)

    def set_joint_motor_force(self, joint: int, max_force: float) -> None:
        drive = self._joints[joint]
        drive.joint.setParam(drive.access.group + bodies.PARAM_FMAX, max_force)

    def add_link_force(self, link: int, force: Sequence[float], torque: Sequence[float]) -> None:
        body = self._links[link].body
        if body is not None:
            self._enable(self._links[link])
            body.addForce(tuple(force))
            body.addTorque(tuple(torque))

    def add_joint_force(self, joint: int, force: float) -> None:
        drive = self._joints[joint]
        drive.access.push(force)
        for number in (0, 1):
            body = drive.joint.getBody(number)
            if body is not None:
                body.enable()

    def couple(self, first: int, second: Optional[int], point: Sequence[float], direction: Sequence[float],
               across: Sequence[float], speed: float) -> None:
        one, two = self._links[first], None if second is None else self._links[second]
        if one.body is None or two is not None and two.body is None:
            return
        if (one, two) not in self._rows:
            self._rows[one, two] = Row(self._world)
        self._rows[one, two].set(one.body, None if two is None else two.body, point, direction, across,
                                 speed)

    def set_link_gravity(self, link: int, acts: bool) -> None:
        body = self._links[link].body
        if body is not None:
            body.setGravityMode(bool(acts))
            self._enable(self._links[link])

    def set_link_inertial(self, link: int, inertial: Inertial) -> None:
        entry = self._links[link]
        if entry.body is not None:
            mass = bodies.make_mass(inertial, entry.name)
            check_leverage(replace(entry.spec, inertial=inertial), (), entry.name)
            parts = next(parts for parts in self._moving if entry in parts.links)
            if tuple(inertial.pose[0]) != tuple(entry.com):
                move_centre(parts, entry, inertial.pose[0])
            entry.body.setMass(mass)
            if entry.spec.kinematic:
                entry.body.setKinematic()       # setMass has made it dynamic
            entry.spec = replace(entry.spec, inertial=inertial)
            self._note_mobility(parts)
            self._refresh_lists()
            self._wake()

    def change_joint(self, joint: int, axis: Axis, parameters: Dict[str, float], index: int = 0) -> None:
        drive = self._joints[joint]
        drive.spec = replace(drive.spec, axis2=axis) if index else replace(drive.spec, axis=axis)
        group = (drive.second if index and drive.second else drive).access.group
        for name, value in parameters.items():
            if name in ("cfm", "stop_cfm"):
                value = bodies.bounded_softness(value)
            drive.joint.setParam(group + bodies.PARAMETERS[name], value)
        self._refresh_lists()
        self._wake()

    def set_joint_angle(self, joint: int, angle: float) -> None:
        self._joints[joint].angle = angle

    def collisions(self, handle: ModelHandle) -> List[Tuple[int, Collision, bool]]:
        return [(number, collision, self._shapes[geom].moves)
                for number in handle.links.values() for geom, collision in self._links[number].geoms]

    def watch_contacts(self, names: Iterable[str]) -> ContactWatch:
        watch = ContactWatch(names)
        self._watches.append(watch)
        self._watched = self._watched | watch.names
        return watch

    def end_watch(self, watch: ContactWatch) -> None:
        self._watches.remove(watch)
        self._watched = frozenset().union(*(other.names for other in self._watches))

    def feel_joint(self, joint: int) -> None:
        drive = self._joints[joint]
        if drive.joint.getFeedback() is None:
            drive.joint.setFeedback(True)
            self._felt_since[joint] = self._steps

    def joint_wrench(self, joint: int) -> Tuple[Vector, Vector]:
        # before the first step the values of the binding are undefined; nothing acts on an abandoned joint
        if self._felt_since[joint] == self._steps or self._joints[joint].joint.getBody(0) is None:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        return self._joints[joint].joint.getFeedback()[:2]

    def drain_contact_events(self) -> List[ContactEvent]:
        events, self._contact_events = self._contact_events, []
        return events

    @property
    def solver_messages(self) -> int:
        return self._messages.count

    def configure(self, settings: EngineSettings) -> None:
        self.settings = settings
        self._dt = settings.step_ns * 1e-9
        world = self._world
        world.setGravity(settings.gravity)
        world.setERP(settings.erp)
        world.setCFM(settings.cfm)
        world.setContactSurfaceLayer(settings.surface_layer)
        world.setContactMaxCorrectingVel(settings.max_correcting_velocity)
        world.setQuickStepNumIterations(settings.iterations)
        self._settle_damping()
        self._wake()

    def reseed(self, seed: int) -> None:
        native_ode.seed_random(seed)

    def forget(self) -> None:
        self._steps, self._memory, self._loads = 0, Memory(), {}
        self._felt_since = dict.fromkeys(self._felt_since, 0)
        self._pairs_before, self._contact_events = {}, []
        for watch in self._watches:
            watch.drain()
        for parts in self._moving:
            if not self._bodies_geoms(parts):
                continue        # removing and adding an empty space would make libode abort the process
            # a space moves the geoms that moved last to the front, which changes the order of contacts: restore it
            self._moving_space.remove(parts.space)
            self._moving_space.add(parts.space)
            for geom in self._bodies_geoms(parts):
                leave_space(geom, parts.space)
                enter_space(geom, parts.space)
        self._wake()

    def close(self) -> None:
        self.between = None
        for parts in list(self._parts.values()):
            self._release(parts)
        self._parts.clear()
        self._moving = []
        self._links.clear()
        self._joints.clear()
        self._refresh_lists()
        self._static_space = self._moving_space = self._world = None


def _quadtree(doublings: int) -> ode.QuadTreeSpace:
    """Return the space of static geoms, with leaves of the same size for any extent."""
    extent = _QUADTREE_EXTENT * 2.0 ** doublings
    return ode.QuadTreeSpace((0.0, 0.0, 0.0), (extent, extent, extent), _QUADTREE_DEPTH + doublings)


def _detach(drive: JointDrive) -> None:
    """Detach a joint and its dampers from their links."""
    for damper in drive.dampers.values():
        damper.remove()
    drive.joint.attach(None, None)


def _make_readable(drive: JointDrive) -> None:
    """Give a joint that is detached the position 0, for those who still read it."""
    drive.hinge, drive.spec, drive.angle = False, replace(drive.spec, kind="fixed"), 0.0
    drive.access = axis_access("fixed", drive.joint, 0)
    drive.damping = drive.stiffness = drive.pull = 0.0


def _damped(drives: Iterable[JointDrive]) -> List[JointDrive]:
    """Return the joints with damping or a spring."""
    return [drive for drive in drives if drive.damping or drive.stiffness or drive.pull]


def _damped_links(links: Iterable[LinkBody]) -> List[LinkBody]:
    """Return the links with linear or angular damping that have bodies."""
    return [link for link in links if link.body is not None and (link.spec.linear_damping or link.spec.angular_damping)]
