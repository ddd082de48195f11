"""The ``<gazebo>`` blocks of a URDF -> surfaces, sensors, plugins and switches.

Values stand in an element's text or in its ``value`` attribute.  A block with ``reference`` belongs to that link or
joint, one without to the model.
"""
from dataclasses import replace

from m2wr_sim.geometry import compose
from m2wr_sim.model.plugin_spec import read_plugin, tag_value
from m2wr_sim.model.safe_xml import fail, line_of, parse_float, parse_int, parse_vector, shorten
from m2wr_sim.model.sdf_sensor import read_sensor
from m2wr_sim.model.sdf_shapes import read_surface

_SURFACE_TAGS = {"mu1": "mu", "mu2": "mu2", "kp": "kp", "kd": "kd", "minDepth": "min_depth", "maxVel": "max_vel"}
_COLLISION_TAGS = frozenset(_SURFACE_TAGS) | {"fdir1", "maxContacts", "laserRetro"}
_LINK_TAGS = frozenset(("turnGravityOff", "dampingFactor", "selfCollide", "gravity", "self_collide", "kinematic",
                        "velocity_decay"))
_LINK_BLOBS = frozenset(("sensor", "collision", "material"))
_LINK_SILENT = frozenset(("canonicalBody", "visual", "light", "projector", "audio_sink", "enable_wind"))
_AXIS_TAGS = {"stopErp": "stop_erp", "stopCfm": "stop_cfm", "springStiffness": "spring_stiffness",
              "springReference": "spring_reference"}
_JOINT_TAGS = frozenset(_AXIS_TAGS) | {"disableFixedJointLumping", "preserveFixedJoint"}
_JOINT_SILENT = frozenset(("provideFeedback", "cfmDamping", "implicitSpringDamper"))
_MODEL_TAGS = frozenset(("static", "plugin", "self_collide", "allow_auto_disable"))
_INSTEAD = {
    "mu": "<mu1> and <mu2> are read", "plugin": "a plugin is read inside a <sensor>, or in a <gazebo> block without "
    "reference", "pose": "the joint's <origin> places a link", "inertial": "the URDF link's <inertial> is read",
    "surface": "<mu1>, <mu2>, <kp>, ... are read directly in the <gazebo> block",
    "friction": "<mu1> and <mu2> are read",
    "slip1": "<surface> in the link's <collision> is read", "slip2": "<surface> in the link's <collision> is read",
    "torque": "<wheelTorque> of the drive plugin is read",
}


def tag_float(element):
    """Return the number an extension tag holds."""
    return parse_float(element, tag_value(element), element.tag)


def tag_bool(element):
    """Return the truth value an extension tag holds: true, yes, 1 or false, no, 0."""
    word = tag_value(element).lower()
    if word not in ("true", "yes", "1", "false", "no", "0"):
        fail(element, '{} is "{}"'.format(element.tag, shorten(word)), "true or false")
    return word in ("true", "yes", "1")


class GazeboTags:
    """All ``<gazebo>`` blocks of one robot, ready to be asked link by link.

    Parameters
    ----------
    root : lxml element
        The ``<robot>``.
    links, joints : containers of str
        Names that a ``reference`` may have.
    notes : Notes
        Receives references that name nothing, and tags that nobody reads.
    """

    def __init__(self, root, links, joints, notes):
        self._notes = notes
        self._links, self._joints, self._model = {}, {}, []
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
                          '{}; joints: {}).'.format(line_of(block), reference, ", ".join(sorted(links)),
                                                    ", ".join(sorted(joints)) or "none"))
        self._note_unread(joints)

    def _note_unread(self, joints):
        both = set(self._links) & set(self._joints)
        for name, elements in self._links.items():
            known = _COLLISION_TAGS | _LINK_TAGS | _LINK_BLOBS | _LINK_SILENT
            self._unread(elements, known | (_JOINT_TAGS | _JOINT_SILENT if name in both else frozenset()),
                         'link "{}"'.format(name))
        for name, elements in self._joints.items():
            if name not in both:
                self._unread(elements, _JOINT_TAGS | _JOINT_SILENT, 'joint "{}"'.format(name))
        self._unread(self._model, _MODEL_TAGS | {"enable_wind"}, "the model")

    def _unread(self, elements, known, owner):
        for element in elements:
            if element.tag not in known:
                instead = _INSTEAD.get(element.tag)
                self._notes.add("{}: <{}> in a <gazebo> block of {} is not read{}.".format(
                    line_of(element), element.tag, owner, "; " + instead if instead else ""),
                    ("gazebo", element.tag, owner.split(" ")[0]))

    def _last(self, elements, tag):
        """Return the last element of a tag (later blocks win), or None."""
        found = [element for element in elements if element.tag == tag]
        return found[-1] if found else None

    # -- the model ----------------------------------------------------------------------------------------------

    def model_switch(self, tag, default):
        """Return a model-level truth value such as ``static``."""
        element = self._last(self._model, tag)
        return default if element is None else tag_bool(element)

    def model_plugins(self):
        """Return the PluginSpecs of the model, in document order."""
        return tuple(read_plugin(element) for element in self._model if element.tag == "plugin")

    # -- joints -------------------------------------------------------------------------------------------------

    def joint_switch(self, joint, tag):
        """Return a joint-level truth value, False where it is not given."""
        element = self._last(self._joints.get(joint, ()), tag)
        return False if element is None else tag_bool(element)

    def joint_axis(self, joint, axis):
        """Return an Axis with what the joint's tags tell of stops and springs put in."""
        elements = self._joints.get(joint, ())
        for tag, name in _AXIS_TAGS.items():
            element = self._last(elements, tag)
            if element is not None:
                axis = replace(axis, **{name: tag_float(element)})
        return axis

    # -- links --------------------------------------------------------------------------------------------------

    def collision(self, collision, origin, carrier, sources):
        """Return a Collision with the tags that reach it.

        Parameters
        ----------
        collision : Collision
            With its final name.
        origin : str
            Link of the URDF that the collision stands in.
        carrier : str
            Link that carries it now.
        sources : sequence of str
            The carrier and the links lumped into it, in the order in which their tags count (later ones win).

        Notes
        -----
        As in Gazebo a tag reaches a collision through the name alone: the carrier's own tags those without a lump
        prefix, a lumped link's tags those whose name tells that link.
        """
        for source in sources:
            elements = [element for element in self._links.get(source, ())
                        if element.tag in _COLLISION_TAGS or element.tag == "collision"]
            if not elements:
                continue
            if _reaches(collision.name, source, carrier):
                for element in elements:
                    collision = self._apply(collision, element)
            elif source == origin:
                self._notes.add('{}: <{}> for link "{}" does not reach the collision "{}": only a collision without '
                                'name, or whose name begins with "{}", receives it.'.format(
                                    line_of(elements[0]), elements[0].tag, source, collision.name, source))
        return collision

    def _apply(self, collision, element):
        tag = element.tag
        if tag == "maxContacts":
            return replace(collision, max_contacts=parse_int(element, tag_value(element), tag, 0))
        if tag == "laserRetro":
            return replace(collision, laser_retro=tag_float(element))
        if tag == "collision":
            self._notes.unread(element, ("surface", "max_contacts", "laser_retro"))
            surface = read_surface(element.find("surface"), self._notes, collision.surface)
            return replace(collision, surface=surface)
        if tag == "fdir1":
            surface = replace(collision.surface, fdir1=parse_vector(element, tag_value(element), 3, tag))
        else:
            surface = replace(collision.surface, **{_SURFACE_TAGS[tag]: tag_float(element)})
        return replace(collision, surface=surface)

    def material(self, visual, carrier, sources):
        """Return the Gazebo material name that reaches a Visual, or None; the rule is that of collisions."""
        found = None
        for source in sources:
            element = self._last(self._links.get(source, ()), "material")
            if element is not None and _reaches(visual.name, source, carrier, "_visual"):
                found = tag_value(element) or None
        return found

    def link_values(self, sources):
        """Return the keyword arguments of Link that the tags of these links set; later ones win."""
        values = {}
        for element in (element for source in sources for element in self._links.get(source, ())):
            if element.tag == "turnGravityOff":
                values["gravity"] = not tag_bool(element)
            elif element.tag in ("gravity", "kinematic"):
                values[element.tag] = tag_bool(element)
            elif element.tag in ("selfCollide", "self_collide"):
                values["self_collide"] = tag_bool(element)
            elif element.tag == "dampingFactor":
                values["linear_damping"] = values["angular_damping"] = tag_float(element)
            elif element.tag == "velocity_decay":
                for child, name in (("linear", "linear_damping"), ("angular", "angular_damping")):
                    if element.find(child) is not None:
                        values[name] = tag_float(element.find(child))
        return values

    def sensors(self, carrier, lumped):
        """Return the Sensors on a link.

        Parameters
        ----------
        carrier : str
        lumped : sequence of (str, Pose)
            Links lumped into the carrier with their frames' poses in it; the sensors of those are moved along.

        Notes
        -----
        The pose is the lumped frame's pose times the sensor's own; one given with ``relative_to`` stays as it is.
        """
        found = []
        for source, carrier_from_source in [(carrier, None)] + list(lumped):
            for element in self._links.get(source, ()):
                if element.tag != "sensor":
                    continue
                sensor = read_sensor(element, carrier, self._notes)
                pose = element.find("pose")
                relative = None if pose is None else pose.get("relative_to") or pose.get("frame")
                if relative:
                    self._notes.add('{}: the sensor\'s pose is relative to "{}"; it is taken in the frame of link '
                                    '"{}".'.format(line_of(pose), relative, carrier))
                elif carrier_from_source is not None:
                    sensor = replace(sensor, pose=compose(carrier_from_source, sensor.pose))
                found.append(sensor)
        return tuple(found)


def _reaches(name, source, carrier, kind="_collision"):
    mark = "_fixed_joint_lump__"
    return mark not in name if source == carrier else mark + source + kind in name
