"""spawn_urdf_model and spawn_sdf_model: from the text in a request to a model in the world."""
import logging
import re

import rospkg
import rospy
from gazebo_msgs.srv import SpawnModelResponse

from m2wr_sim.errors import ModelError, NotFoundError, SimError
from m2wr_sim.geometry import compose
from m2wr_sim.model.sdf import load_sdf_models
from m2wr_sim.model.urdf import load_urdf
from m2wr_sim.ros.convert import read_pose

log = logging.getLogger(__name__)

_UNREADABLE = ("GazeboRosApiPlugin SpawnModel Failure: input model_xml not SDF or URDF, or cannot be converted to "
               "Gazebo compatible format.")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_PACKAGE = re.compile(r"package://([^/\"'<>\s]+)")
_BEFORE_ROOT = re.compile(r"(?:\s|\ufeff|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>\[]*(?:\[.*?\]\s*)?>)*"
                          r"<([A-Za-z_][\w.:-]*)", re.DOTALL)
_NO_FRAME = ("SpawnModel: reference reference_frame not found, did you forget to scope the link by model name?")


def _root_tag(text):
    """Return the name of the root element as far as it can be told without parsing; None if there is none."""
    found = _BEFORE_ROOT.match(text)
    return found.group(1) if found else None


class Spawner:
    """Reads models from requests and puts them into a simulator.

    Parameters
    ----------
    simulator : Simulator
    resolve_model : callable, optional
        From ``NAME`` of a ``model://NAME`` to its folder, or None; for SDF that includes other models.
    """

    def __init__(self, simulator, resolve_model=None):
        self._simulator, self._resolve_model = simulator, resolve_model
        self._packages = rospkg.RosPack()

    def _package_folder(self, name):
        try:
            return self._packages.get_path(name)
        except rospkg.ResourceNotFound:
            log.error("spawn_urdf_model: package://%s: there is no package \"%s\"; expected one that rospack finds",
                      name, name)
            raise rospy.ServiceException("urdf reference package name does not exist: %s" % name)

    def spawn_urdf(self, request):
        """Answer spawn_urdf_model; without a ``<robot>``, or with an unknown ``package://``, the call itself fails."""
        if _root_tag(request.model_xml) != "robot":
            log.error("spawn_urdf_model: the text for \"%s\" has no <robot> element; expected a URDF",
                      request.model_name)
            raise rospy.ServiceException("SpawnModel: Failure - entity format is invalid.")
        for package in sorted(set(_PACKAGE.findall(_COMMENT.sub("", request.model_xml)))):
            self._package_folder(package)       # also those of visual meshes, which nothing here opens
        return self._spawn(request, lambda: load_urdf(
            request.model_xml, source="URDF of %s" % request.model_name, model_name=request.model_name,
            resolve_package=self._package_folder))

    def spawn_sdf(self, request):
        """Answer spawn_sdf_model; a URDF is taken too, as Gazebo does."""
        root = _root_tag(request.model_xml)
        if root == "robot":
            return self.spawn_urdf(request)
        if root not in ("sdf", "gazebo"):
            reason = "the text begins with %s; expected <sdf> or <robot>" % ("<%s>" % root if root else "no element")
            log.error("spawn of \"%s\": %s", request.model_name, reason)
            return SpawnModelResponse(False, "%s %s" % (_UNREADABLE, reason))
        return self._spawn(request, lambda: self._only_model(request))

    def _only_model(self, request):
        models = load_sdf_models(request.model_xml, source="SDF of %s" % request.model_name,
                                 resolve_model=self._resolve_model)
        if len(models) != 1:
            raise ModelError("SDF of %s holds %d models; expected one" % (request.model_name, len(models)))
        return models[0]

    def _spawn(self, request, load):
        simulator = self._simulator
        pose = read_pose(request.initial_pose)
        if not all(abs(number) < float("inf") for number in pose[0] + pose[1]):
            return SpawnModelResponse(False, "SpawnModel: initial_pose is not finite")
        try:
            pose = simulator.pose_in_world(pose, request.reference_frame)
        except NotFoundError as error:
            log.error("spawn of \"%s\": %s", request.model_name, error)
            return SpawnModelResponse(False, _NO_FRAME)
        if request.model_name in simulator.models:
            log.error("spawn of \"%s\": a model of that name is already in the world", request.model_name)
            return SpawnModelResponse(False, "SpawnModel: Failure - entity already exists.")
        if not request.model_name:
            return SpawnModelResponse(False, "SpawnModel: model_name is empty; expected a name for the model")
        try:
            record = load()
            simulator.spawn(record, compose(pose, record.pose), request.model_name, request.robot_namespace)
        except SimError as error:
            log.error("spawn of \"%s\": %s", request.model_name, error)
            return SpawnModelResponse(False, "%s %s" % (_UNREADABLE, error))
        except rospy.ServiceException:
            raise
        except Exception as error:
            log.exception("spawn of \"%s\" failed", request.model_name)
            return SpawnModelResponse(False, "%s %s: %s" % (_UNREADABLE, type(error).__name__, error))
        log.info("spawned \"%s\"", request.model_name)
        return SpawnModelResponse(True, "SpawnModel: Successfully spawned entity")
