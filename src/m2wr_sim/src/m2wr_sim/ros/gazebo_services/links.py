# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services for links; each method answers the service of its name, in the loop's thread."""
import logging
from typing import Any, Optional, Tuple

from gazebo_msgs.srv import (
    ApplyBodyWrenchResponse,
    BodyRequestResponse,
    GetLinkPropertiesResponse,
    GetLinkStateResponse,
    SetLinkPropertiesResponse,
    SetLinkStateResponse,
)
from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.geometry import compose, normalise_quaternion, rotate
from m2wr_sim.model.types import Inertial
from m2wr_sim.ros.convert import all_finite, read_pose, read_vector, write_pose
from m2wr_sim.runtime.changes import set_link_properties, set_link_state, wrench_as_gazebo, wrench_in_world
from m2wr_sim.runtime.entities import INERTIAL_FRAMES, find_link, list_names, relative
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

_SCOPE = "did you forget to scope the link by model name?"
_NO_LINK = "link not found, " + _SCOPE
Vector = Tuple[float, float, float]

_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def _add(one: Vector, two: Vector, factor: float = 1.0) -> Vector:
    return (one[0] + factor * two[0], one[1] + factor * two[1], one[2] + factor * two[2])


class LinkApi:
    """The services for links.

    Parameters
    ----------
    simulator : Simulator
    forces : Forces
    as_gazebo : bool
        Reproduce the known faults of Gazebo: wrenches in wrong axes, velocities that are not rotated, masses without
        effect.
    """

    def __init__(self, simulator: Simulator, forces: Forces, as_gazebo: bool) -> None:
        self._simulator, self._forces, self._as_gazebo = simulator, forces, as_gazebo

    def _find(self, name: str) -> Optional[Tuple[Any, str]]:
        return find_link(self._simulator.models.values(), name)

    def get_link_state(self, request: Any) -> GetLinkStateResponse:
        """Return pose and velocity of a link's frame; name and reference frame are copied from the request."""
        response = GetLinkStateResponse()
        found = self._find(request.link_name)
        if found is None:
            response.status_message = "GetLinkState: " + _NO_LINK
            return response
        model, name = found
        try:
            reference = self._simulator.frame_state(request.reference_frame)
        except NotFoundError:
            response.status_message = "GetLinkState: reference reference_frame not found, " + _SCOPE
            return response
        state = relative(self._simulator.engine.link_state(model.handle.links[name]), reference)
        answer = response.link_state
        answer.link_name, answer.reference_frame = request.link_name, request.reference_frame
        write_pose(answer.pose, state.position, state.orientation)
        for vector, values in ((answer.twist.linear, state.linear), (answer.twist.angular, state.angular)):
            vector.x, vector.y, vector.z = values
        response.success, response.status_message = True, "GetLinkState: got state"
        return response

    def set_link_state(self, request: Any) -> SetLinkStateResponse:
        """Set pose and velocity of one link, regardless of its joints."""
        return SetLinkStateResponse(*self.put_link(request.link_state))

    def put_link(self, wanted: Any) -> Tuple[bool, str]:
        """Apply a gazebo_msgs/LinkState; return success and status text."""
        found = self._find(wanted.link_name)
        if found is None:
            log.error("set_link_state: there is no link \"%s\"; models: %s", wanted.link_name,
                      list_names(self._simulator.models))
            return False, "SetLinkState: link does not exist"
        linear, angular = read_vector(wanted.twist.linear), read_vector(wanted.twist.angular)
        pose = read_pose(wanted.pose)
        if not all_finite(pose[0] + pose[1] + linear + angular):
            log.error("set_link_state: refused a state of \"%s\" with numbers that are not finite", wanted.link_name)
            return False, "SetLinkState: pose or twist is not finite"
        pose = (pose[0], normalise_quaternion(pose[1]))
        if wanted.reference_frame not in INERTIAL_FRAMES:
            frame = self._find(wanted.reference_frame)
            if frame is None:
                log.error("set_link_state: reference_frame \"%s\" is not a link", wanted.reference_frame)
                return False, "SetLinkState: failed"
            state = self._simulator.engine.link_state(frame[0].handle.links[frame[1]])
            pose = compose((state.position, state.orientation), pose)
            linear, angular = self._velocity(state, linear, angular)
        try:
            set_link_state(self._simulator, found[0], found[1], pose, linear, angular)
        except ModelError as error:
            log.error("set_link_state: %s", error)
            return False, "SetLinkState: %s" % error
        return True, "SetLinkState: success"

    def _velocity(self, frame: Any, linear: Vector, angular: Vector) -> Tuple[Vector, Vector]:
        """Return the world velocity for one given in a frame; Gazebo subtracts the frame's, without rotation."""
        if self._as_gazebo:
            return _add(linear, frame.linear_velocity, -1.0), _add(angular, frame.angular_velocity, -1.0)
        return (_add(rotate(frame.orientation, linear), frame.linear_velocity),
                _add(rotate(frame.orientation, angular), frame.angular_velocity))

    def get_link_properties(self, request: Any) -> GetLinkPropertiesResponse:
        """Return mass, inertia and centre of mass of a link, after the lumping of fixed joints."""
        found = self._find(request.link_name)
        if found is None:
            return GetLinkPropertiesResponse(status_message="GetLinkProperties: " + _NO_LINK)
        record = next(link for link in found[0].record.links if link.name == found[1])
        ixx, ixy, ixz, iyy, iyz, izz = record.inertial.inertia
        response = GetLinkPropertiesResponse(
            gravity_mode=record.gravity, mass=record.inertial.mass, ixx=ixx, ixy=ixy, ixz=ixz, iyy=iyy, iyz=iyz,
            izz=izz, success=True, status_message="GetLinkProperties: got properties")
        write_pose(response.com, record.inertial.pose[0], _UPRIGHT)
        return response

    def set_link_properties(self, request: Any) -> SetLinkPropertiesResponse:
        """Set mass, inertia, centre of mass and gravity; with Gazebo's faults only gravity has an effect."""
        found = self._find(request.link_name)
        if found is None:
            return SetLinkPropertiesResponse(False, "SetLinkProperties: " + _NO_LINK)
        centre = read_pose(request.com)[0]
        tensor = (request.ixx, request.ixy, request.ixz, request.iyy, request.iyz, request.izz)
        if not all_finite(centre + tensor + (request.mass,)):
            return SetLinkPropertiesResponse(False, "SetLinkProperties: a number is not finite")
        try:
            set_link_properties(self._simulator, *found, gravity=request.gravity_mode, solve=not self._as_gazebo,
                                inertial=Inertial(request.mass, (centre, _UPRIGHT), tensor))
        except ModelError as error:
            log.error("set_link_properties: %s", error)
            return SetLinkPropertiesResponse(False, "SetLinkProperties: %s" % error)
        return SetLinkPropertiesResponse(True, "SetLinkProperties: properties set")

    def apply_body_wrench(self, request: Any) -> ApplyBodyWrenchResponse:
        """Apply a wrench [N, N m]; the status text on success is empty, as in Gazebo."""
        found = self._find(request.body_name)
        if found is None:
            log.error("apply_body_wrench: there is no link \"%s\"", request.body_name)
            return ApplyBodyWrenchResponse(False, "ApplyBodyWrench: body does not exist")
        model, name = found
        try:
            frame = self._simulator.frame_state(request.reference_frame)
        except NotFoundError as error:
            log.error("apply_body_wrench: %s", error)
            return ApplyBodyWrenchResponse(False, "ApplyBodyWrench: reference_frame not found")
        wrench = (read_vector(request.reference_point), read_vector(request.wrench.force),
                  read_vector(request.wrench.torque))
        if not all_finite(sum(wrench, ())):
            return ApplyBodyWrenchResponse(False, "ApplyBodyWrench: a number is not finite")
        frame_pose = None if frame is None else (frame.position, frame.orientation)
        pose = self._simulator.engine.link_pose(model.handle.links[name])
        if self._as_gazebo:
            force, torque = wrench_as_gazebo(pose, frame_pose, *wrench)
        else:
            force, torque = wrench_in_world(pose, model.acting_inertial(name).pose[0], frame_pose, *wrench)
        try:
            self._forces.push_link(model, name, force, torque, request.start_time.to_nsec(), request.duration.to_nsec())
        except ModelError as error:
            log.error("apply_body_wrench: %s", error)
            return ApplyBodyWrenchResponse(False, "ApplyBodyWrench: %s" % error)
        return ApplyBodyWrenchResponse(True, "")

    def clear_body_wrenches(self, request: Any) -> BodyRequestResponse:
        """Remove the wrenches on a link, which is named ``model::link``."""
        self._forces.clear_link(request.body_name)
        return BodyRequestResponse()
