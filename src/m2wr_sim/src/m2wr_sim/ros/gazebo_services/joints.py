# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services for joints; each method answers the service of its name, in the loop's thread."""
import logging
from typing import Any, Dict, Optional, Tuple

from gazebo_msgs.srv import (
    ApplyJointEffortResponse,
    GetJointPropertiesResponse,
    JointRequestResponse,
    SetJointPropertiesResponse,
)
from m2wr_sim.errors import ModelError
from m2wr_sim.model.types import SECOND_AXIS
from m2wr_sim.ros.convert import all_finite
from m2wr_sim.runtime.changes import set_joint_properties
from m2wr_sim.runtime.entities import find_joint
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

# Fields of gazebo_msgs/ODEJointProperties and what they set: fields of the joint's Axis, parameters of the solver.
_AXIS = {"damping": "damping", "hiStop": "upper", "loStop": "lower", "stop_erp": "stop_erp", "stop_cfm": "stop_cfm"}
_SOLVER = {"hiStop": "upper", "loStop": "lower", "erp": "erp", "cfm": "cfm", "stop_erp": "stop_erp",
           "stop_cfm": "stop_cfm", "fudge_factor": "fudge_factor", "fmax": "max_force", "vel": "rate"}
_MOST_AXES = 3              # values beyond these are ignored: no joint has more axes


class JointApi:
    """The services for joints.

    Parameters
    ----------
    simulator : Simulator
    forces : Forces
    """

    def __init__(self, simulator: Simulator, forces: Forces) -> None:
        self._simulator, self._forces = simulator, forces

    def _find(self, name: str) -> Optional[Tuple[Any, str]]:
        return find_joint(self._simulator.models.values(), name)

    def get_joint_properties(self, request: Any) -> GetJointPropertiesResponse:
        """Return position [rad or m] and rate of the axes of a joint; type is always 0, damping empty, as in Gazebo."""
        found = self._find(request.joint_name)
        if found is None:
            return GetJointPropertiesResponse(status_message="GetJointProperties: joint not found")
        model, name = found
        engine, joint = self._simulator.engine, model.handle.joints.get(name)
        numbers = [] if joint is None else [joint, model.handle.joints.get(name + SECOND_AXIS)]
        numbers = [number for number in numbers if number is not None]
        return GetJointPropertiesResponse(type=GetJointPropertiesResponse.REVOLUTE,
                                          position=[engine.joint_angle(number) for number in numbers] or [0.0],
                                          rate=[engine.joint_rate(number) for number in numbers] or [0.0],
                                          success=True, status_message="GetJointProperties: got properties")

    def set_joint_properties(self, request: Any) -> SetJointPropertiesResponse:
        """Set the properties in the fields that are not empty, one value for each axis of the joint."""
        found = self._find(request.joint_name)
        if found is None:
            return SetJointPropertiesResponse(False, "SetJointProperties: joint not found")
        changes: Dict[int, Tuple[Dict[str, float], Dict[str, float]]] = {}
        for position, names in enumerate((_AXIS, _SOLVER)):
            for field, name in names.items():
                for axis, value in enumerate(getattr(request.ode_joint_config, field)[:_MOST_AXES]):
                    changes.setdefault(axis, ({}, {}))[position][name] = value
        try:
            set_joint_properties(self._simulator, *found, changes=changes)
        except ModelError as error:
            log.error("set_joint_properties: %s", error)
            return SetJointPropertiesResponse(False, "SetJointProperties: %s" % error)
        return SetJointPropertiesResponse(True, "SetJointProperties: properties set")

    def apply_joint_effort(self, request: Any) -> ApplyJointEffortResponse:
        """Apply an effort [N m or N] to a joint's axis."""
        found = self._find(request.joint_name)
        if found is None:
            return ApplyJointEffortResponse(False, "ApplyJointEffort: joint not found")
        if not all_finite((request.effort,)):
            return ApplyJointEffortResponse(False, "ApplyJointEffort: effort is not finite")
        try:
            self._forces.push_joint(*found, effort=request.effort, start_ns=request.start_time.to_nsec(),
                                    duration_ns=request.duration.to_nsec())
        except ModelError as error:
            log.error("apply_joint_effort: %s", error)
            return ApplyJointEffortResponse(False, "ApplyJointEffort: %s" % error)
        return ApplyJointEffortResponse(True, "ApplyJointEffort: effort set")

    def clear_joint_forces(self, request: Any) -> JointRequestResponse:
        """Remove the efforts on a joint."""
        self._forces.clear_joint(request.joint_name)
        return JointRequestResponse()
