# SPDX-License-Identifier: BSD-3-Clause
"""The description for dynamic_reconfigure is made of a table of parameters."""
from dynamic_reconfigure.encoding import encode_description

from m2wr_navigation.parameters import Parameter, flag, text
from m2wr_navigation.ros.reconfigure import description

TABLE = {"rate": Parameter(5.0, "Hz", 0.0, 100.0, "rate"), "beams": Parameter(30, "", 0, 250, "beams"),
         "enabled": flag(True, "whether it works"), "planner": text("navfn", "name", changeable=True),
         "frame": text("map", "fixed")}
VALUES = {"rate": 5.0, "beams": 720, "enabled": False, "planner": "navfn", "frame": "map"}


def test_only_changeable_parameters_are_offered_with_their_kind():
    made = description(TABLE, VALUES)
    kinds = {entry["name"]: entry["type"] for entry in made.config_description["parameters"]}
    assert kinds == {"rate": "double", "beams": "int", "enabled": "bool", "planner": "str"}
    assert made.defaults == {"rate": 5.0, "beams": 720, "enabled": False, "planner": "navfn"}


def test_a_number_of_the_start_beyond_the_slider_stays():
    made = description(TABLE, VALUES)
    assert made.max["beams"] == 720 and made.min["beams"] == 0


def test_dynamic_reconfigure_can_send_the_description():
    sent = encode_description(description(TABLE, VALUES))
    assert [parameter.name for parameter in sent.groups[0].parameters] == ["rate", "beams", "enabled", "planner"]
