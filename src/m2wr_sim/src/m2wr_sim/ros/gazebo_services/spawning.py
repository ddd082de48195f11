# SPDX-License-Identifier: BSD-3-Clause
"""spawn_urdf_model and spawn_sdf_model: from the text in a request to a model in the world."""
import gc
import logging
import re
import threading
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Callable, Iterator, List, Optional, Tuple, Union

import rospkg
import rospy

from gazebo_msgs.srv import SpawnModelResponse
from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.errors import ModelError, NotFoundError, SimError
from m2wr_sim.geometry import compose
from m2wr_sim.model.sdf.loader import load_sdf
from m2wr_sim.model.types import Heightmap, Light, Mesh, Model
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.xml.lenient import root_tag, without_comments
from m2wr_sim.physics import native_shapes
from m2wr_sim.ros.convert import all_finite, read_pose
from m2wr_sim.runtime.once_logger import suppress_warnings
from m2wr_sim.runtime.simulator import Simulator
from m2wr_sim.sensors.height_blocks import blocks_of
from m2wr_sim.sensors.mesh_tree import tree_of

log = logging.getLogger(__name__)

_UNREADABLE = ("GazeboRosApiPlugin SpawnModel Failure: input model_xml not SDF or URDF, or cannot be converted to "
               "Gazebo compatible format.")
_PACKAGE = re.compile(r"package://([^/\"'<>\s]+)")
_NO_FRAME = ("SpawnModel: reference reference_frame not found, did you forget to scope the link by model name?")


MOST_TEXT = 8 * 1024 * 1024        # characters of a description received over a service
MOST_MARKS = 100000                # of "<", "=", "&" in it (tags, attributes, ...); 10 us and 100 bytes each
_LONG_TEXT = 1000000        # characters; it creates so many objects that garbage collection would block the loop
_MOST_PARTS = 10000         # links and collisions of a model; adding them to the world takes up to 0.5 s
_MANY_TRIANGLES = 50000     # from this size on, preparing a mesh is logged

_uncollected = [0]
_uncollected_lock = threading.Lock()


@contextmanager
def _no_collections(wanted: bool) -> Iterator[None]:
    """Disable Python's garbage collector while a long description is read: each collection would block the loop.

    The objects live as long as their model. They are frozen, so that later collections skip them.
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


def _check_size(record: Union[Model, Light], name: str) -> None:
    """Raise ModelError for a model that would block the simulation for long while it is added."""
    parts = sum(1 + len(link.collisions) for link in getattr(record, "links", ()))
    if parts > _MOST_PARTS:
        raise ModelError("\"%s\" has %d links and collisions; expected at most %d in a model that is spawned (a world "
                         "file may hold more)" % (name, parts, _MOST_PARTS))


def prepare(record: Union[Model, Light]) -> List[Any]:
    """Prepare the meshes and heightmaps of a model for physics and rays, while the simulation runs.

    Returns
    -------
    list
        Prepared shapes; keep them until the model is in the world.
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
            kept.append((native_shapes.prepare(shape), tree_of(shape) if isinstance(shape, Mesh) else blocks_of(shape)))
    return kept


class Spawner:
    """Reads models from requests and adds them to a simulator.

    Parameters
    ----------
    simulator : Simulator
    resolve_model : callable, optional
        Returns the folder of ``NAME`` in ``model://NAME``, or None; for SDF that includes other models.
    urdf_surface : str
        ``honour``: a ``<surface>`` inside a URDF collision is used; ``gazebo``: it is ignored.
    """

    def __init__(self, simulator: Simulator, resolve_model: Optional[Callable[[str], Optional[str]]] = None,
                 urdf_surface: str = "honour") -> None:
        self._simulator, self._resolve_model = simulator, resolve_model
        self._honour_surface = urdf_surface == "honour"
        self._packages = rospkg.RosPack()
        # runs a function between two steps
        self.in_loop: Callable[[Callable[[], Any]], Any] = lambda function: function()
        # returns the current value of ~wheel_conventions for a model, or None
        self.convention_set_for: Callable[[str], Any] = lambda name: None
        # text and record of the last URDF: often many equal robots are spawned
        self._newest: Tuple[str, Optional[Model]] = ("", None)
        # record whose warnings have been logged, and its wheel convention
        self._logged: Tuple[Any, str] = (None, "")

    def _package_folder(self, name: str) -> str:
        try:
            return self._packages.get_path(name)
        except rospkg.ResourceNotFound:
            log.error("spawn_urdf_model: package://%s: there is no package \"%s\"; expected one that rospack finds",
                      name, name)
            raise rospy.ServiceException("urdf reference package name does not exist: %s" % name) from None

    def spawn_urdf_model(self, request: Any) -> SpawnModelResponse:
        """Answer spawn_urdf_model; the call itself fails without a ``<robot>`` or with an unknown ``package://``."""
        refusal = self._size_refusal(request)
        if refusal:
            return SpawnModelResponse(False, refusal)
        if root_tag(request.model_xml) != "robot":
            log.error("spawn_urdf_model: the text for \"%s\" has no <robot> element; expected a URDF",
                      request.model_name)
            raise rospy.ServiceException("SpawnModel: Failure - entity format is invalid.")
        for package in sorted(set(_PACKAGE.findall(without_comments(request.model_xml)))):
            self._package_folder(package)       # including packages of visual meshes, which are not opened
        return self._spawn(request, lambda: self._urdf_record(request))

    def _urdf_record(self, request: Any) -> Model:
        text, record = self._newest
        if record is not None and text == request.model_xml:
            return record
        return load_urdf(request.model_xml, source="URDF of %s" % request.model_name,
                         model_name=request.model_name, resolve_package=self._package_folder,
                         honour_collision_surface=self._honour_surface, resolve_model=self._resolve_model)

    def spawn_sdf_model(self, request: Any) -> SpawnModelResponse:
        """Answer spawn_sdf_model; a URDF is accepted too, as in Gazebo."""
        refusal = self._size_refusal(request)
        if refusal:
            return SpawnModelResponse(False, refusal)
        root = root_tag(request.model_xml)
        if root == "robot":
            return self.spawn_urdf_model(request)
        if root not in ("sdf", "gazebo"):
            reason = "the text begins with %s; expected <sdf> or <robot>" % ("<%s>" % root if root else "no element")
            log.error("spawn of \"%s\": %s", request.model_name, reason)
            return SpawnModelResponse(False, _UNREADABLE)       # exactly the answer of Gazebo
        return self._spawn(request, lambda: self._only_model(request))

    def _only_model(self, request: Any) -> Union[Model, Light]:
        models, lights = load_sdf(request.model_xml, source="SDF of %s" % request.model_name,
                                  resolve_model=self._resolve_model, most_parts=_MOST_PARTS)
        found = models or lights
        if len(found) != 1:
            raise ModelError("SDF of %s holds %d %s; expected one" % (
                request.model_name, len(found), "models" if models else "lights"))
        return found[0]

    def _put(self, record: Union[Model, Light], pose: Any, request: Any) -> None:
        """Add a model or a light to the world."""
        pose = compose(pose, record.pose)
        if isinstance(record, Light):
            self._simulator.lights[request.model_name] = replace(record, name=request.model_name, pose=pose)
        else:
            self._simulator.spawn(record, pose, request.model_name, request.robot_namespace)

    def _spawn(self, request: Any, load: Callable[[], Union[Model, Light]]) -> SpawnModelResponse:
        """Read the text and prepare its meshes in the caller's thread, so that the simulation continues meanwhile.

        Only the finished model enters the loop.
        """
        refusal = self._use_convention(request.model_name) or self.in_loop(lambda: self._place_of(request)[1])
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
        response = self.in_loop(lambda: self._add(request, record))
        del kept
        return response

    def _use_convention(self, name: str) -> Optional[str]:
        """Use the current value of a model's wheel convention; return why it is invalid, or None."""
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
    def _size_refusal(request: Any) -> Optional[str]:
        """Return why a text is too large to be read while the simulation runs, and log it; None if it is not."""
        text, refusal = request.model_xml, None
        marks = sum(text.count(mark) for mark in "<=&")
        if len(text) > MOST_TEXT:
            refusal = "SpawnModel: the text has %d characters; expected at most %d" % (len(text), MOST_TEXT)
        elif marks > MOST_MARKS:
            refusal = "SpawnModel: the text has %d tags and attributes; expected at most %d" % (marks, MOST_MARKS)
        if refusal:
            log.error("spawn of \"%s\": %s", request.model_name, refusal)
        return refusal

    def _place_of(self, request: Any) -> Tuple[Any, Optional[str]]:
        """Return the requested pose in the world, and the status text of a refusal or None."""
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
            log.error("spawn of \"%s\": a model or light with this name is already in the world", name)
            return None, "SpawnModel: Failure - entity already exists."
        return pose, None if name else "SpawnModel: model_name is empty; expected a name for the model"

    def _add(self, request: Any, record: Union[Model, Light]) -> SpawnModelResponse:
        pose, refusal = self._place_of(request)         # again: other clients may have changed the world
        if refusal:
            return SpawnModelResponse(False, refusal)
        try:
            convention = self._simulator.config.wheel_convention_of(request.model_name)
            record_before, convention_before = self._logged
            with suppress_warnings(record is record_before and convention == convention_before):  # an equal robot
                self._put(record, pose, request)
            self._logged = (record, convention)
        except SimError as error:
            log.error("spawn of \"%s\": %s", request.model_name, error)
            return SpawnModelResponse(False, "%s %s" % (_UNREADABLE, error))
        except Exception as error:
            return self._fault(request, error)
        # a mesh file may change while the text does not
        if isinstance(record, Model) and "<mesh" not in request.model_xml:
            self._newest = (request.model_xml, record)
        else:
            self._newest = ("", None)
        log.info("spawned \"%s\"", request.model_name)
        return SpawnModelResponse(True, "SpawnModel: Successfully spawned entity")

    @staticmethod
    def _fault(request: Any, error: Exception) -> SpawnModelResponse:
        log.exception("spawn of \"%s\" failed", request.model_name)
        return SpawnModelResponse(False, "%s %s: %s" % (_UNREADABLE, type(error).__name__, error))
