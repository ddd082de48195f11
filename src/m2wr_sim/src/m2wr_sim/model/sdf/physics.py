# SPDX-License-Identifier: BSD-3-Clause
"""``<physics>`` and ``<state>`` of an SDF world -> Physics, WorldState."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Iterator, Optional, Tuple

from m2wr_sim.model.sdf.frames import raw_pose
from m2wr_sim.model.types import ModelStateEntry, Physics, WorldState
from m2wr_sim.model.xml.safe import fail, parse_int, parse_vector

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.sdf.node import Node

_SOLVERS = ("quick", "world")
LATEST = 2 ** 31        # s, of a stored time; a time stamp holds 2^32


def _profile(world: Node) -> Node:
    """Return the active ``<physics>``: the one marked default, else the first; a false Node if there is none."""
    profiles = world.children("physics")
    if not profiles:
        return world.child("physics")
    chosen = next((profile for profile in profiles if profile.attribute("default").lower() in ("true", "1")),
                  profiles[0])
    if len(profiles) > 1:
        world.notes.add("{}: the world has {} physics profiles; this one is used.".format(chosen.line, len(profiles)))
        for profile in profiles:
            if profile is not chosen:
                profile.ignore()
    kind = chosen.attribute("type") or "ode"
    if kind != "ode":
        world.notes.add('{}: physics type "{}" is not available; ode is used.'.format(chosen.line, kind))
    return chosen


def read_physics(world: Node) -> Physics:
    """Read the physics of a world.

    Parameters
    ----------
    world : Node
        The ``<world>``; its own ``<gravity>`` wins over the one inside ``<physics>`` of files up to 1.5.

    Returns
    -------
    Physics
        An invalid number, for instance a step size that is not positive, has its default; a warning is added.
    """
    node, base = _profile(world), Physics()
    solver, constraints = node.child("ode").child("solver"), node.child("ode").child("constraints")
    kind = solver.text("type") or base.solver
    if kind not in _SOLVERS:
        world.notes.add('{}: solver type "{}" is unknown (expected one of {}); {} is used.'.format(
            solver.child("type").line, kind, ", ".join(_SOLVERS), base.solver))
        kind = base.solver
    physics = Physics(
        max_step_size=node.positive("max_step_size", base.max_step_size), solver=kind,
        gravity=world.vector("gravity", 3, node.vector("gravity", 3, base.gravity)),
        real_time_update_rate=node.number("real_time_update_rate", base.real_time_update_rate),
        max_contacts=node.whole("max_contacts", base.max_contacts, 0),
        iters=solver.whole("iters", base.iters, 1), precon_iters=solver.whole("precon_iters", 0, 0),
        sor=solver.number("sor", base.sor), cfm=constraints.number("cfm", base.cfm),
        erp=constraints.number("erp", base.erp),
        contact_max_correcting_vel=constraints.number("contact_max_correcting_vel", base.contact_max_correcting_vel),
        contact_surface_layer=constraints.number("contact_surface_layer", base.contact_surface_layer))
    node.done()
    return physics


def _sim_time_ns(element: Any, text: str, what: str) -> int:
    """Return ``<sim_time>seconds nanoseconds</sim_time>`` as integer nanoseconds."""
    words = text.split()
    if len(words) != 2:
        fail(element, '{} is "{}"'.format(what, text), "two whole numbers: seconds and nanoseconds")
    seconds, nanoseconds = (parse_int(element, word, what, 0) for word in words)
    total = seconds * 10 ** 9 + nanoseconds
    if total > LATEST * 10 ** 9:
        fail(element, '{} is "{}"'.format(what, text), "at most {} s: later stamps cannot be sent".format(LATEST))
    return total


def _velocity(element: Any, text: str, what: str) -> Tuple[Vector, Vector]:
    x, y, z, roll, pitch, yaw = parse_vector(element, text, 6, what)
    return (x, y, z), (roll, pitch, yaw)


def _link_states(node: Node, prefix: str = "") -> Iterator[Tuple[str, Optional[Pose], Optional[Tuple[Vector, Vector]]]]:
    for link in node.children("link"):
        name = node.notes.attempt("this stored state", link.name)
        if name is not None:
            yield (prefix + name, raw_pose(link)[0] if link.has("pose") else None,
                   link.value("velocity", None, _velocity))
    for model in node.children("model"):
        name = node.notes.attempt("this stored state", model.name)
        if name is not None:
            raw_pose(model), model.text("scale")        # its links' poses are all given in the world
            yield from _link_states(model, prefix + name + "::")


def _model_state(node: Node) -> ModelStateEntry:
    scale = node.vector("scale", 3, (1.0, 1.0, 1.0))
    if any(abs(value - 1.0) > 1e-9 for value in scale):
        node.notes.add("{}: the scale of a stored state is not applied; sizes are the model's own.".format(
            node.child("scale").line))
    return ModelStateEntry(name=node.name(), pose=raw_pose(node)[0] if node.has("pose") else None,
                           links=tuple(_link_states(node)))


def read_state(world: Node) -> Optional[WorldState]:
    """Read the first ``<state>`` of a world; return None if there is none. Later ones are ignored with a warning."""
    states = world.children("state")
    if not states:
        return None
    if len(states) > 1:
        world.notes.add("{}: the world has {} states; only the first is used.".format(states[0].line, len(states)))
        for other in states[1:]:
            other.ignore()
    state = states[0]
    entries = [world.notes.attempt("this stored state", _model_state, child) for child in state.children("model")]
    return WorldState(sim_time_ns=state.value("sim_time", 0, _sim_time_ns),
                      models=tuple(entry for entry in entries if entry is not None))
