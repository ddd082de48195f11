# SPDX-License-Identifier: BSD-3-Clause
"""spawn_urdf_model and spawn_sdf_model: from the text in a request to a model in the world."""
import gc
import logging
import re
import threading
from contextlib import contextmanager
from dataclasses import replace

import rospkg
import rospy

from gazebo_msgs.srv import SpawnModelResponse
from m2wr_sim.api.devices import said_once
from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.errors import ModelError, NotFoundError, SimError
from m2wr_sim.geometry import compose
from m2wr_sim.model.sdf.loader import load_sdf
from m2wr_sim.model.types import Heightmap, Light, Mesh
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.xml.lenient import root_tag, without_comments
from m2wr_sim.physics import native_shapes
from m2wr_sim.ros.convert import all_finite, read_pose
from m2wr_sim.sensors.mesh_tree import tree_of

log = logging.getLogger(__name__)

_UNREADABLE = ("GazeboRosApiPlugin SpawnModel Failure: input model_xml not SDF or URDF, or cannot be converted to "
               "Gazebo compatible format.")
_PACKAGE = re.compile(r"package://([^/\"'<>\s]+)")
_NO_FRAME = ("SpawnModel: reference reference_frame not found, did you forget to scope the link by model name?")


MOST_TEXT = 8 * 1024 * 1024        # characters of a description that comes over a service
MOST_MARKS = 100000                # "<", "=" and "&" in it: tags, attributes, references; some 10 us and 100 bytes each
_LONG_TEXT = 1000000        # characters; such a text makes so many objects that collecting them would stop the loop
_MOST_PARTS = 10000         # links and collisions of a model; putting them into the world takes up to half a second
_MANY_TRIANGLES = 50000     # from here on it is said that a mesh is being prepared

_uncollected = [0]
_uncollected_lock = threading.Lock()


@contextmanager
def _no_collections(wanted):
    """Keep Python's garbage collector from walking over what is being read, again and again, with the loop waiting.

    What is read lives as long as its model, and is put aside from all later collections.
    """
    if not wanted:
        yield
        return
    with _uncollected_lock:
        _uncollected[0] += 1
        gc.disable()
    try:
        yield
    finally:
        with _uncollected_lock:
            _uncollected[0] -= 1
            if not _uncollected[0]:
                gc.freeze()
                gc.enable()


def _check_size(record, name):
    """Raise ModelError for a model whose way into the world would stop time for long."""
    parts = sum(1 + len(link.collisions) for link in getattr(record, "links", ()))
    if parts > _MOST_PARTS:
        raise ModelError("\"%s\" has %d links and collisions; expected at most %d in a model that is spawned (a world "
                         "file may hold more)" % (name, parts, _MOST_PARTS))


def prepare(record):
    """Build what physics and rays need of a model's meshes and heightmaps, beside the simulation.

    Returns
    -------
    list
        To be kept until the model is in the world.
    """
    kept = []
    for link in getattr(record, "links", ()):
        for collision in link.collisions:
            shape = collision.geometry
            if not isinstance(shape, (Mesh, Heightmap)):
                continue
            count = len(shape.triangles) if isinstance(shape, Mesh) else 2 * shape.heights.size
            if count > _MANY_TRIANGLES:
                log.info("preparing %s (%d triangles)", shape.source, count)
            kept.append((native_shapes.prepare(shape), tree_of(shape)))
    return kept


class Spawner:
    """Reads models from requests and puts them into a simulator.

    Parameters
    ----------
    simulator : Simulator
    resolve_model : callable, optional
        From ``NAME`` of a ``model://NAME`` to its folder, or None; for SDF that includes other models.
    urdf_surface : str
        ``honour``: a ``<surface>`` inside a URDF collision counts; ``gazebo``: it does not.
    """

    def __init__(self, simulator, resolve_model=None, urdf_surface="honour"):
        self._simulator, self._resolve_model = simulator, resolve_model
        self._honour_surface = urdf_surface == "honour"
        self._packages = rospkg.RosPack()
        self.in_loop = lambda function: function()      # runs what touches the world, between two steps
        self.convention_set_for = lambda name: None     # what ~wheel_conventions says of a model now, or None
        self._newest = ("", None)       # text and record of the URDF spawned last: many robots are often the same
        self._told = (None, "")         # record of which all has been said, and its wheel convention

    def _package_folder(self, name):
        try:
            return self._packages.get_path(name)
        except rospkg.ResourceNotFound:
            log.error("spawn_urdf_model: package://%s: there is no package \"%s\"; expected one that rospack finds",
                      name, name)
            raise rospy.ServiceException("urdf reference package name does not exist: %s" % name) from None

    def spawn_urdf_model(self, request):
        """Answer spawn_urdf_model; without a ``<robot>``, or with an unknown ``package://``, the call itself fails."""
        refusal = self._size_refusal(request)
        if refusal:
            return SpawnModelResponse(False, refusal)
        if root_tag(request.model_xml) != "robot":
            log.error("spawn_urdf_model: the text for \"%s\" has no <robot> element; expected a URDF",
                      request.model_name)
            raise rospy.ServiceException("SpawnModel: Failure - entity format is invalid.")
        for package in sorted(set(_PACKAGE.findall(without_comments(request.model_xml)))):
            self._package_folder(package)       # also those of visual meshes, which nothing here opens
        return self._spawn(request, lambda: self._urdf_record(request))

    def _urdf_record(self, request):
        text, record = self._newest
        if text != request.model_xml:
            record = load_urdf(request.model_xml, source="URDF of %s" % request.model_name,
                               model_name=request.model_name, resolve_package=self._package_folder,
                               honour_collision_surface=self._honour_surface, resolve_model=self._resolve_model)
        return record

    def spawn_sdf_model(self, request):
        """Answer spawn_sdf_model; a URDF is taken too, as Gazebo does."""
        refusal = self._size_refusal(request)
        if refusal:
            return SpawnModelResponse(False, refusal)
        root = root_tag(request.model_xml)
        if root == "robot":
            return self.spawn_urdf_model(request)
        if root not in ("sdf", "gazebo"):
            reason = "the text begins with %s; expected <sdf> or <robot>" % ("<%s>" % root if root else "no element")
            log.error("spawn of \"%s\": %s", request.model_name, reason)
            return SpawnModelResponse(False, _UNREADABLE)       # to the letter: here Gazebo answers so, too
        return self._spawn(request, lambda: self._only_model(request))

    def _only_model(self, request):
        models, lights = load_sdf(request.model_xml, source="SDF of %s" % request.model_name,
                                  resolve_model=self._resolve_model, most_parts=_MOST_PARTS)
        found = models or lights
        if len(found) != 1:
            raise ModelError("SDF of %s holds %d %s; expected one" % (
                request.model_name, len(found), "models" if models else "lights"))
        return found[0]

    def _put(self, record, pose, request):
        """Put what was read into the world: a model, or a light."""
        pose = compose(pose, record.pose)
        if isinstance(record, Light):
            self._simulator.lights[request.model_name] = replace(record, name=request.model_name, pose=pose)
        else:
            self._simulator.spawn(record, pose, request.model_name, request.robot_namespace)

    def _spawn(self, request, load):
        """Read the text in the caller's thread, so that a long one does not hold up time and other calls.

        So do its meshes become what physics and rays need of them; into the loop goes only what is ready.
        """
        refusal = self._take_convention(request.model_name) or self.in_loop(lambda: self._place_of(request)[1])
        if refusal:
            return SpawnModelResponse(False, refusal)
        try:
            with _no_collections(len(request.model_xml) > _LONG_TEXT):
                record = load()
            _check_size(record, request.model_name)
            kept = prepare(record)
        except SimError as error:
            log.error("spawn of \"%s\": %s", request.model_name, error)
            return SpawnModelResponse(False, "%s %s" % (_UNREADABLE, error))
        except rospy.ServiceException:
            raise
        except Exception as error:
            return self._fault(request, error)
        response = self.in_loop(lambda: self._enter(request, record))
        del kept
        return response

    def _take_convention(self, name):
        """Let the parameter for a model's wheel convention count as it is now; return why it cannot, or None."""
        value = self.convention_set_for(name)
        if value is None:
            return None
        if value not in CONVENTIONS:
            refusal = ("SpawnModel: parameter ~wheel_conventions/%s is %r; expected one of %s"
                       % (name, value, ", ".join(CONVENTIONS)))
            log.error("spawn of \"%s\": %s", name, refusal)
            return refusal
        self._simulator.config.wheel_conventions[name] = value
        return None

    @staticmethod
    def _size_refusal(request):
        """Return why a text is too large to be read beside a simulation, which the log has been told, or None."""
        text, refusal = request.model_xml, None
        marks = sum(text.count(mark) for mark in "<=&")
        if len(text) > MOST_TEXT:
            refusal = "SpawnModel: the text has %d characters; expected at most %d" % (len(text), MOST_TEXT)
        elif marks > MOST_MARKS:
            refusal = "SpawnModel: the text has %d tags and attributes; expected at most %d" % (marks, MOST_MARKS)
        if refusal:
            log.error("spawn of \"%s\": %s", request.model_name, refusal)
        return refusal

    def _place_of(self, request):
        """Return the wanted pose in the world, and why it cannot be had: a text for the answer, or None."""
        simulator, name = self._simulator, request.model_name
        pose = read_pose(request.initial_pose)
        if not all_finite(pose[0] + pose[1]):
            return None, "SpawnModel: initial_pose is not finite"
        try:
            pose = simulator.pose_in_world(pose, request.reference_frame)
        except NotFoundError as error:
            log.error("spawn of \"%s\": %s", name, error)
            return None, _NO_FRAME
        if name in simulator.models or name in simulator.lights:
            log.error("spawn of \"%s\": a model or light of that name is already in the world", name)
            return None, "SpawnModel: Failure - entity already exists."
        return pose, None if name else "SpawnModel: model_name is empty; expected a name for the model"

    def _enter(self, request, record):
        pose, refusal = self._place_of(request)         # again: others may have been at work meanwhile
        if refusal:
            return SpawnModelResponse(False, refusal)
        try:
            convention = self._simulator.config.wheel_convention_of(request.model_name)
            known, under = self._told
            with said_once(record is known and convention == under):    # another of the same: all has been said
                self._put(record, pose, request)
            self._told = (record, convention)
        except SimError as error:
            log.error("spawn of \"%s\": %s", request.model_name, error)
            return SpawnModelResponse(False, "%s %s" % (_UNREADABLE, error))
        except Exception as error:
            return self._fault(request, error)
        # what a text refers to may change while the text does not
        self._newest = (request.model_xml, record) if "<mesh" not in request.model_xml else ("", None)
        log.info("spawned \"%s\"", request.model_name)
        return SpawnModelResponse(True, "SpawnModel: Successfully spawned entity")

    @staticmethod
    def _fault(request, error):
        log.exception("spawn of \"%s\" failed", request.model_name)
        return SpawnModelResponse(False, "%s %s: %s" % (_UNREADABLE, type(error).__name__, error))
