# SPDX-License-Identifier: BSD-3-Clause
"""Messages of controllers have the MD5 sums of control_msgs 1.5.2, controller_manager_msgs 0.20.0 and their like."""
import importlib

import pytest

SUMS = {
    "control_msgs.msg": {
        "FollowJointTrajectoryAction": "bc4f9b743838566551c0390c65f1a248",
        "GripperCommandAction": "950b2a6ebe831f5d4f4ceaba3d8be01e",
        "JointTrajectoryAction": "a04ba3ee8f6a2d0985a6aeaf23d9d7ad",
        "PointHeadAction": "7252920f1243de1b741f14f214125371",
        "SingleJointPositionAction": "c4a786b7d53e5d0983decf967a5a779e",
        "GripperCommand": "680acaff79486f017132a7f198d40f08",
        "JointControllerState": "987ad85e4756f3aef7f1e5e7fe0595d1",
        "JointJog": "1685da700c8c2e1254afc92a5fb89c96",
        "JointTolerance": "f544fe9c16cf04547e135dd6063ff5be",
        "JointTrajectoryControllerState": "10817c60c2486ef6b33e97dcd87f4474",
        "PidState": "b138ec00e886c10e73f27e8712252ea6"},
    "control_msgs.srv": {
        "QueryCalibrationState": "28af3beedcb84986b8e470dc5470507d",
        "QueryTrajectoryState": "ec93cdecbd8062d761aa52b7c90cd44b"},
    "controller_manager_msgs.msg": {
        "ControllerState": "aeb6b261d97793ab74099a3740245272",
        "ControllerStatistics": "697780c372c8d8597a1436d0e2ad3ba8",
        "ControllersStatistics": "a154c347736773e3700d1719105df29d",
        "HardwareInterfaceResources": "f25b55cbf1d1f76e82e5ec9e83f76258"},
    "controller_manager_msgs.srv": {
        "ListControllerTypes": "c1d4cd11aefa9f97ba4aeb5b33987f4e",
        "ListControllers": "1341feb2e63fa791f855565d0da950d8",
        "LoadController": "647e5c54b8d6468952d8d31f1efe96c0",
        "ReloadControllerLibraries": "40e8c411fd1797d2e2c486018f846040",
        "SwitchController": "b29a7abc673b2c54c14b54e50f8d06a5",
        "UnloadController": "647e5c54b8d6468952d8d31f1efe96c0"},
    "four_wheel_steering_msgs.msg": {
        "FourWheelSteering": "04dd0f55e1f168668af1e2587a7cdd2a",
        "FourWheelSteeringStamped": "9226582df815bc6df9e3206bc05923af"},
    "kobuki_msgs.msg": {
        "BumperEvent": "ffe360cd50f14f9251d9844083e72ac5",
        "ButtonEvent": "49eca512765dbdec759a79083ffcec8d",
        "CliffEvent": "c5b106efbb1427a94f517c5e05f06295",
        "ControllerInfo": "46af38e72f0640f41ed22174d43a2550",
        "DigitalInputEvent": "93da823c8b121f8a3940ef3830c58e44",
        "DigitalOutput": "1e97cd7f196a0270516b506e8bf29ca2",
        "DockInfraRed": "a3d77f7d15e50579473dcc24e9b97b34",
        "ExternalPower": "95149d524971a4c6d19e64c827307194",
        "KeyboardInput": "9288b95cb32b48719d84d696be253401",
        "Led": "4391183b0cf05f8f25d04220401b9f43",
        "MotorPower": "8f77c0161e0f2021493136bb5f3f0e51",
        "PowerSystemEvent": "f6464657d6c911b00c7bc7b43a154bf8",
        "RobotStateEvent": "c6eccd4cb1f95df95635b56d6226ea32",
        "ScanAngle": "06e2c839dc5c7f5c13ac09a8b4ff0a6a",
        "SensorState": "430a4bfd78449c8740bfef32b26613a6",
        "Sound": "dfeab0daae67749c426c1db741a4f420",
        "VersionInfo": "3dc0ce6edd49be1fc86730f4a4a21861",
        "WheelDropEvent": "e102837d89384d67669a0df86b63f33b"}}


@pytest.mark.parametrize("module, name", [(module, name) for module in sorted(SUMS) for name in sorted(SUMS[module])])
def test_md5_sum_is_the_official_one(module, name):
    assert getattr(importlib.import_module(module), name)._md5sum == SUMS[module][name]
