"""Poses that are given relative to other elements of a model or world (``relative_to``), brought to one frame."""
from m2wr_sim.geometry import IDENTITY, compose, invert
from m2wr_sim.model.safe_xml import fail, line_of, parse_pose


def raw_pose(element):
    """Return an element's own ``<pose>`` and the name it is relative to.

    Returns
    -------
    pose : Pose
        Identity where there is no ``<pose>``.
    relative_to : str or None
        From ``relative_to``, or from ``frame`` of older files; empty text counts as not given.
    """
    child = element.find("pose")
    if child is None:
        return IDENTITY, None
    relative_to = (child.get("relative_to") or child.get("frame") or "").strip()
    return parse_pose(child, child.text or ""), relative_to or None


class Frames:
    """The named frames of one model (or world), each given relative to another one.

    Parameters
    ----------
    notes : Notes
        Receives the names that do not exist here.
    roots : tuple of str
        Names of the frame that everything is resolved to.
    """

    def __init__(self, notes, roots=("__model__",)):
        self._notes = notes
        self._roots = roots
        self._given = {}
        self._resolved = {}

    def add(self, name, pose, relative_to, element):
        """Name a frame: its pose and what that is relative to (None: the root frame).  The first of a name wins."""
        self._given.setdefault(name, (pose, relative_to, element))

    def resolve(self, name, element=None, asking=()):
        """Return the pose of a named frame in the root frame.

        A name that does not exist is noted and stands for the root frame; frames relative to each other in a ring
        raise XmlError.
        """
        if name is None or name in self._roots:
            return IDENTITY
        if name not in self._given:
            if element is not None:
                self._notes.add('{}: the pose is relative to "{}", which is no frame there (has {}); the enclosing '
                                'model is taken.'.format(line_of(element), name,
                                                         ", ".join(sorted(self._given)) or "none"))
            return IDENTITY
        if name not in self._resolved:
            pose, relative_to, given_at = self._given[name]
            if name in asking:
                fail(given_at, "poses relative to each other form a ring ({})".format(" -> ".join(asking + (name,))),
                     "frames that end at the model")
            self._resolved[name] = compose(self.resolve(relative_to, given_at, asking + (name,)), pose)
        return self._resolved[name]

    def pose_in(self, element, carrier):
        """Return an element's pose in the frame ``carrier``, to which it is relative unless it says otherwise."""
        pose, relative_to = raw_pose(element)
        if relative_to is None or relative_to == carrier:
            return pose
        return compose(invert(self.resolve(carrier)), compose(self.resolve(relative_to, element), pose))
