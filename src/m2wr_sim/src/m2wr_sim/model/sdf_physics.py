"""``<physics>`` and ``<state>`` of an SDF world -> Physics, WorldState."""
from dataclasses import replace

from m2wr_sim.model.safe_xml import (child_float, child_int, child_positive, child_text, child_vector, fail, line_of,
                                     parse_int, parse_vector, required_name)
from m2wr_sim.model.sdf_frames import raw_pose
from m2wr_sim.model.types import ModelStateEntry, Physics, WorldState

_PHYSICS_READ = frozenset(("max_step_size", "real_time_update_rate", "gravity", "max_contacts", "ode"))
_PHYSICS_SILENT = frozenset(("real_time_factor", "bullet", "simbody", "dart", "magnetic_field"))
_SOLVER_READ = frozenset(("type", "iters", "precon_iters", "sor"))
_SOLVER_SILENT = frozenset(("min_step_size", "use_dynamic_moi_rescaling", "friction_model", "island_threads",
                            "thread_position_correction"))
_CONSTRAINTS_READ = frozenset(("cfm", "erp", "contact_max_correcting_vel", "contact_surface_layer"))
_SOLVERS = ("quick", "world")


def _profile(world, notes):
    """Return the ``<physics>`` element in force: the one marked default, else the first."""
    profiles = world.findall("physics")
    if not profiles:
        return None
    chosen = next((profile for profile in profiles if (profile.get("default") or "").strip().lower() in ("true", "1")),
                  profiles[0])
    if len(profiles) > 1:
        notes.add("{}: the world has {} physics profiles; this one is used.".format(line_of(chosen), len(profiles)))
    kind = (chosen.get("type") or "ode").strip()
    if kind != "ode":
        notes.add('{}: physics type "{}" is not available; ode is used.'.format(line_of(chosen), kind))
    return chosen


def read_physics(world, notes):
    """Read the physics of a world.

    Parameters
    ----------
    world : lxml element
        The ``<world>``; its own ``<gravity>`` wins over the one inside ``<physics>`` of files up to 1.5.
    notes : Notes

    Returns
    -------
    Physics

    Raises
    ------
    XmlError
        If a number is unusable, e.g. a step size that is not positive.
    """
    element, base = _profile(world, notes), Physics()
    gravity = child_vector(element, "gravity", 3, base.gravity)
    gravity = child_vector(world, "gravity", 3, gravity)
    if element is None:
        return replace(base, gravity=gravity)
    notes.unread(element, _PHYSICS_READ, _PHYSICS_SILENT)
    solver, constraints = element.find("ode/solver"), element.find("ode/constraints")
    if solver is not None:
        notes.unread(solver, _SOLVER_READ, _SOLVER_SILENT)
    if constraints is not None:
        notes.unread(constraints, _CONSTRAINTS_READ)
    step = base.max_step_size if not child_text(element, "max_step_size") else child_positive(element, "max_step_size")
    kind = child_text(solver, "type") or base.solver
    if kind not in _SOLVERS:
        notes.add('{}: solver type "{}" is unknown (expected one of {}); {} is used.'.format(
            line_of(solver.find("type")), kind, ", ".join(_SOLVERS), base.solver))
        kind = base.solver
    return Physics(
        max_step_size=step, gravity=gravity, solver=kind,
        real_time_update_rate=child_float(element, "real_time_update_rate", base.real_time_update_rate),
        max_contacts=child_int(element, "max_contacts", base.max_contacts, 0),
        iters=child_int(solver, "iters", base.iters, 1), precon_iters=child_int(solver, "precon_iters", 0, 0),
        sor=child_float(solver, "sor", base.sor), cfm=child_float(constraints, "cfm", base.cfm),
        erp=child_float(constraints, "erp", base.erp),
        contact_max_correcting_vel=child_float(constraints, "contact_max_correcting_vel",
                                               base.contact_max_correcting_vel),
        contact_surface_layer=child_float(constraints, "contact_surface_layer", base.contact_surface_layer))


def _sim_time_ns(state):
    """Return ``<sim_time>seconds nanoseconds</sim_time>`` as integer nanoseconds."""
    text = child_text(state, "sim_time")
    if not text:
        return 0
    element, words = state.find("sim_time"), text.split()
    if len(words) != 2:
        fail(element, 'sim_time is "{}"'.format(text), "two whole numbers: seconds and nanoseconds")
    seconds, nanoseconds = (parse_int(element, word, "sim_time", 0) for word in words)
    return seconds * 10 ** 9 + nanoseconds


def _link_states(element, prefix=""):
    for link in element.findall("link"):
        pose = None if link.find("pose") is None else raw_pose(link)[0]
        text = child_text(link, "velocity")
        velocity = None
        if text:
            numbers = parse_vector(link.find("velocity"), text, 6, "velocity")
            velocity = (numbers[:3], numbers[3:])
        yield prefix + required_name(link), pose, velocity
    for model in element.findall("model"):
        yield from _link_states(model, prefix + required_name(model) + "::")


def _model_state(element, notes):
    scale = child_vector(element, "scale", 3, (1.0, 1.0, 1.0))
    if any(abs(value - 1.0) > 1e-9 for value in scale):
        notes.add("{}: the scale of a stored state is not applied; sizes are the model's own.".format(
            line_of(element.find("scale"))))
    return ModelStateEntry(name=required_name(element), pose=None if element.find("pose") is None
                           else raw_pose(element)[0], links=tuple(_link_states(element)))


def read_state(world, notes):
    """Read the first ``<state>`` of a world, or return None; later ones have no effect and are noted."""
    states = world.findall("state")
    if not states:
        return None
    if len(states) > 1:
        notes.add("{}: the world has {} states; only the first is used.".format(line_of(states[0]), len(states)))
    state = states[0]
    notes.unread(state, ("sim_time", "model", "insertions", "deletions"), ("wall_time", "real_time", "iterations",
                                                                           "light", "joint"))
    return WorldState(sim_time_ns=_sim_time_ns(state),
                      models=tuple(_model_state(child, notes) for child in state.findall("model")))
