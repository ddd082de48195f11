# SPDX-License-Identifier: BSD-3-Clause
"""Who may open a page, and what its script may send."""
import json

import pytest

from m2wr_live.web.access import Access, is_loopback
from m2wr_live.web.requests import Drive, read_drive
from m2wr_view.errors import ViewError

OPEN, CLOSED = Access("", "c"), Access("secret", "c")


@pytest.mark.parametrize("host, expected", [("localhost", True), ("127.0.0.1", True), ("::1", True), ("[::1]", True),
                                            ("127.8.8.8", True), ("0.0.0.0", False), ("example.org", False),
                                            ("localhost.example.org", False), ("", False)])
def test_loopback_is_this_machine_only(host, expected):
    assert is_loopback(host) is expected


@pytest.mark.parametrize("headers", [{"Host": "localhost:8080"}, {"Host": "127.0.0.1:1"}, {"Host": "[::1]:8080"},
                                     {"Host": "localhost:8080", "Origin": "http://localhost:8080"}])
def test_this_machine_needs_no_token(headers):
    assert OPEN.refusal("/", headers) is None


@pytest.mark.parametrize("headers", [{}, {"Host": "evil.example:8080"},
                                     {"Host": "localhost:8080", "Origin": "http://evil.example"},
                                     {"Host": "localhost:8080", "Origin": "http://localhost:9999"},
                                     {"Host": "localhost:8080", "Origin": "null"}])
def test_other_sites_are_refused(headers):
    assert OPEN.refusal("/", headers)


@pytest.mark.parametrize("path, cookie, allowed", [
    ("/", "", False), ("/?token=secret", "", True), ("/?token=Secret", "", False), ("/", "c=secret", True),
    ("/", "a=b; c=secret", True), ("/", "d=secret", False), ("/?token=", "c=", False), ("/?token=%FF", "", False)])
def test_a_token_is_needed_where_there_is_one(path, cookie, allowed):
    assert (CLOSED.refusal(path, {"Host": "any.example", "Cookie": cookie}) is None) is allowed


def test_only_a_link_with_the_token_sets_the_cookie():
    assert "HttpOnly" in CLOSED.cookie_line("/?token=secret")
    assert CLOSED.cookie_line("/") is None and OPEN.cookie_line("/?token=") is None


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
