# SPDX-License-Identifier: BSD-3-Clause
"""The MD5 sum of every definition equals the one published for ROS Noetic.

ROS compares these sums when a connection is made: one changed field, order or constant and old programs are refused.
The generated classes are compared: they define the transmitted bytes; the tables are complete in both directions.
"""
import importlib
from pathlib import Path

import pytest

PACKAGE_DIR = Path(__file__).resolve().parents[1]

MESSAGES = {
    'ContactState': '48c0ffb054b8c444f870cecea1ee50d9',
    'ContactsState': 'acbcb1601a8e525bf72509f18e6f668d',
    'LinkState': '0818ebbf28ce3a08d48ab1eaa7309ebe',
    'LinkStates': '48c080191eb15c41858319b4d8a609c2',
    'ModelState': '9330fd35f2fcd82d457e54bd54e10593',
    'ModelStates': '48c080191eb15c41858319b4d8a609c2',
    'ODEJointProperties': '1b744c32a920af979f53afe2f9c3511f',
    'ODEPhysics': '667d56ddbd547918c32d1934503dc335',
    'PerformanceMetrics': '884f71fd5037b886ec5e126b83c4425a',
    'SensorPerformanceMetric': '01762ded18cfe9ebc7c8222667c99547',
    'WorldState': 'de1a9de3ab7ba97ac0e9ec01a4eb481e',
}

SERVICES = {
    'ApplyBodyWrench': '585b9f9618aa0581b207e2f2d90866bc',
    'ApplyJointEffort': 'c0039811b8cc919490b3cff748cdf46b',
    'BodyRequest': '5eade9afe7f232d78005bd0cafeab755',
    'DeleteLight': 'ae11ea8100d536d5b92c2b5917abf912',
    'DeleteModel': '9ce56b4e9e54616de25d796dc972a262',
    'GetJointProperties': '7b30be900f50aa21efec4a0ec92d91c9',
    'GetLightProperties': 'df2cef87e13e2e6990e81e8aaa454c19',
    'GetLinkProperties': '0e06a70386d0ee3fb880c02f23fcd821',
    'GetLinkState': '09d6c98cce97b35f7ab9bd70300657ab',
    'GetModelProperties': '5717f7bd34ed990fa80e28b3015027a3',
    'GetModelState': '4c515e936d3319c9610c559c60bfc3d4',
    'GetPhysicsProperties': '575a5e74786981b7df2e3afc567693a6',
    'GetWorldProperties': '36bb0f2eccf4d8be971410c22818ba3f',
    'JointRequest': '0be1351618e1dc030eb7959d9a4902de',
    'SetJointProperties': '15a76e921b1410c698d82782ea5fa370',
    'SetJointTrajectory': '88f5c10979e3f9649d5ae87a3b12aa65',
    'SetLightProperties': 'e6f13430c57278bb364aca53a1bf5ebf',
    'SetLinkProperties': 'd534ce1b36ee99de0ffa806c3a6348f0',
    'SetLinkState': '8a5146eb66ae4d26b0860b08f3f271be',
    'SetModelConfiguration': '10e3139d3b669c40afc057d38956fff7',
    'SetModelState': '5b3ab0281d4f5445def017e3a2e4a07b',
    'SetPhysicsProperties': '97e2057080558ce4730434b5fae75c91',
    'SpawnModel': '9ed9c82c96abe1a00c3e8cdaeee24413',
}

OK_RESPONSE = '2ec6f3eff0161f4257b808b12bc830c2'    # success and status_message, nothing else
EMPTY = 'd41d8cd98f00b204e9800998ecf8427e'          # no field at all: MD5 of nothing

# Sums of one half of a service.
HALVES = {
    'SpawnModelRequest': '6d0eba5753761cd57e6263a056b79930',
    'BodyRequestResponse': EMPTY,
    'GetPhysicsPropertiesRequest': EMPTY,
    'GetWorldPropertiesRequest': EMPTY,
    'JointRequestResponse': EMPTY,
    'ApplyBodyWrenchResponse': OK_RESPONSE,
    'ApplyJointEffortResponse': OK_RESPONSE,
    'DeleteLightResponse': OK_RESPONSE,
    'DeleteModelResponse': OK_RESPONSE,
    'SetJointPropertiesResponse': OK_RESPONSE,
    'SetJointTrajectoryResponse': OK_RESPONSE,
    'SetLightPropertiesResponse': OK_RESPONSE,
    'SetLinkPropertiesResponse': OK_RESPONSE,
    'SetLinkStateResponse': OK_RESPONSE,
    'SetModelConfigurationResponse': OK_RESPONSE,
    'SetModelStateResponse': OK_RESPONSE,
    'SetPhysicsPropertiesResponse': OK_RESPONSE,
    'SpawnModelResponse': OK_RESPONSE,
}

JOINT_TYPES = {'REVOLUTE': 0, 'CONTINUOUS': 1, 'PRISMATIC': 2, 'FIXED': 3, 'BALL': 4, 'UNIVERSAL': 5}


def generated(kind, name):
    """Return the generated class ``gazebo_msgs.<kind>.<name>``; a missing one fails the test that asked."""
    module = importlib.import_module('gazebo_msgs.%s' % kind)
    assert hasattr(module, name), '%s has no %s: not in CMakeLists.txt, or not built' % (module.__name__, name)
    return getattr(module, name)


@pytest.mark.parametrize('name', sorted(MESSAGES))
def test_message_has_the_published_sum(name):
    message = generated('msg', name)
    assert message._type == 'gazebo_msgs/' + name
    assert message._md5sum == MESSAGES[name]


@pytest.mark.parametrize('name', sorted(SERVICES))
def test_service_has_the_published_sum(name):
    service = generated('srv', name)
    assert service._type == 'gazebo_msgs/' + name
    assert service._md5sum == SERVICES[name]


@pytest.mark.parametrize('name', sorted(HALVES))
def test_half_of_a_service_has_the_published_sum(name):
    assert generated('srv', name)._md5sum == HALVES[name]


def test_joint_type_constants():
    response = generated('srv', 'GetJointPropertiesResponse')
    assert {name: getattr(response, name) for name in JOINT_TYPES} == JOINT_TYPES


@pytest.mark.parametrize('kind, table', [('msg', MESSAGES), ('srv', SERVICES)])
def test_every_definition_is_in_the_table(kind, table):
    files = {path.stem for path in (PACKAGE_DIR / kind).glob('*.' + kind)}
    assert files == set(table)


@pytest.mark.parametrize('kind, table', [('msg', MESSAGES), ('srv', SERVICES)])
def test_generated_classes_come_from_these_files(kind, table):
    """A copy of the package elsewhere on the path would make the other tests pass for the wrong files."""
    for name in table:
        text = (PACKAGE_DIR / kind / (name + '.' + kind)).read_text().strip()
        cls = generated(kind, name)
        if kind == 'msg':
            assert cls._full_text.startswith(text), name
        else:
            request, response = (half.strip() for half in text.split('---'))
            assert cls._request_class._full_text.startswith(request), name
            assert cls._response_class._full_text.startswith(response), name
