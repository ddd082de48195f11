# SPDX-License-Identifier: BSD-3-Clause
"""The ``<gazebo>`` blocks of a URDF -> surfaces, sensors, plugins and switches.

A value is an element's text or its ``value`` attribute.  A block with ``reference`` belongs to that link or
joint, one without to the model.
"""
from __future__ import annotations

from dataclasses import replace
from typing import (
    TYPE_CHECKING,
    AbstractSet,
    Any,
    Callable,
    Collection,
    Dict,
    Iterable,
    List,
    Optional,
    Sequence,
    Tuple,
    TypeVar,
)

from m2wr_sim.geometry import compose
from m2wr_sim.model.plugin_spec import read_plugin, tag_value
from m2wr_sim.model.sdf.node import Node, shown
from m2wr_sim.model.sdf.sensor import read_sensor
from m2wr_sim.model.sdf.shapes import read_surface
from m2wr_sim.model.urdf.checks import some_names
from m2wr_sim.model.urdf.lumping import LUMP_MARK
from m2wr_sim.model.xml.safe import XmlError, fail, line_of, parse_float, parse_int, parse_vector, shorten

_Value = TypeVar("_Value")
if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.notes import Notes
    from m2wr_sim.model.types import Axis, Collision, PluginSpec, Sensor, Visual

    #: Link -> its place in the order, elements for collisions, last ``<material>`` or None.
    Tagged = Dict[str, Tuple[int, List[Any], Any]]

_MOST_PLACES = 10       # of a mark in a name; names that are made here have one
_SURFACE_TAGS = {"mu1": "mu", "mu2": "mu2", "kp": "kp", "kd": "kd", "minDepth": "min_depth", "maxVel": "max_vel"}
_COLLISION_TAGS = frozenset(_SURFACE_TAGS) | {"fdir1", "maxContacts", "laserRetro"}
_LINK_TAGS = frozenset(("turnGravityOff", "dampingFactor", "selfCollide", "gravity", "self_collide", "kinematic",
                        "velocity_decay"))
_LINK_BLOBS = frozenset(("sensor", "collision", "material"))
_LINK_QUIET = frozenset(("canonicalBody", "visual", "light", "projector", "audio_sink", "audio_source", "enable_wind"))
_AXIS_TAGS = {"stopErp": "stop_erp", "stopCfm": "stop_cfm", "springStiffness": "spring_stiffness",
              "springReference": "spring_reference", "fudgeFactor": "fudge_factor"}
_JOINT_TAGS = frozenset(_AXIS_TAGS) | {"disableFixedJointLumping", "preserveFixedJoint"}
_JOINT_QUIET = frozenset(("provideFeedback", "cfmDamping", "implicitSpringDamper"))
_MODEL_TAGS = frozenset(("static", "plugin", "self_collide", "allow_auto_disable"))
_MODEL_QUIET = frozenset(("enable_wind", "canonicalBody"))
_INSTEAD = {
    "mu": "<mu1> and <mu2> are read", "plugin": "a plugin is read inside a <sensor>, or in a <gazebo> block without "
    "reference", "pose": "the joint's <origin> places a link", "inertial": "the URDF link's <inertial> is read",
    "surface": "<mu1>, <mu2>, <kp>, ... are read directly in the <gazebo> block",
    "friction": "<mu1> and <mu2> are read",
    "slip1": "<surface> in the link's <collision> is read", "slip2": "<surface> in the link's <collision> is read",
    "torque": "<wheelTorque> of the drive plugin is read",
}


def tag_float(element: Any) -> float:
    """Return the number in an extension tag."""
    return parse_float(element, tag_value(element), element.tag)


def tag_bool(element: Any) -> bool:
    """Return the truth value in an extension tag: true, yes, 1 or false, no, 0."""
    word = tag_value(element).lower()
    if word not in ("true", "yes", "1", "false", "no", "0"):
        fail(element, '{} is "{}"'.format(element.tag, shorten(word)), "true or false")
    return word in ("true", "yes", "1")


class GazeboTags:
    """All ``<gazebo>`` blocks of one robot, with access by link and joint.

    Parameters
    ----------
    root : lxml element
        The ``<robot>``.
    links, joints : containers of str
        Names that a ``reference`` may have.
    notes : Notes
        Gets warnings about unknown references and unsupported tags.
    """

    def __init__(self, root: Any, links: Collection[str], joints: Collection[str], notes: Notes) -> None:
        self._notes = notes
        self._links: Dict[str, List[Any]] = {}
        self._joints: Dict[str, List[Any]] = {}
        self._model: List[Any] = []
        for block in root.findall("gazebo"):
            reference = (block.get("reference") or "").strip()
            if not reference:
                self._model.extend(block)
            elif reference in links or reference in joints:
                if reference in links:
                    self._links.setdefault(reference, []).extend(block)
                if reference in joints:
                    self._joints.setdefault(reference, []).extend(block)
            else:
                notes.add('{}: <gazebo reference="{}"> names no link or joint of the robot and has no effect (links: '
                          '{}; joints: {}).'.format(line_of(block), reference, some_names(sorted(links)),
                                                    some_names(sorted(joints)) or "none"))
        self._note_unread()

    def _note_unread(self) -> None:
        both = set(self._links) & set(self._joints)
        for name, elements in self._links.items():
            joint_tags, joint_quiet = (_JOINT_TAGS, _JOINT_QUIET) if name in both else (frozenset(), frozenset())
            self._unread(elements, _COLLISION_TAGS | _LINK_TAGS | _LINK_BLOBS | joint_tags, _LINK_QUIET | joint_quiet,
                         'link "{}"'.format(name))
        for name, elements in self._joints.items():
            if name not in both:
                self._unread(elements, _JOINT_TAGS, _JOINT_QUIET, 'joint "{}"'.format(name))
        self._unread(self._model, _MODEL_TAGS, _MODEL_QUIET, "the model")

    def _unread(self, elements: Iterable[Any], known: AbstractSet[str], quiet: AbstractSet[str], owner: str) -> None:
        for element in elements:
            if element.tag in known:
                continue
            if element.tag in quiet:
                self._notes.remark(element, "a <gazebo> block")
                continue
            instead = _INSTEAD.get(element.tag)
            self._notes.add("{}: unsupported element <{}> in a <gazebo> block of {} ignored{}.".format(
                line_of(element), element.tag, owner, "; " + instead if instead else ""),
                ("gazebo", element.tag, owner.split(" ")[0]))

    def _value(self, element: Any, parse: Callable[[Any], _Value], default: _Value) -> _Value:
        """Return ``parse(element)``; for an invalid value log a warning and return the default."""
        try:
            return parse(element)
        except XmlError as error:
            self._notes.add("{}; using {}.".format(error, shown(default)))
            return default

    def _last(self, elements: Iterable[Any], tag: str) -> Any:
        """Return the last element of a tag (later blocks win), or None."""
        found = [element for element in elements if element.tag == tag]
        return found[-1] if found else None

    # -- the model ----------------------------------------------------------------------------------------------

    def model_switch(self, tag: str, default: bool) -> bool:
        """Return a model-level truth value such as ``static``.

        Parameters
        ----------
        tag : str
        default : bool
            Default if the tag is missing or invalid.

        Returns
        -------
        bool
        """
        element = self._last(self._model, tag)
        return default if element is None else self._value(element, tag_bool, default)

    def model_plugins(self) -> Tuple[PluginSpec, ...]:
        """Return the plugins of the model, in document order; those that cannot be read are left out with a warning."""
        found = (self._notes.attempt("this plugin", read_plugin, element, None, self._notes)
                 for element in self._model if element.tag == "plugin")
        return tuple(plugin for plugin in found if plugin is not None)

    # -- joints -------------------------------------------------------------------------------------------------

    def joint_switch(self, joint: str, tag: str) -> bool:
        """Return a joint-level truth value; False if it is missing.

        Parameters
        ----------
        joint : str
        tag : str

        Returns
        -------
        bool
        """
        element = self._last(self._joints.get(joint, ()), tag)
        return False if element is None else self._value(element, tag_bool, False)

    def joint_axis(self, joint: str, axis: Axis) -> Axis:
        """Return an Axis with the stops and springs of the joint's tags.

        Parameters
        ----------
        joint : str
        axis : m2wr_sim.model.types.Axis
            Without these tags.

        Returns
        -------
        m2wr_sim.model.types.Axis
        """
        elements = self._joints.get(joint, ())
        for tag, name in _AXIS_TAGS.items():
            element = self._last(elements, tag)
            if element is not None:
                axis = replace(axis, **{name: self._value(element, tag_float, getattr(axis, name))})
        return axis

    # -- links --------------------------------------------------------------------------------------------------

    def tagged(self, sources: Sequence[str]) -> Tagged:
        """Return which tags may reach the collisions and visuals of a link, for :meth:`collision` and :meth:`material`.

        Parameters
        ----------
        sources : sequence of str
            The link and those lumped into it, in the order in which their tags are applied (later ones win).

        Returns
        -------
        dict
            Name of a link -> (its index in that order, elements for collisions, last ``<material>`` or None).
        """
        found: Tagged = {}
        for index, source in enumerate(sources):
            elements = self._links.get(source, ())
            mine = [element for element in elements if element.tag in _COLLISION_TAGS or element.tag == "collision"]
            material = self._last(elements, "material")
            if mine or material is not None:
                found[source] = index, mine, material
        return found

    def collision(self, collision: Collision, origin: str, carrier: str, tagged: Tagged) -> Collision:
        """Return a Collision with the tags that reach it.

        Parameters
        ----------
        collision : Collision
            With its final name.
        origin : str
            Link of the URDF that holds the collision.
        carrier : str
            Link that carries it now.
        tagged : dict
            Of the carrier; see :meth:`tagged`.

        Notes
        -----
        As in Gazebo a tag reaches a collision through the name alone: the carrier's own tags those without a lump
        prefix, a lumped link's tags those whose name contains that link.
        """
        reaching = _reaching(collision.name, carrier, tagged)
        for source in reaching:
            for element in tagged[source][1]:
                collision = self._apply(collision, element)
        if origin in tagged and tagged[origin][1] and origin not in reaching:
            element = tagged[origin][1][0]
            self._notes.add('{}: <{}> for link "{}" does not reach the collision "{}": only a collision without '
                            'name, or whose name begins with "{}", receives it.'.format(
                                line_of(element), element.tag, origin, collision.name, origin))
        return collision

    def _apply(self, collision: Collision, element: Any) -> Collision:
        tag = element.tag
        if tag == "maxContacts":
            return replace(collision, max_contacts=self._value(
                element, lambda given: parse_int(given, tag_value(given), tag, 0), collision.max_contacts))
        if tag == "laserRetro":
            return replace(collision, laser_retro=self._value(element, tag_float, collision.laser_retro))
        if tag == "collision":
            node = Node(element, self._notes, "collision")
            surface = read_surface(node.child("surface"), collision.surface)
            collision = replace(collision, surface=surface,
                                max_contacts=node.whole("max_contacts", collision.max_contacts, 0),
                                laser_retro=node.number("laser_retro", collision.laser_retro))
            node.attribute("name")
            node.done()
            return collision
        name = "fdir1" if tag == "fdir1" else _SURFACE_TAGS[tag]
        parse = (lambda given: parse_vector(given, tag_value(given), 3, tag)) if tag == "fdir1" else tag_float
        value = self._value(element, parse, getattr(collision.surface, name))
        return replace(collision, surface=replace(collision.surface, **{name: value}))

    def material(self, visual: Visual, carrier: str, tagged: Tagged) -> Optional[str]:
        """Return the Gazebo material name that reaches a Visual, or None; the rule is that of collisions.

        Parameters
        ----------
        visual : Visual
            With its final name.
        carrier : str
            Link that carries it now.
        tagged : dict
            Of the carrier; see :meth:`tagged`.

        Returns
        -------
        str or None
        """
        found = None
        for source in _reaching(visual.name, carrier, tagged, "_visual"):
            if tagged[source][2] is not None:
                found = tag_value(tagged[source][2]) or None
        return found

    def link_values(self, sources: Sequence[str]) -> Dict[str, Any]:
        """Return the keyword arguments of Link that the tags of these links set; later ones win."""
        values: Dict[str, Any] = {}

        def take(name: str, element: Any, parse: Callable[[Any], _Value], default: _Value) -> None:
            values[name] = self._value(element, parse, values.get(name, default))

        for element in (element for source in sources for element in self._links.get(source, ())):
            if element.tag == "turnGravityOff":
                take("gravity", element, lambda given: not tag_bool(given), True)
            elif element.tag in ("gravity", "kinematic"):
                take(element.tag, element, tag_bool, element.tag == "gravity")
            elif element.tag in ("selfCollide", "self_collide"):
                take("self_collide", element, tag_bool, False)
            elif element.tag == "dampingFactor":
                take("linear_damping", element, tag_float, 0.0)
                take("angular_damping", element, tag_float, 0.0)
            elif element.tag == "velocity_decay":
                for child, name in (("linear", "linear_damping"), ("angular", "angular_damping")):
                    if element.find(child) is not None:
                        take(name, element.find(child), tag_float, 0.0)
        return values

    def sensors(self, carrier: str, lumped: Sequence[Tuple[str, Pose]]) -> Tuple[Sensor, ...]:
        """Return the Sensors on a link.

        Parameters
        ----------
        carrier : str
        lumped : sequence of (str, Pose)
            Links lumped into the carrier, with the poses of their frames in it; their sensors move to the carrier.

        Notes
        -----
        The pose is the lumped frame's pose times the sensor's own; one given with ``relative_to`` stays as it is.
        """
        found = []
        everywhere: List[Tuple[str, Optional[Pose]]] = [(carrier, None), *lumped]
        for source, carrier_from_source in everywhere:
            for element in self._links.get(source, ()):
                if element.tag != "sensor":
                    continue
                sensor = self._notes.attempt("this sensor", read_sensor, Node(element, self._notes), carrier)
                if sensor is None:
                    continue
                pose = element.find("pose")
                relative = None if pose is None else pose.get("relative_to") or pose.get("frame")
                if relative:
                    self._notes.add('{}: the sensor\'s pose is relative to "{}"; using the frame of link '
                                    '"{}".'.format(line_of(pose), relative, carrier))
                elif carrier_from_source is not None:
                    sensor = replace(sensor, pose=compose(carrier_from_source, sensor.pose))
                found.append(sensor)
        return tuple(found)


def _reaching(name: str, carrier: str, tagged: Tagged, kind: str = "_collision") -> List[str]:
    """Return the links of ``tagged`` whose tags reach a collision or visual, in the order in which they are applied.

    The links are found from the name instead of trying all, because a document may have thousands of both.
    """
    if LUMP_MARK not in name:
        return [carrier] if carrier in tagged else []
    starts, ends = _places(name, LUMP_MARK), _places(name, kind)
    named = {name[start + len(LUMP_MARK):end] for start in starts for end in ends if end >= start + len(LUMP_MARK)}
    return sorted((source for source in named if source in tagged and source != carrier),
                  key=lambda source: tagged[source][0])


def _places(name: str, part: str) -> List[int]:
    """Return the indices at which a part of a name begins; of many only the first ones."""
    places: List[int] = []
    at = name.find(part)
    while at >= 0 and len(places) < _MOST_PLACES:
        places.append(at)
        at = name.find(part, at + 1)
    return places
