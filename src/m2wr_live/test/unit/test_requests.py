# SPDX-License-Identifier: BSD-3-Clause
"""What a page's own script may send."""
import json

import pytest

from m2wr_live.web.requests import Drive, read_drive
from m2wr_view.errors import ViewError


def test_a_wish_to_drive_is_read():
    text = json.dumps({"topic": "/cmd_vel", "forward": 1, "left": -0.5})
    assert read_drive(text) == Drive("/cmd_vel", 1.0, -0.5)


@pytest.mark.parametrize("text", [
    "", "no JSON", "[]", "1", "null", b"{}", "{}", '{"topic": 1, "forward": 0, "left": 0}', "[" * 900, "x" * 2000,
    '{"topic": "/a", "forward": 1.1, "left": 0}', '{"topic": "/a", "forward": NaN, "left": 0}',
    '{"topic": "/a", "forward": Infinity, "left": 0}', '{"topic": "/a", "forward": true, "left": 0}',
    '{"topic": "/a", "forward": "1", "left": 0}', '{"topic": "/a", "forward": 0}'])
def test_anything_else_is_refused_with_what_is_expected(text):
    with pytest.raises(ViewError, match="expected"):
        read_drive(text)
