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

log = logging.getLogger(__name__)

_UNREADABLE = ("GazeboRosApiPlugin SpawnModel Failure: input model_xml not SDF or URDF, or cannot be converted to "
               "Gazebo compatible format.")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_PACKAGE = re.compile(r"package://([^/\"'<>\s]+)")
_NO_FRAME = ("SpawnModel: reference reference_frame not found, did you forget to scope the link by model name?")


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
            log.error("spawn_urdf_model: package://%s: there is no package \"%s\" in this workspace; expected one that rospack "
                      "finds", name, name)
            raise rospy.ServiceException("urdf reference package name does not exist: %s" % name)

    def spawn_urdf(self, request):
        """Answer spawn_urdf_model; no ``<robot>`` or an unknown ``package://`` make the call itself fail, as in Gazebo."""
        if "<robot" not in request.model_xml:
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
        if "<robot" in request.model_xml:
            return self.spawn_urdf(request)
        if "<sdf" not in request.model_xml and "<gazebo" not in request.model_xml:
            log.error("spawn_sdf_model: the text for \"%s\" has no <sdf> element; expected an SDF model",
                      request.model_name)
            raise rospy.ServiceException("SpawnModel: Failure - entity format is invalid.")
        return self._spawn(request, lambda: self._only_model(request))

    def _only_model(self, request):
        models = load_sdf_models(request.model_xml, source="SDF of %s" % request.model_name,
                                 resolve_model=self._resolve_model)
        if len(models) != 1:
            raise ModelError("SDF of %s holds %d models; expected one" % (request.model_name, len(models)))
        return models[0]

    def _spawn(self, request, load):
        simulator = self._simulator
        pose = request.initial_pose
        pose = ((pose.position.x, pose.position.y, pose.position.z),
                (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w))
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
        log.info("spawned \"%s\"", request.model_name)
        return SpawnModelResponse(True, "SpawnModel: Successfully spawned entity")
