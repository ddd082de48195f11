# SPDX-License-Identifier: BSD-3-Clause
"""Parameters without a master: values that are accepted, and errors."""
import math

import pytest

from motion_plan import ros_parameters


@pytest.fixture
def parameters(monkeypatch):
    """A parameter server that is a dict."""
    values = {}
    monkeypatch.setattr(ros_parameters.rospy, 'has_param', values.__contains__)
    monkeypatch.setattr(ros_parameters.rospy, 'get_param', lambda name, default=None: values.get(name, default))
    return values


def test_missing_parameter_is_one_sentence_with_the_remedy(parameters):
    with pytest.raises(ros_parameters.NodeError) as error:
        ros_parameters.required_number('des_pos_x', 'x of the goal in metres', 'bug2.launch')
    text = str(error.value)
    assert 'des_pos_x' in text and 'rosparam set des_pos_x' in text and 'roslaunch motion_plan bug2.launch' in text
    assert '\n' not in text


@pytest.mark.parametrize('value', [math.nan, math.inf, 'here', None, [1], True])
def test_a_parameter_that_is_no_number_is_named(parameters, value):
    parameters['des_pos_y'] = value
    with pytest.raises(ros_parameters.NodeError, match='des_pos_y.*finite'):
        ros_parameters.required_number('des_pos_y', 'y of the goal', 'bug2.launch')


@pytest.mark.parametrize('value', [3, -2.5, '4.5'])
def test_numbers_are_taken(parameters, value):
    parameters['des_pos_y'] = value
    assert ros_parameters.required_number('des_pos_y', 'y of the goal', 'bug2.launch') == float(value)
