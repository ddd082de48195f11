# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_control.so: the controllers of ros_control, and the services of their manager."""
from __future__ import annotations

import math
from typing import Any, List, Optional

from m2wr_sim.control_messages import (
    Bool,
    ControllerState,
    HardwareInterfaceResources,
    ListControllers,
    ListControllersResponse,
    ListControllerTypes,
    ListControllerTypesResponse,
    LoadController,
    LoadControllerResponse,
    ReloadControllerLibraries,
    ReloadControllerLibrariesResponse,
    SwitchController,
    SwitchControllerResponse,
    UnloadController,
    UnloadControllerResponse,
)
from m2wr_sim.errors import PluginError
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.ros_control.controllers.base import ControllerNode
from m2wr_sim.ros_control.description import RobotDescription, Transmission
from m2wr_sim.ros_control.hardware import INTERFACES, POSITION, VELOCITY, JointHandle, RobotHardware
from m2wr_sim.ros_control.joint_limits import with_parameters
from m2wr_sim.ros_control.manager import BEST_EFFORT, STRICT, ControllerManager
from m2wr_sim.ros_control.pid import Pid, read_gains
from m2wr_sim.runtime.schedule import first_step

_SIM_TYPES = ("gazebo_ros_control/DefaultRobotHWSim", "DefaultRobotHWSim")
_BASE_CLASS = "controller_interface::ControllerBase"
_LOOK_NS = 100000000            # of simulated time between two looks for the robot description, as in Gazebo
_PATIENCE_NS = 5000000000       # of simulated time until a missing robot description is reported


class RosControl(Plugin):
    """Emulates ``gazebo_ros_control`` with its default hardware.

    The joints are those of the transmissions in the URDF of the parameter ``robotParam``.  Each control period the
    joints are read and the controllers updated; commands are applied in each step.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._spec = ctx, spec
        self._namespace = "/" + (spec.spec.find("robotNamespace") or ctx.model_name).strip("/")
        self._parameter = spec.text("robotParam", "robot_description")
        kind = spec.text("robotSimType", _SIM_TYPES[0])
        if kind not in _SIM_TYPES:
            raise PluginError("%s: <robotSimType> is %s, a library for Gazebo's process; expected %s"
                              % (spec.spec.where, kind, _SIM_TYPES[0]))
        self._period_ns = int(round(spec.number("controlPeriod", 0.0, minimum=0.0) * 1e9))
        self._report_period()
        self._stop_topic = spec.text("eStopTopic", "")
        spec.ignore("legacyModeNS")
        self._manager: Optional[ControllerManager] = None
        self._since_ns, self._look_ns, self._reported, self._failed = ctx.now_ns, ctx.now_ns, False, False
        if not self._begin():
            ctx.log.info("%s: waits for the parameter %s, searched upwards from %s", ctx.model_name, self._parameter,
                         self._namespace)

    def _report_period(self) -> None:
        period_ns, step_ns, log = self._period_ns, self._ctx.step_ns, self._ctx.log
        if period_ns and period_ns < step_ns:
            log.error("%s: controlPeriod is %g s, shorter than the physics step of %g s; controllers run once a step",
                      self._ctx.model_name, period_ns * 1e-9, step_ns * 1e-9)
        elif period_ns > step_ns:
            log.warning("%s: controlPeriod is %g s, longer than the physics step of %g s", self._ctx.model_name,
                        period_ns * 1e-9, step_ns * 1e-9)

    # ---- start --------------------------------------------------------------------------------------------------

    def _begin(self) -> bool:
        """Build the hardware and offer the services, if the robot description is there; return whether it is."""
        ctx = self._ctx
        parts = [part for part in self._namespace.split("/") if part]
        places = ["/".join(["", *parts[:depth], self._parameter.strip("/")]) for depth in range(len(parts), -1, -1)]
        for place in [self._parameter] if self._parameter.startswith("/") else places:
            text = ctx.parameter(place)
            if isinstance(text, str) and text.strip():
                break
        else:
            return False
        self._description = RobotDescription(text, "parameter " + place)
        transmissions = self._description.transmissions(ctx.log.warning)
        joints: List[JointHandle] = []
        for transmission in transmissions:
            if any(joint.name == transmission.joint for joint in joints):
                ctx.log.warning("%s: joint '%s' has a second transmission, '%s', which is ignored", ctx.model_name,
                                transmission.joint, transmission.name)
            else:
                joints.append(self._joint(transmission))
        if not joints:
            ctx.log.warning("%s: %s has no transmission; there is no joint to control. Expected a <transmission> for "
                            "each driven joint.", ctx.model_name, place)
        self._hardware = RobotHardware(ctx.physics, joints)
        self._manager = ControllerManager(self._namespace, self._hardware, self._node,
                                          lambda name: ctx.parameter(self._below(name)), ctx.log)
        self._last_ns, self._dirty = ctx.time_ns, True
        self._stopped_by: Optional[bool] = None
        self._offer_services()
        if self._stop_topic:
            ctx.subscribe(self._stop_topic, Bool, self._emergency, self._namespace)
        return True

    def _below(self, name: str) -> str:
        return self._namespace.rstrip("/") + "/" + name.strip("/")

    def _node(self, name: str, values: Any) -> ControllerNode:
        return ControllerNode(self._ctx, self._namespace, name, values, self._description)

    def _joint(self, transmission: Transmission) -> JointHandle:
        ctx, name = self._ctx, transmission.joint
        if transmission.interface not in INTERFACES:
            raise PluginError("No matching hardware interface found for '%s' while loading interfaces for %s; expected "
                              "one of %s. Could not initialize robot simulation interface"
                              % (transmission.interface, name, ", ".join(INTERFACES)))
        try:
            number = driven_joint(ctx, self._spec, name)
        except PluginError as error:
            raise PluginError("This robot has a joint named \"%s\" which is not in the gazebo model. %s"
                              % (name, error)) from None
        place = self._below("joint_limits/" + name)
        limits = with_parameters(self._description.limits(name), ctx.parameter(place), place)
        effort_limit, pid = self._description.effort_limit(name), None
        if transmission.interface in (POSITION, VELOCITY):
            place = self._below("gazebo_ros_control/pid_gains/" + name)
            values = ctx.parameter(place)
            if isinstance(values, dict) and "p" not in values:
                ctx.log.warning("No p gain specified for pid.  Namespace: %s. It has only %s, which are ignored.",
                                place, ", ".join(sorted(map(str, values))) or "an empty mapping")
                values = None
            if values is not None:
                pid = Pid(read_gains(values, place))
            else:
                ctx.log.info("%s: joint %s is driven by a motor%s; it has no PID gains (%s), none are needed",
                             ctx.model_name, name, "" if effort_limit is None or transmission.interface == POSITION
                             else " of at most %g N m" % effort_limit, place)
        kind = self._description.joint_type(name)
        if transmission.interface == POSITION and pid is None:
            # commands keep the limits; at a stop the solver would add the motor's greatest force to the joint
            ctx.physics.change_joint(number, ctx.joint_record(name).axis, {"lower": -math.inf, "upper": math.inf})
        return JointHandle(name, number, transmission.interface, limits, effort_limit, kind != "prismatic",
                           kind == "continuous", pid)

    # ---- steps --------------------------------------------------------------------------------------------------

    def next_before(self, now_ns: int) -> Optional[int]:
        if self._manager is None:
            return NEVER if self._failed else first_step(self._look_ns, now_ns, self._ctx.step_ns)
        step_ns = self._ctx.step_ns
        if self._dirty or self._hardware.restless:
            return now_ns + step_ns
        if not self._manager.running:
            return NEVER
        return max(now_ns + step_ns, first_step(self._last_ns + self._period_ns, now_ns, step_ns))

    def before_step(self, now_ns: int) -> None:
        manager = self._manager
        if manager is None:
            self._look(now_ns)
            return
        step_ns = self._ctx.step_ns
        if manager.running or self._hardware.restless:
            elapsed_ns = now_ns - self._last_ns
            if elapsed_ns >= self._period_ns:
                if elapsed_ns > 2 * max(step_ns, self._period_ns):      # nothing ran for some time
                    elapsed_ns = max(step_ns, self._period_ns)
                self._last_ns = now_ns
                self._hardware.read()
                manager.update(now_ns, elapsed_ns * 1e-9)
        self._hardware.write(step_ns * 1e-9)
        self._dirty = False

    def _look(self, now_ns: int) -> None:
        """Look for the robot description again; say once what is missing."""
        if now_ns < self._look_ns or self._failed:
            return
        self._look_ns = now_ns + _LOOK_NS
        try:
            found = self._begin()
        except PluginError as error:
            self._failed = True
            self._ctx.log.error("%s. ros_control will not run for %s.", error, self._ctx.model_name)
            return
        if not found and not self._reported and now_ns - self._since_ns > _PATIENCE_NS:
            self._reported = True
            self._ctx.log.warning("%s: found no parameter %s in %s or above it for 5 s, so there is no "
                                  "controller_manager; load the URDF of the robot into it", self._ctx.model_name,
                                  self._parameter, self._namespace)

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Let the running controllers begin again.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Whether simulated time was set back to zero.
        """
        self._look_ns = now_ns
        if self._manager is not None:
            self._last_ns, self._dirty = now_ns, True
            self._manager.restart(now_ns)

    def close(self) -> None:
        if self._manager is not None:
            self._manager.close()

    def _emergency(self, message: Any) -> None:
        """Stop all commands, or release them and let the controllers begin again."""
        stop = bool(message.data)
        if stop == self._hardware.stopped:
            return
        assert self._manager is not None
        self._hardware.stopped, self._dirty = stop, True
        self._ctx.log.warning("%s: emergency stop %s", self._ctx.model_name, "active" if stop else "released")
        if not stop:
            self._manager.restart(self._ctx.time_ns)

    # ---- services -----------------------------------------------------------------------------------------------

    def _offer_services(self) -> None:
        ctx, namespace = self._ctx, self._below("controller_manager")
        for name, kind, handler in (
                ("list_controllers", ListControllers, self._list),
                ("list_controller_types", ListControllerTypes, self._list_types),
                ("load_controller", LoadController, self._load),
                ("unload_controller", UnloadController, self._unload),
                ("switch_controller", SwitchController, self._switch),
                ("reload_controller_libraries", ReloadControllerLibraries, self._reload)):
            ctx.serve(name, kind, handler, namespace)

    @property
    def manager(self) -> ControllerManager:
        """The controller manager; PluginError while the robot description is missing."""
        if self._manager is None:
            raise PluginError("there is no controller manager before the parameter %s is set" % self._parameter)
        return self._manager

    def _list(self, _request: Any) -> Any:
        reply = ListControllersResponse()
        for entry in self.manager.loaded.values():
            state = ControllerState(name=entry.name, state=entry.state, type=entry.kind)
            state.claimed_resources = [HardwareInterfaceResources(hardware_interface=_title(interface), resources=names)
                                       for interface, names in entry.claims().items()]
            if not state.claimed_resources:
                state.claimed_resources = [HardwareInterfaceResources(
                    hardware_interface=_title(entry.controller.interface), resources=[])]
            reply.controller.append(state)
        return reply

    def _list_types(self, _request: Any) -> Any:
        types = self.manager.types()
        return ListControllerTypesResponse(types=types, base_classes=[_BASE_CLASS] * len(types))

    def _load(self, request: Any) -> Any:
        return LoadControllerResponse(ok=self.manager.load(request.name))

    def _unload(self, request: Any) -> Any:
        return UnloadControllerResponse(ok=self.manager.unload(request.name))

    def _switch(self, request: Any) -> Any:
        if request.strictness not in (0, BEST_EFFORT, STRICT):
            self._ctx.log.warning("switch_controller: strictness is %d; expected 1, best effort, or 2, strict. Best "
                                  "effort is used.", request.strictness)
        self._dirty = True
        return SwitchControllerResponse(ok=self.manager.switch(
            request.start_controllers, request.stop_controllers, request.strictness == STRICT, self._ctx.time_ns))

    def _reload(self, request: Any) -> Any:
        if request.force_kill and not all(self.manager.unload(name) for name in sorted(self.manager.names())):
            return ReloadControllerLibrariesResponse(ok=False)
        return ReloadControllerLibrariesResponse(ok=True)


def _title(interface: str) -> str:
    """Return an interface as its C++ class: ``hardware_interface::VelocityJointInterface``."""
    return interface.replace("/", "::")
