# SPDX-License-Identifier: BSD-3-Clause
"""SDF documents for the tests of this folder: worlds and models from their parts."""
import pytest

from m2wr_sim.errors import WorldError
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world

QUARTER = "1.5707963267948966"
BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
LINK = '<link name="link"><collision name="c">' + BOX + "</collision></link>"


def world(*parts, version="1.6", resolve_model=None):
    text = '<sdf version="{}">\n<world name="w">\n{}\n</world></sdf>'.format(version, "\n".join(parts))
    return load_world(text, "a.world", resolve_model)


def model(body, version="1.6", name="m"):
    text = '<sdf version="{}"><model name="{}">\n{}\n</model></sdf>'.format(version, name, body)
    found, = load_sdf_models(text, "m.sdf")
    return found


def refusal(*parts, **options):
    with pytest.raises(WorldError) as caught:
        world(*parts, **options)
    return str(caught.value)


GOOD = '<model name="good"><static>true</static><link name="link"/></model>'


def told(*parts, **options):
    """Return a world with bad parts and a good model behind them, and the one note about it; the good one must load."""
    loaded = world(*(parts + (GOOD,)), **options)
    assert loaded.models[-1].name == "good"
    note, = loaded.notes
    return loaded, note


def static(name, body=LINK, pose=""):
    return '<model name="{}"><static>true</static>{}{}</model>'.format(name, pose, body)


TURNED = '<link name="a"/><link name="b"><pose>0 0 0 0 0 {}</pose></link>'.format(QUARTER)


def joint(axis="", kind="revolute", more=""):
    return '<joint name="j" type="{}"><parent>a</parent><child>b</child>{}{}</joint>'.format(kind, axis, more)
