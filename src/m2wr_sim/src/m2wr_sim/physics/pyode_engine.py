# SPDX-License-Identifier: BSD-3-Clause
"""Physics engine that steps through pyode: one Python callback for each pair of geoms that may collide.

It is the reference for the faster engine, and is used where that cannot run.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, List, Optional, Sequence, Tuple

import ode

from m2wr_sim.physics import dampers, height_contacts, mesh_pairs, native_ode
from m2wr_sim.physics import pyode_bodies as bodies
from m2wr_sim.physics.contact_watch import hand_out
from m2wr_sim.physics.contacts import (
    FLAT,
    MODE_FDIR1,
    STEEP,
    PairSurface,
    has_direction,
    is_repeated,
    pair_surface,
    reduced,
)
from m2wr_sim.physics.coupled_friction import Grip, Memory, solve_coupled
from m2wr_sim.physics.engine import TOO_FAR, TOO_FAST, ContactEvent
from m2wr_sim.physics.idle import count_down
from m2wr_sim.physics.ode_world import OdeWorld
from m2wr_sim.physics.sliding import first_direction, sliding_slips, slip_velocity
from m2wr_sim.physics.step_layout import RECENT

if TYPE_CHECKING:
    from m2wr_sim.geometry import Vector
    from m2wr_sim.physics.contacts import Contact
    from m2wr_sim.physics.engine import EngineSettings
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.ode_world import Names
    from m2wr_sim.physics.parts import ModelParts, Shape

    _Pair = Tuple[PairSurface, Shape, Shape, Names]


class PyodeEngine(OdeWorld):
    """See :class:`~m2wr_sim.physics.engine.Engine`."""

    def __init__(self, settings: EngineSettings) -> None:
        self._contact_group = ode.JointGroup()
        self._pairs: Dict[Tuple[Geom, Geom], Optional[_Pair]] = {}
        self._pairs_now: Dict[Names, Tuple[Vector, float]] = {}         # in contact in this step: position, depth
        # contacts of watched geoms in this step, with their geoms
        self._felt: List[Tuple[Grip, Geom, Geom, Contact]] = []
        self._grips: List[Grip] = []                                    # all contacts of this step
        self._contact_geoms: List[Tuple[Geom, Geom]] = []               # their geoms
        self._coupled = False                                           # whether one of them is coupled
        self._rolling: Dict[str, Tuple[Grip, str]] = {}     # contact of each wheel in this step, with the other shape
        super().__init__(settings)

    def _release(self, parts: ModelParts) -> None:
        self._contact_group.empty()
        self._contact_geoms = []
        gone = set(parts.geoms)
        self._pairs = {pair: value for pair, value in self._pairs.items() if gone.isdisjoint(pair)}
        names = tuple(link.name + "::" for link in parts.links)
        for pair in [pair for pair in self._pairs_now if any(side.startswith(names) for side in pair)]:
            del self._pairs_now[pair]
        super()._release(parts)

    def configure(self, settings: EngineSettings) -> None:
        super().configure(settings)
        self._pairs = {}                # contact parameters depend on the step size and the limits

    def let_slip(self, link: int, axis: Sequence[float]) -> None:
        super().let_slip(link, axis)
        self._pairs = {}

    def forget(self) -> None:
        self._pairs_now = {}
        super().forget()

    def close(self) -> None:
        super().close()
        self._contact_group = None

    # ---- stepping -----------------------------------------------------------------------------------------------

    def step(self, count: int) -> None:
        left = self._take_steps(count)
        if left is not None:
            raise self._lost(left)

    def _take_steps(self, count: int) -> Optional[int]:
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
            self._grips, self._contact_geoms, self._rolling, self._coupled = [], [], {}, False
            for parts in moving:
                ode.collide2(parts.space, static, None, near)
                if parts.self_colliding:
                    parts.space.collide(None, self._near_itself)
            if len(moving) > 1:
                self._moving_space.collide(None, near)
            if self._idlers:
                count_down(self._idlers, self._dt)
            iterative = self._solve(world)
            for wheel, (grip, other) in self._rolling.items():
                self._loads[wheel] = self._steps, other, grip.normal_force()
            if self._felt:
                self._hand_out_contacts()
            for grip, _ in self._rolling.values():
                grip.joint.setFeedback(False)    # else the binding does it after the joint is freed, and aborts
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

    def _solve(self, world: ode.World) -> bool:
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

    # ---- contacts -----------------------------------------------------------------------------------------------

    def _near_itself(self, _: object, first: Geom, second: Geom) -> None:
        """Make contacts inside a model: only between two links with self_collide that share no joint."""
        one, two = self._shapes[first], self._shapes[second]
        if one.link == two.link or ode.areConnected(one.body, two.body):
            return
        links = {link.name: link.spec.self_collide for link in self._links.values()}
        if links.get(one.link) and links.get(two.link):
            self._near(None, first, second)

    def _near(self, _: object, first: Geom, second: Geom) -> None:
        """Make the contacts of two geoms, or of those in two spaces."""
        if first.isSpace() or second.isSpace():
            ode.collide2(first, second, None, self._near)
            return
        try:
            pair = self._pairs[first, second]
        except KeyError:
            pair = self._make_pair(first, second)
        if pair is None:
            return
        described = height_contacts.find(first, second, pair[1], pair[2])
        if described is None:
            described = mesh_pairs.find(first, second, pair[1], pair[2])
        found = ode.collide(first, second) if described is None else [
            _contact(each, first, second) for each in described]
        found = [contact for contact in found if has_direction(contact.getContactGeomParams()[1])]
        if found:
            self._make_contacts(pair, first, second, found)

    def _make_pair(self, first: Geom, second: Geom) -> Optional[_Pair]:
        one, two = self._shapes[first], self._shapes[second]
        surface = None
        if one.yields or two.yields:
            surface = pair_surface(one.collision, two.collision, one.wheel, two.wheel, one.moves and two.moves,
                                   self.settings, min(one.stiffer, two.stiffer), one.skids or two.skids,
                                   one.slip is not None or two.slip is not None)
        # ODE may exchange the two geoms of a pair as they move; it stays the same contact
        names = (min(one.name, two.name), max(one.name, two.name))
        pair = None if surface is None else (surface, one, two, names)
        self._pairs[first, second] = pair
        return pair

    def _make_contacts(self, pair: _Pair, first: Geom, second: Geom, found: List[ode.Contact]) -> None:
        surface, one, two, names = pair[0], pair[1].body, pair[2].body, pair[3]
        watched = self._watched and not self._watched.isdisjoint(names)
        if len(found) > 1 and (surface.merge or len(found) > surface.max_contacts):
            described = [contact.getContactGeomParams()[:3] for contact in found]
            kept = reduced(described, surface)
            for contact, (position, normal, depth) in zip(found, kept):
                contact.setContactGeomParams(position, normal, depth, first, second)
            found = found[:len(kept)]
        both_move, restless = one is not None and two is not None, pair[1].restless or pair[2].restless
        if both_move:
            self._islands.join(pair[1].model, pair[2].model, len(found), one.isEnabled() or two.isEnabled())
        else:
            position, normal, depth = found[0].getContactGeomParams()[:3]
            found = self._without_repeated(found, first, second, one is not None)
            if not found and not surface.ground and -STEEP < normal[2] < STEEP:
                self._pairs_now.setdefault(names, (position, depth))
        for number, contact in enumerate(found):
            position, normal, depth = contact.getContactGeomParams()[:3]
            if not surface.ground and (both_move or -STEEP < normal[2] < STEEP):
                self._pairs_now.setdefault(names, (position, depth))
            coupled = restless and (both_move or -FLAT < normal[2] < FLAT)
            self._coupled = self._coupled or coupled
            mode = _set_surface(contact, surface, second if surface.along_second else first)
            slips = _slips(surface, pair[1].slip or (0.0, 0.0), pair[2].slip or (0.0, 0.0), len(found))
            contact.setSlip1(slips[0])
            contact.setSlip2(slips[1])
            if surface.slides:
                self._slide(pair, contact, mode, slips)
            joint = ode.ContactJoint(self._world, self._contact_group, contact)
            joint.attach(one, two)
            model = pair[2].model if one is None else pair[1].model
            grip = Grip(joint, contact, one, two, surface, mode, normal, model, coupled, names + (number,))
            self._grips.append(grip)
            self._contact_geoms.append((first, second))
            wheel, other = (pair[1], pair[2]) if pair[1].wheel else (pair[2], pair[1])
            if surface.slides and wheel.name not in self._rolling:
                self._rolling[wheel.name] = grip, other.name
                joint.setFeedback(True)
            if watched:
                for shape in (pair[1], pair[2]):
                    if shape.body is not None:
                        self._enable(shape)     # a sleeping body is not solved, and has no contact forces
                joint.setFeedback(True)
                self._felt.append((grip, first, second, (position, normal, depth)))

    def _without_repeated(self, found: List[ode.Contact], first: Geom, second: Geom,
                          first_moves: bool) -> List[ode.Contact]:
        """Return the contacts with a static geom that are not contacts with another one in this step already."""
        mover, static = (first, second) if first_moves else (second, first)
        before = []
        for (one, two), grip in zip(self._contact_geoms[-RECENT:], self._grips[-RECENT:]):
            other = two if one is mover else one if two is mover else None
            if other is not None and other is not static and not self._shapes[other].moves:
                position, normal, depth = grip.contact.getContactGeomParams()[:3]
                before.append((position, normal if (one is mover) == first_moves else tuple(-n for n in normal), depth))
        return [contact for contact in found if not any(
            is_repeated(contact.getContactGeomParams()[:3], other) for other in before)]

    def _slide(self, pair: _Pair, contact: ode.Contact, mode: int, least: Tuple[float, float]) -> None:
        """Set the friction of a wheel's contact by its slip and its load in the last step; ``least``: compliances."""
        surface, (wheel, other) = pair[0], (pair[1], pair[2]) if pair[1].wheel else (pair[2], pair[1])
        step, name, load = self._loads.get(wheel.name, (0, "", 0.0))
        if step + 1 == self._steps and name == other.name and wheel.name not in self._rolling:
            position, normal = contact.getContactGeomParams()[:2]
            first = contact.getFDir1() if mode & MODE_FDIR1 else first_direction(normal)
            slips = sliding_slips(slip_velocity(position, pair[1].body, pair[2].body), normal, first, surface.mu,
                                  surface.mu2, load)
            contact.setSlip1(max(least[0], slips[0]))
            contact.setSlip2(max(least[1], slips[1]))

    def _hand_out_contacts(self) -> None:
        """Pass the contacts of this step, with the forces from the solver, to the watches."""
        links = {link.name: link for link in self._links.values()}
        felt, self._felt = self._felt, []
        for grip, first, second, geometry in felt:
            sides = [(shape.name, shape.moves, links[shape.link].pose[0])
                     for shape in (self._shapes[first], self._shapes[second])]
            hand_out(self._watches, self._steps, sides, geometry, grip.joint.getFeedback())
            grip.joint.setFeedback(False)    # else the binding does it after the joint is freed, and aborts

    def _update_contacts(self) -> None:
        for names, (position, depth) in self._pairs_now.items():
            if names not in self._pairs_before:
                self._contact_events.append(ContactEvent(self._steps, names[0], names[1], position, depth))
        self._pairs_before, self._pairs_now = self._pairs_now, {}

    def _unwrap(self) -> None:
        """Count full rotations: take the angle that fits the reading and is nearest to the prediction by the rate."""
        for drive in self._hinges:
            raw = drive.access.position()
            predicted = drive.angle + drive.access.rate() * self._dt
            drive.angle = raw + 2.0 * math.pi * round((predicted - raw) / (2.0 * math.pi))


def _contact(described: Contact, first: Geom, second: Geom) -> ode.Contact:
    """Return a contact of the binding with the given position, normal and depth."""
    contact = ode.Contact()
    contact.setContactGeomParams(*described, first, second)
    return contact


def _slips(surface: PairSurface, one: Tuple[float, float], two: Tuple[float, float], count: int) -> Tuple[float, float]:
    """Return the compliances [m/s/N] of a contact, one of ``count``: those of the surface and of the two shapes."""
    return (surface.slip1 + one[0] + two[0]) * count, (surface.slip2 + one[1] + two[1]) * count


def _set_surface(contact: ode.Contact, surface: PairSurface, rotating: Geom) -> int:
    """Set the surface parameters of a contact, apart from its compliances; return its mode.

    ``rotating`` is the geom with which the direction of mu rotates.
    """
    mode = surface.mode
    if mode & MODE_FDIR1:
        mode = bodies.direct_friction(contact, surface, rotating)
    contact.setMode(mode)
    contact.setMu(surface.mu)
    contact.setMu2(surface.mu2)
    contact.setBounce(surface.bounce)
    contact.setBounceVel(surface.bounce_velocity)
    if surface.soft_cfm:
        contact.setSoftERP(surface.soft_erp)
        contact.setSoftCFM(surface.soft_cfm)
    return mode
