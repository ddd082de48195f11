# SPDX-License-Identifier: BSD-3-Clause
"""The reference has every column, key and generator; the example is a study."""
import os
import re

from m2wr_campaign.store.schema import APPLICATION, RUN_COLUMNS, VERSION, WORLD_COLUMNS
from m2wr_campaign.study.study_file import read_study
from m2wr_campaign.worlds.generators import GENERATORS

HERE = os.path.dirname(os.path.abspath(__file__))
REFERENCE = os.path.join(HERE, "..", "..", "..", "..", "docs", "reference", "campaigns.md")
EXAMPLE = os.path.join(HERE, "..", "..", "examples", "bugs.yaml")


def test_the_reference_has_the_columns_of_the_tables():
    with open(REFERENCE, encoding="utf-8") as file:
        text = file.read()
    rows = re.findall(r"^\| `(\w+)` \| (\w+) \| (.+) \|$", text, re.M)
    for columns in (RUN_COLUMNS, WORLD_COLUMNS):
        for name, (kind, meaning) in columns.items():
            assert (name, kind.split()[0].lower(), meaning) in rows
    assert str(APPLICATION) in text and "the version of the tables, {}".format(VERSION) in text


def test_the_reference_has_the_generators_and_their_defaults():
    with open(REFERENCE, encoding="utf-8") as file:
        text = file.read()
    for name, generator in GENERATORS.items():
        row = re.search(r"^\| `{}` \|.*$".format(name), text, re.M).group()
        for parameter, table in generator.parameters.items():
            assert "`{}` {:g}".format(parameter, table.default) in row


def test_the_example_is_a_study():
    study = read_study(EXAMPLE)
    assert study.name == "bugs" and study.count == 10 * 6 * 2
