# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services for lights; their names and colours are stored, but they illuminate nothing."""
import logging
from dataclasses import replace
from typing import Any, Tuple

from gazebo_msgs.srv import DeleteLightResponse, GetLightPropertiesResponse, SetLightPropertiesResponse
from m2wr_sim.geometry import normalise_quaternion
from m2wr_sim.ros.convert import all_finite, read_pose, read_vector
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)


def _read_colour(colour: Any) -> Tuple[float, float, float, float]:
    return (colour.r, colour.g, colour.b, colour.a)


class LightApi:
    """The services for lights; each method answers the service of its name, in the loop's thread."""

    def __init__(self, simulator: Simulator) -> None:
        self._lights = simulator.lights

    def get_light_properties(self, request: Any) -> GetLightPropertiesResponse:
        """Return colour and attenuation; the status text on success is empty, as in Gazebo."""
        light = self._lights.get(request.light_name)
        if light is None:
            return GetLightPropertiesResponse(
                status_message="getLightProperties: Requested light %s not found!" % request.light_name)
        constant, linear, quadratic = light.attenuation
        response = GetLightPropertiesResponse(attenuation_constant=constant, attenuation_linear=linear,
                                              attenuation_quadratic=quadratic, success=True)
        diffuse = response.diffuse
        diffuse.r, diffuse.g, diffuse.b, diffuse.a = light.diffuse
        return response

    def set_light_properties(self, request: Any) -> SetLightPropertiesResponse:
        """Store the properties of a light; the status text on success is empty, as in Gazebo."""
        light = self._lights.get(request.light_name)
        if light is None:
            return SetLightPropertiesResponse(
                False, "setLightProperties: Requested light %s not found!" % request.light_name)
        position, orientation = read_pose(request.pose)
        new = replace(light, cast_shadows=request.cast_shadows, diffuse=_read_colour(request.diffuse),
                      specular=_read_colour(request.specular), direction=read_vector(request.direction),
                      attenuation=(request.attenuation_constant, request.attenuation_linear,
                                   request.attenuation_quadratic))
        if not all_finite(new.diffuse + new.specular + new.direction + new.attenuation + position + orientation):
            return SetLightPropertiesResponse(False, "setLightProperties: a number is not finite")
        self._lights[light.name] = replace(new, pose=(position, normalise_quaternion(orientation)))
        return SetLightPropertiesResponse(True, "")

    def delete_light(self, request: Any) -> DeleteLightResponse:
        """Delete a light; the answer for an unknown one is Gazebo's, which gives it after ten seconds."""
        if self._lights.pop(request.light_name, None) is None:
            log.error("delete_light: there is no light \"%s\" (has %s)", request.light_name,
                      ", ".join(self._lights) or "none")
            return DeleteLightResponse(
                False, "DeleteLight: Timeout reached while removing light \"%s\"" % request.light_name)
        return DeleteLightResponse(True, "DeleteLight: %s successfully deleted" % request.light_name)
