# SPDX-License-Identifier: BSD-3-Clause
"""Parameters as JSON, with limits."""
import pytest

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.rosbridge.globs import Globs
from rosapi_services.parameters import Parameters


class Server(dict):
    """A parameter server."""

    set_param, has_param, delete_param = dict.__setitem__, dict.__contains__, dict.pop

    def get_param(self, name, default):
        return self.get(name, default)

    def get_param_names(self):
        return list(self)

    def search_param(self, name):
        return "/" + name if "/" + name in self else None


@pytest.fixture
def server():
    return Server({"/a": 1.5, "/b/c": "text", "/nan": float("nan")})


def test_values_are_json(server):
    parameters = Parameters(server, Globs("", "params_glob"))
    assert [parameters.get(name, "") for name in ("/a", "/b/c", "/nan", "/none")] == ["1.5", '"text"', "null", "null"]
    assert parameters.get("/none", "[1]") == "[1]" and parameters.get("/none", "word") == '"word"'
    parameters.set("/new", '{"x": [true]}')
    parameters.set("/word", "no JSON")
    assert server["/new"] == {"x": [True]} and server["/word"] == "no JSON"
    parameters.delete("/new")
    parameters.delete("/never")
    assert not parameters.has("/new") and parameters.search("a") == "/a" and parameters.search("z") == ""


@pytest.mark.parametrize("value, reason", [("null", "null"), ("[" * 100000, "deep"), ("1" * 10_000_001, "at most")],
                         ids=["null", "deep", "long"])
def test_odd_values_are_refused(server, value, reason):
    with pytest.raises(BridgeError, match=reason):
        Parameters(server, Globs("", "params_glob")).set("/a", value)
    assert server["/a"] == 1.5


def test_only_allowed_names_are_used(server):
    parameters = Parameters(server, Globs("[/b/*]", "params_glob"))
    assert parameters.names() == ["/b/c"] and parameters.get("/b/c", "") == '"text"'
    for action in (lambda: parameters.get("/a", ""), lambda: parameters.set("/a", "1"), lambda: parameters.has("/a"),
                   lambda: parameters.delete("/a"), lambda: parameters.search("/a"), lambda: parameters.get("", "")):
        with pytest.raises(BridgeError):
            action()
