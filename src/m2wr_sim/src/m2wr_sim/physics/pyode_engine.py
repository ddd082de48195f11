# SPDX-License-Identifier: BSD-3-Clause
"""The world stepped through pyode: one Python callback per pair of geoms that may collide.

It is the reference for faster engines and the fallback where they cannot run.  Two rules are necessary.  Python frees
an object of the binding with its last reference, so lists hold every geom and joint.  No object of the binding refers
to this engine, because the cycle collector would free the world before its bodies and crash the interpreter.
"""
import itertools
import logging
import math
from dataclasses import replace

import ode

from m2wr_sim.errors import LostError, ModelError
from m2wr_sim.geometry import cross, rotate
from m2wr_sim.model.types import Heightmap, Plane
from m2wr_sim.physics import dampers, native_ode
from m2wr_sim.physics import pyode_bodies as bodies
from m2wr_sim.physics.centre_of_mass import move_centre
from m2wr_sim.physics.contact_watch import ContactWatch, hand_out
from m2wr_sim.physics.contacts import FLAT, MODE_FDIR1, STEEP, has_direction, load_class, pair_surface, reduced
from m2wr_sim.physics.coupled_friction import Grip, Memory, solve_coupled
from m2wr_sim.physics.engine import TOO_FAR, TOO_FAST, ContactEvent, Engine, LinkState, ModelHandle
from m2wr_sim.physics.idle import count_down
from m2wr_sim.physics.islands import Islands
from m2wr_sim.physics.limits import check_leverage, check_model, too_mobile
from m2wr_sim.physics.native_shapes import enter_space, leave_space
from m2wr_sim.physics.step_layout import KEPT_PER_GEOM, LEAST_KEPT

log = logging.getLogger(__name__)

_QUADTREE_EXTENT, _QUADTREE_DEPTH = 100.0, 6      # m half width; leaves of about 3 m; geoms outside still collide


class PyodeEngine(Engine):
    """See :class:`~m2wr_sim.physics.engine.Engine`."""

    def __init__(self, settings):
        self._world = ode.World()
        self._world.setAutoDisableFlag(False)       # see idle
        extent = _QUADTREE_EXTENT
        self._static_space = ode.QuadTreeSpace((0.0, 0.0, 0.0), (extent, extent, extent), _QUADTREE_DEPTH)
        self._moving_space = ode.HashSpace()
        self._contact_group = ode.JointGroup()
        self._parts = {}
        self._links, self._joints = {}, {}
        self._placed = {}                       # static link -> version of the engine when it was moved last
        self._next_id = 0
        self._shapes, self._pairs = {}, {}
        self._moving = []                       # parts with bodies, in load order
        self._damped_joints, self._damped_links = [], []
        self._hinges, self._idlers = [], []
        self._steps = 0
        self._pairs_before, self._pairs_now, self._contact_events = {}, {}, []
        self._watches, self._watched, self._felt = [], frozenset(), []
        self._felt_since = {}                   # joint -> number of the step before its first measurement
        self._grips, self._coupled = [], False      # of this step: all contacts, whether one is coupled
        self._memory = Memory()
        self._islands = Islands()
        self._iterative = False         # whether all steps are solved iteratively
        self._messages = native_ode.MessageCounter()
        PyodeEngine.configure(self, settings)

    # ---- building ----------------------------------------------------------------------------------------------

    def add_model(self, model, pose, name=None):
        name = name or model.name
        check_model(model, name)
        native_ode.note_model(name)
        parts = bodies.ModelParts(name, model.static)
        try:
            self._build(parts, model, pose)
        except Exception:
            self._release(parts)
            raise
        self._parts[name] = parts
        handle = ModelHandle(name, {}, {})
        for link in parts.links:
            handle.links[link.spec.name] = self._register(self._links, link)
        for drive in parts.joints:
            handle.joints[drive.spec.name] = self._register(self._joints, drive)
        self._note_mobility(parts)
        if not parts.static:
            self._moving.append(parts)
        self._refresh_lists()
        return handle

    def _register(self, table, entry):
        self._next_id += 1
        table[self._next_id] = entry
        return self._next_id

    def _build(self, parts, model, pose):
        parts.stiffer = load_class(sum(link.inertial.mass for link in model.links))
        wheels = bodies.wheel_poses(model)
        parts.sleeps = model.allow_auto_disable and not (model.joints or any(link.sensors for link in model.links))
        if not parts.static:
            parts.space = ode.SimpleSpace(self._moving_space)
        by_name = {}
        for spec in model.links:
            full_name = "%s::%s" % (parts.name, spec.name)
            at = bodies.initial_link_pose(pose, spec)
            body = None if parts.static else bodies.make_body(self._world, spec, full_name, at)
            link = bodies.LinkBody(full_name, spec, body, spec.inertial.pose[0], at, parts.sleeps)
            parts.links.append(link)
            by_name[spec.name] = link
            parts.self_colliding = parts.self_colliding or spec.self_collide
            for collision in spec.collisions:
                self._add_geom(parts, link, collision, wheels.get((spec.name, collision.name)))
        for spec in model.joints:
            full_name = "%s::%s" % (parts.name, spec.name)
            ends = [spec.child] if spec.parent == "world" else [spec.parent, spec.child]
            for end in ends:
                if end not in by_name:
                    raise ModelError("joint %s connects link %s, which %s does not have (it has %s)"
                                     % (full_name, end, parts.name, ", ".join(by_name)))
            if parts.static:
                continue
            parent = None if spec.parent == "world" else by_name[spec.parent]
            parts.joints.append(bodies.make_joint(self._world, spec, full_name, parent, by_name[spec.child]))

    def _add_geom(self, parts, link, collision, wheel_pose):
        where = "%s::%s" % (link.name, collision.name)
        grounded = parts.space is None or isinstance(collision.geometry, Heightmap)     # an empty space is false
        space = self._static_space if grounded else parts.space
        if isinstance(collision.geometry, Plane):
            geom = bodies.make_plane(collision, link.pose, self._static_space)
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
        self._shapes[geom] = bodies.Shape(where, collision, wheel_pose is not None, parts.name, link.name, body,
                                          parts.stiffer, link.countdown)
        link.geoms.append((geom, collision))
        parts.geoms.append(geom)

    def abandon_model(self, handle):
        parts = self._parts.pop(handle.name)
        self._moving.remove(parts)
        for number in handle.joints.values():
            drive = self._joints[number]
            drive.hinge, drive.spec = False, replace(drive.spec, kind="fixed")
            drive.damping = drive.stiffness = drive.pull = 0.0
        self._release(parts)
        self._refresh_lists()
        self._wake()
        self.version += 1

    def remove_model(self, handle):
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

    def _wake(self):
        """Wake every sleeping body: its support may have been removed, which ODE does not notice."""
        for parts in self._moving:
            for link in parts.links:
                self._enable(link)

    def _enable(self, link):
        """Wake a body, if it sleeps, and restart its idle time."""
        link.body.enable()
        if link.countdown is not None:
            link.countdown.restart()

    def _release(self, parts):
        """Free a model's ODE objects: joints, then geoms, then bodies."""
        self._contact_group.empty()
        gone = set(parts.geoms)
        self._pairs = {pair: value for pair, value in self._pairs.items() if gone.isdisjoint(pair)}
        for drive in parts.joints:
            for damper in drive.dampers.values():
                damper.remove()
            drive.joint.attach(None, None)
        parts.joints = []
        for geom in parts.geoms:
            leave_space(geom, parts.space if self._shapes[geom].moves else self._static_space)
            del self._shapes[geom]
        names = tuple(link.name + "::" for link in parts.links)
        for table in (self._pairs_before, self._pairs_now):
            for pair in [pair for pair in table if any(side.startswith(names) for side in pair)]:
                del table[pair]
        for link in parts.links:
            link.geoms, link.body = [], None
        parts.geoms = []
        if parts.space is not None:
            self._moving_space.remove(parts.space)
            parts.space = None

    def _refresh_lists(self):
        """Collect the objects that are processed in every step."""
        self._hinges = [drive for drive in self._joints.values() if drive.hinge]
        self._idlers = [link for link in self._links.values() if link.body is not None and link.countdown is not None]
        self._settle_damping()
        self._iterative = self.settings.solver == "quick" or any(parts.too_mobile for parts in self._moving)
        self._damped_links = [link for link in self._links.values() if link.body is not None
                              and (link.spec.linear_damping or link.spec.angular_damping)]

    def _note_mobility(self, parts):
        """Check whether the direct solver can handle a model; if not, all steps are solved iteratively."""
        parts.too_mobile = None if parts.static else too_mobile(link.spec for link in parts.links)
        if parts.too_mobile and self.settings.solver != "quick":
            log.warning("%s::%s: %s. While it is in the world, every step is solved iteratively, which is less exact",
                        parts.name, *parts.too_mobile)

    def _settle_damping(self):
        """Choose how joints are damped, which depends on the step size."""
        for parts in self._moving:
            dampers.settle(self._world, parts, self._dt)
        self._damped_joints = [drive for drive in self._joints.values()
                               if drive.damping or drive.stiffness or drive.pull]

    # ---- stepping ----------------------------------------------------------------------------------------------

    def step(self, count):
        left = self._take_steps(count)
        if left is not None:
            raise self._lost(left)

    def _take_steps(self, count):
        """Make steps; return None, or the number of steps left if a body has left the world.

        This raises no exception, because its traceback would keep objects of the binding alive after their world.
        """
        world, group, static, moving = self._world, self._contact_group, self._static_space, self._moving
        near = self._near
        self.version += 1
        # libode aborts the process at a value that is not finite, so bodies are checked after each step
        motions = [(link.body.getPosition, link.body.getLinearVel, link.body.getAngularVel)
                   for parts in moving for link in parts.links]
        for taken in range(1, count + 1):
            self._steps += 1
            if self._damped_joints or self._damped_links:
                dampers.slow_down(self._damped_joints, self._damped_links)
            self._islands.clear()
            self._grips, self._coupled = [], False
            for parts in moving:
                ode.collide2(parts.space, static, None, near)
                if parts.self_colliding:
                    parts.space.collide(None, self._near_itself)
            if len(moving) > 1:
                self._moving_space.collide(None, near)
            if self._idlers:
                count_down(self._idlers, self._dt)
            iterative = self._solve(world)
            if self._felt:
                self._hand_out_contacts()
            group.empty()
            if self._pairs_now or self._pairs_before:
                self._update_contacts()
            for position, linear, angular in motions:
                if not (sum(map(abs, linear() + angular())) < TOO_FAST and sum(map(abs, position())) < TOO_FAR):
                    return count - taken
            self._unwrap()
            if iterative:
                self._warn_of_island(self._islands.members, self._islands.largest)
        return None

    def _lost(self, left):
        """Return the LostError for every model with a body that is not finite, too far or too fast."""
        found = {}
        for parts in self._moving:
            for link in parts.links:
                body = link.body
                if parts.name not in found and not (
                        sum(map(abs, body.getLinearVel() + body.getAngularVel())) < TOO_FAST
                        and sum(map(abs, body.getPosition())) < TOO_FAR):
                    found[parts.name] = bodies.describe_loss(self._steps, self._dt, parts, link)
        return LostError("; ".join(found.values()), found, left)

    def _solve(self, world):
        """Solve for the forces and move the bodies; return whether this was iterative because of a large island."""
        if self._iterative:
            world.quickStep(self._dt)
        elif self._islands.largest <= self.iterative_above:
            if self._coupled and 1 < self.settings.friction_solves and len(self._grips) <= self._most_kept():
                forces = self._memory.forces if self._memory.step + 1 == self._steps else {}
                forces = solve_coupled(world, self._contact_group, self._grips,
                                       {parts.name: [link.body for link in parts.links] for parts in self._moving},
                                       self._islands.stands_for, self._dt, self.settings.friction_solves, forces)
                self._memory = Memory(self._steps, forces)
            else:
                world.step(self._dt)
        else:
            before = native_ode.random_seed()
            native_ode.seed_random(self._steps)     # the result must not depend on earlier draws
            world.quickStep(self._dt)
            native_ode.seed_random(before)
            return True
        return False

    def _most_kept(self):
        """Return the greatest number of contacts of a step that is solved more than once."""
        return max(LEAST_KEPT, KEPT_PER_GEOM * sum(len(self._bodies_geoms(parts)) for parts in self._moving))

    def _warn_of_island(self, names, contacts):
        """Log a warning about a large island, and call ``between``."""
        self._islands.warn(self._steps, self._dt, names, contacts, self.settings.iterations)
        if self.between is not None:
            self.between()

    def _near_itself(self, _, first, second):
        """Make contacts inside a model: only between two links with self_collide that share no joint."""
        one, two = self._shapes[first], self._shapes[second]
        if one.link == two.link or ode.areConnected(one.body, two.body):
            return
        links = {link.name: link.spec.self_collide for link in self._links.values()}
        if links.get(one.link) and links.get(two.link):
            self._near(None, first, second)

    def _near(self, _, first, second):
        if first.isSpace() or second.isSpace():
            ode.collide2(first, second, None, self._near)
            return
        pair = self._pairs.get((first, second), False)
        if pair is False:
            pair = self._make_pair(first, second)
        if pair is None:
            return
        found = [contact for contact in ode.collide(first, second)
                 if has_direction(contact.getContactGeomParams()[1])]
        if found:
            self._make_contacts(pair, first, second, found)

    def _make_pair(self, first, second):
        one, two = self._shapes[first], self._shapes[second]
        surface = None
        if one.moves or two.moves:
            surface = pair_surface(one.collision, two.collision, one.wheel, two.wheel, one.moves and two.moves,
                                   self.settings, min(one.stiffer, two.stiffer))
        # ODE may exchange the two geoms of a pair as they move; it stays the same contact
        names = tuple(sorted((one.name, two.name)))
        pair = None if surface is None else (surface, one, two, names)
        self._pairs[(first, second)] = pair
        return pair

    def _make_contacts(self, pair, first, second, found):
        surface, one, two, names = pair[0], pair[1].body, pair[2].body, pair[3]
        watched = self._watched and not self._watched.isdisjoint(names)
        if len(found) > 1 and (surface.merge or len(found) > surface.max_contacts):
            described = [contact.getContactGeomParams()[:3] for contact in found]
            kept = reduced(described, surface)
            for contact, (position, normal, depth) in zip(found, kept):
                contact.setContactGeomParams(position, normal, depth, first, second)
            found = found[:len(kept)]
        if one is not None and two is not None:
            self._islands.join(pair[1].model, pair[2].model, len(found), one.isEnabled() or two.isEnabled())
        both_move, restless = one is not None and two is not None, pair[1].restless or pair[2].restless
        for number, contact in enumerate(found):
            position, normal, depth = contact.getContactGeomParams()[:3]
            if not surface.ground and (both_move or -STEEP < normal[2] < STEEP):
                self._pairs_now.setdefault(names, (position, depth))
            coupled = restless and (both_move or -FLAT < normal[2] < FLAT)
            self._coupled = self._coupled or coupled
            mode = surface.mode
            if mode & MODE_FDIR1:
                mode = bodies.direct_friction(contact, surface, second if surface.along_second else first)
            contact.setMode(mode)
            contact.setMu(surface.mu)
            contact.setMu2(surface.mu2)
            contact.setBounce(surface.bounce)
            contact.setBounceVel(surface.bounce_velocity)
            if surface.slip1 or surface.slip2:
                contact.setSlip1(surface.slip1 * len(found))
                contact.setSlip2(surface.slip2 * len(found))
            if surface.soft_cfm:
                contact.setSoftERP(surface.soft_erp)
                contact.setSoftCFM(surface.soft_cfm)
            joint = ode.ContactJoint(self._world, self._contact_group, contact)
            joint.attach(one, two)
            grip = Grip(joint, contact, one, two, surface, mode, normal, pair[2 if one is None else 1].model, coupled,
                        names + (number,))
            self._grips.append(grip)
            if watched:
                for shape in pair[1:3]:
                    if shape.body is not None:
                        self._enable(shape)     # a sleeping body is not solved, and has no contact forces
                joint.setFeedback(True)
                self._felt.append((grip, first, second, (position, normal, depth)))

    def _hand_out_contacts(self):
        """Pass the contacts of this step, with the forces from the solver, to the watches."""
        links = {link.name: link for link in self._links.values()}
        felt, self._felt = self._felt, []
        for grip, first, second, geometry in felt:
            sides = [(shape.name, shape.moves, links[shape.link].pose[0])
                     for shape in (self._shapes[first], self._shapes[second])]
            hand_out(self._watches, self._steps, sides, geometry, grip.joint.getFeedback())
            grip.joint.setFeedback(False)    # else the binding does it after the joint is freed, and aborts

    def _update_contacts(self):
        for names, (position, depth) in self._pairs_now.items():
            if names not in self._pairs_before:
                self._contact_events.append(ContactEvent(self._steps, names[0], names[1], position, depth))
        self._pairs_before, self._pairs_now = self._pairs_now, {}

    def _unwrap(self):
        """Count full rotations: take the angle that fits the reading and is nearest to the prediction by the rate."""
        elapsed = self._dt
        for drive in self._hinges:
            raw = drive.joint.getAngle()
            predicted = drive.angle + drive.joint.getAngleRate() * elapsed
            drive.angle = raw + 2.0 * math.pi * round((predicted - raw) / (2.0 * math.pi))

    # ---- state -------------------------------------------------------------------------------------------------

    def link_pose(self, link):
        return bodies.link_pose(self._links[link])

    def link_state(self, link):
        entry = self._links[link]
        if entry.body is None:
            return LinkState(entry.pose[0], entry.pose[1], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        position, orientation = bodies.link_pose(entry)
        angular, linear = entry.body.getAngularVel(), entry.body.getLinearVel()
        arm = cross(angular, rotate(orientation, entry.com))
        return LinkState(position, orientation, (linear[0] - arm[0], linear[1] - arm[1], linear[2] - arm[2]), angular)

    def set_link_pose(self, link, pose):
        entry = self._links[link]
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

    def placed_since(self, version):
        return list(itertools.takewhile(lambda link: self._placed[link] > version, reversed(self._placed)))

    def set_link_velocity(self, link, linear, angular):
        if not math.isfinite(sum(linear) + sum(angular)):       # ODE would abort the process
            raise ModelError("velocity %s m/s, %s rad/s of %s; expected finite numbers" % (
                tuple(linear), tuple(angular), self._links[link].name))
        body = self._links[link].body
        if body is not None:
            body.setLinearVel(tuple(linear))
            body.setAngularVel(tuple(angular))
            self._enable(self._links[link])

    def joint_angle(self, joint):
        drive = self._joints[joint]
        if drive.hinge:
            return drive.angle
        return drive.joint.getPosition() if drive.spec.kind == "prismatic" else 0.0

    def joint_rate(self, joint):
        drive = self._joints[joint]
        if drive.hinge:
            return drive.joint.getAngleRate()
        return drive.joint.getPositionRate() if drive.spec.kind == "prismatic" else 0.0

    def set_joint_motor(self, joint, rate, max_force):
        drive = self._joints[joint].joint
        drive.setParam(bodies.PARAM_VEL, rate)
        drive.setParam(bodies.PARAM_FMAX, max_force)

    def set_joint_motor_force(self, joint, max_force):
        self._joints[joint].joint.setParam(bodies.PARAM_FMAX, max_force)

    def add_link_force(self, link, force, torque):
        body = self._links[link].body
        if body is not None:
            self._enable(self._links[link])
            body.addForce(tuple(force))
            body.addTorque(tuple(torque))

    def add_joint_force(self, joint, force):
        drive = self._joints[joint]
        if drive.hinge:
            drive.joint.addTorque(force)
        elif drive.spec.kind == "prismatic":
            drive.joint.addForce(force)
        for number in (0, 1):
            body = drive.joint.getBody(number)
            if body is not None:
                body.enable()

    def set_link_gravity(self, link, acts):
        body = self._links[link].body
        if body is not None:
            body.setGravityMode(bool(acts))
            self._enable(self._links[link])

    def set_link_inertial(self, link, inertial):
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

    def change_joint(self, joint, axis, parameters, index=0):
        drive = self._joints[joint]
        drive.spec = replace(drive.spec, **{"axis2" if index else "axis": axis})
        for name, value in parameters.items():
            if name in ("cfm", "stop_cfm"):
                value = bodies.bounded_softness(value)
            drive.joint.setParam(bodies.axis_group(drive.spec.kind, index) + bodies.PARAMETERS[name], value)
        self._refresh_lists()
        self._wake()

    def set_joint_angle(self, joint, angle):
        self._joints[joint].angle = angle

    def collisions(self, handle):
        return [(number, collision, self._shapes[geom].moves)
                for number in handle.links.values() for geom, collision in self._links[number].geoms]

    def watch_contacts(self, names):
        watch = ContactWatch(names)
        self._watches.append(watch)
        self._watched = self._watched | watch.names
        return watch

    def end_watch(self, watch):
        self._watches.remove(watch)
        self._watched = frozenset().union(*(other.names for other in self._watches))

    def feel_joint(self, joint):
        drive = self._joints[joint]
        if drive.joint.getFeedback() is None:
            drive.joint.setFeedback(True)
            self._felt_since[joint] = self._steps

    def joint_wrench(self, joint):
        # before the first step the values of the binding are undefined; nothing acts on an abandoned joint
        if self._felt_since[joint] == self._steps or self._joints[joint].joint.getBody(0) is None:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        return self._joints[joint].joint.getFeedback()[:2]

    def drain_contact_events(self):
        events, self._contact_events = self._contact_events, []
        return events

    @property
    def solver_messages(self):
        """Number of messages of ODE's solver in this process; a constant stream means an ill-conditioned world."""
        return self._messages.count

    def configure(self, settings):
        self.settings = settings
        self._dt = settings.step_ns * 1e-9
        world = self._world
        world.setGravity(settings.gravity)
        world.setERP(settings.erp)
        world.setCFM(settings.cfm)
        world.setContactSurfaceLayer(settings.surface_layer)
        world.setContactMaxCorrectingVel(settings.max_correcting_velocity)
        world.setQuickStepNumIterations(settings.iterations)
        self._pairs = {}                # contact parameters depend on the step size and the limits
        self._settle_damping()
        self._wake()

    def reseed(self, seed):
        native_ode.seed_random(seed)

    def forget(self):
        self._steps, self._memory = 0, Memory()
        self._felt_since = dict.fromkeys(self._felt_since, 0)
        self._pairs_before, self._pairs_now, self._contact_events = {}, {}, []
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

    def _bodies_geoms(self, parts):
        """Return the geoms in the space of a model; planes, for instance, are not in it."""
        return [geom for geom in parts.geoms if self._shapes[geom].moves]

    def close(self):
        self.between = None
        for parts in list(self._parts.values()):
            self._release(parts)
        self._parts.clear()
        self._moving = []
        self._links.clear()
        self._joints.clear()
        self._refresh_lists()
        self._contact_group = self._static_space = self._moving_space = self._world = None
