# SPDX-License-Identifier: BSD-3-Clause
"""Plugins are found by the names that parameter files use."""
import importlib

import pytest

from m2wr_navigation import registry

TABLES = {"PLANNERS": registry.PLANNERS, "CONTROLLERS": registry.CONTROLLERS, "RECOVERIES": registry.RECOVERIES,
          "LAYERS": registry.LAYERS}
TABLE = {"costs/Map": "m2wr_navigation.costmap.costmap:Costmap"}


@pytest.mark.parametrize("name", ["costs/Map", "Map", "other/Map", "costs::Map"])
def test_a_plugin_is_found_with_and_without_its_package(name):
    assert registry.find(TABLE, name).__name__ == "Costmap"


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(registry.UnknownPluginError, match="there is no 'x/Y'; known are costs/Map"):
        registry.find(TABLE, "x/Y")


def test_every_line_of_the_tables_names_a_class():
    for table in TABLES.values():
        for target in table.values():
            module, _, name = target.partition(":")
            assert isinstance(getattr(importlib.import_module(module), name), type), target
