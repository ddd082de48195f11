"""Messages and parameters at the edge to ROS; needs the message classes, no master."""
import io

import numpy as np
import pytest
from genpy import Time
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMapResponse

from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.occupancy import Grid
from m2wr_gmapping.ros.convert import ArrayGrid, ArrayMapAnswer, covariance36, grid_message
from m2wr_gmapping.ros import params
from m2wr_gmapping.ros.params import NODE_PARAMETERS, NodeOptions, read_parameters
from m2wr_gmapping.ros.reconfigure import CHANGEABLE, changed, description


@pytest.fixture
def message():
    data = np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (7, 5))
    return grid_message(Grid(data, 0.25, np.array([-1.0, 2.0])), "a/map", Time(3, 4))


def written(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_a_grid_is_written_as_the_ordinary_message_is(message):
    plain = OccupancyGrid().deserialize(written(message))
    assert plain.header == message.header and plain.info == message.info
    assert list(plain.data) == message.data.tolist()
    assert written(plain) == written(message)


def test_a_grid_is_read_back(message):
    again = ArrayGrid().deserialize(written(message))
    assert again.header == message.header and again.info == message.info
    np.testing.assert_array_equal(again.data, message.data)


def test_the_answer_of_the_service_is_the_ordinary_one(message):
    answer = ArrayMapAnswer(message)
    plain = GetMapResponse().deserialize(written(answer))
    assert list(plain.map.data) == message.data.tolist()
    np.testing.assert_array_equal(ArrayMapAnswer().deserialize(written(answer)).map.data, message.data)


def test_the_covariance_stands_at_x_y_and_yaw():
    full = np.array(covariance36(np.arange(1.0, 10.0).reshape(3, 3))).reshape(6, 6)
    np.testing.assert_array_equal(full[np.ix_([0, 1, 5], [0, 1, 5])], np.arange(1.0, 10.0).reshape(3, 3))
    assert np.count_nonzero(full) == 9


def test_parameters_of_the_node_are_taken_out_and_named_when_wrong():
    config, options, warnings = read_parameters(
        {"particles": 12.0, "save_on_exit": "plan", "scan_queue": "many", "settle_time": 2, "bogus": 1,
         "sigma": "wide"})
    assert config["particles"] == 12
    assert options == NodeOptions(save_on_exit="plan", settle_time=2.0)
    text = "\n".join(warnings)
    assert "scan_queue: 'many'" in text and "~bogus" in text and "sigma: 'wide'" in text
    assert len(warnings) == 3


@pytest.mark.parametrize("given, wanted", [({}, (None, None)), ({"maxRange": 8}, (8.0, None)),
                                           ({"maxUrange": 3.5, "particles": 4}, (None, 3.5)),
                                           ({"maxRange": -1}, (7.0, 6.0)), ({"maxRange": "far"}, (None, None))])
def test_ranges_are_those_at_the_first_scan(monkeypatch, given, wanted):
    monkeypatch.setattr(params, "private_parameters", lambda: given)
    monkeypatch.setattr(params.rospy, "logwarn", lambda *_: None)
    config = params.read_ranges(GmappingConfig.from_mapping({"maxRange": 7, "maxUrange": 6, "particles": 9}))
    assert (config["maxRange"], config["maxUrange"], config["particles"]) == wanted + (9,)


def test_every_option_of_the_node_is_told():
    assert set(NODE_PARAMETERS) == set(NodeOptions.__dataclass_fields__)


def test_changeable_parameters_change_and_the_others_stay():
    config = GmappingConfig.from_mapping({"particles": 7, "linearUpdate": 500})
    after = changed(config, {"linearUpdate": 2, "throttle_scans": 3.0, "particles": 9})
    assert (after["linearUpdate"], after["throttle_scans"], after["particles"]) == (2.0, 3, 7)
    told = description(config)
    assert set(told.defaults) == set(CHANGEABLE)
    assert told.max["linearUpdate"] == 500.0        # a value beyond the slider is no error
