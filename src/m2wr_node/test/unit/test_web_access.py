# SPDX-License-Identifier: BSD-3-Clause
"""Who may use a web server: this machine, or who has the token."""
import pytest

from m2wr_node.web_access import Access, forwarded_sites, is_loopback

OPEN, CLOSED = Access("", "c"), Access("secret", "c")
LOCAL = Access("", "c", local_pages=True, origins=["https://app.example"])


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


@pytest.mark.parametrize("host, origin, allowed", [
    ("a-8080.app.example", "https://a-8080.app.example", True), ("localhost:8080", "https://a-8080.app.example", True),
    ("a-8080.app.example", "http://localhost:8080", True), ("localhost:8080", "https://b-8080.app.example", False),
    ("b-8080.app.example", "https://b-8080.app.example", False), ("a-8080.app.example", "http://evil.example", False)])
def test_pages_that_a_codespace_forwards_are_its_own(host, origin, allowed):
    sites = forwarded_sites({"CODESPACE_NAME": "a", "GITHUB_CODESPACES_PORT_FORWARDING_DOMAIN": "app.example"}, 8080)
    access = Access("", "c", sites=sites)
    assert (access.refusal("/", {"Host": host, "Origin": origin}) is None) is allowed
    assert forwarded_sites({}, 8080) == []


@pytest.mark.parametrize("path, cookie, allowed", [
    ("/", "", False), ("/?token=secret", "", True), ("/?token=Secret", "", False), ("/", "c=secret", True),
    ("/", "a=b; c=secret", True), ("/", "d=secret", False), ("/?token=", "c=", False), ("/?token=%FF", "", False)])
def test_a_token_is_needed_where_there_is_one(path, cookie, allowed):
    assert (CLOSED.refusal(path, {"Host": "any.example", "Cookie": cookie}) is None) is allowed


@pytest.mark.parametrize("origin, path, allowed", [
    ("http://lab.example:8080", "/", True), ("http://lab.example:8000", "/", False), ("null", "/", False),
    ("http://evil.example", "/", False), ("http://evil.example", "/?token=secret", True)])
def test_a_cookie_is_for_pages_of_this_server_only(origin, path, allowed):
    headers = {"Host": "lab.example:8080", "Origin": origin, "Cookie": "c=secret"}
    assert (CLOSED.refusal(path, headers) is None) is allowed


def test_only_a_link_with_the_token_sets_the_cookie():
    assert "HttpOnly" in CLOSED.cookie_line("/?token=secret")
    assert CLOSED.cookie_line("/") is None and OPEN.cookie_line("/?token=") is None


@pytest.mark.parametrize("origin, allowed", [
    ("http://localhost:9999", True), ("https://127.0.0.1", True), ("http://[::1]:3000", True),
    ("https://app.example", True), ("http://app.example", False), ("https://app.example.evil", False), ("null", False),
    ("http://evil.example", False), ("http://localhost.evil.example", False), ("file://", False), ("", False),
    ("http://[", False), ("localhost:9999", False), ("ftp://localhost", False)])
def test_pages_of_this_machine_and_named_ones_may_ask(origin, allowed):
    assert (LOCAL.refusal("/", {"Host": "localhost:9090", "Origin": origin}) is None) is allowed


def test_an_open_server_still_refuses_pages_of_other_sites():
    access = Access("", "c", any_host=True)
    assert access.refusal("/", {"Host": "robot.example:9090"}) is None
    assert access.refusal("/", {"Host": "robot.example:9090", "Origin": "http://robot.example:9090"}) is None
    assert access.refusal("/", {"Host": "robot.example:9090", "Origin": "http://evil.example"})


def test_programs_that_open_files_can_be_named():
    access = Access("", "c", origins=["file://"])
    assert access.refusal("/", {"Host": "localhost:8765", "Origin": "file://"}) is None
    assert access.refusal("/", {"Host": "localhost:8765", "Origin": "null"})
