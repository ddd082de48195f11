# SPDX-License-Identifier: BSD-3-Clause
"""Who may use a web server of ours: a token in the link, or programs and pages of this machine only."""
from __future__ import annotations

import hmac
import ipaddress
from typing import Collection, List, Mapping, Optional, Sequence
from urllib.parse import parse_qs, urlsplit

TOKEN = "token"             # name of the query's field


def is_loopback(host: str) -> bool:
    """Return whether a host name or address is of this machine only."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def _host_of(address: str) -> str:
    """Return the host name of ``//host:port``, or an empty text."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def forwarded_sites(environment: Mapping[str, str], port: int) -> List[str]:
    """Return the names under which GitHub Codespaces forwards a port of this machine; elsewhere none.

    Its proxy has been seen to replace the name in ``Host`` or in ``Origin`` by the local one, so that one counts too.

    Parameters
    ----------
    environment : mapping of str to str
        With the variables that a Codespace sets: ``CODESPACE_NAME`` and ``GITHUB_CODESPACES_PORT_FORWARDING_DOMAIN``.
    port : int
    """
    name, domain = (environment.get(key, "") for key in ("CODESPACE_NAME", "GITHUB_CODESPACES_PORT_FORWARDING_DOMAIN"))
    return ["%s-%d.%s" % (name, port, domain), "localhost:%d" % port] if name and domain else []


class Access:
    """Decides on requests.

    Without a token a request must name this machine, and a page that sends it must be of this server. So neither a page
    of another site nor a name that another site lets point to this machine gets in. A browser lets any page open a
    websocket to any address and only says whose page it is, so this is checked here.

    Parameters
    ----------
    token : str
        Expected in the link or in the cookie; empty: none.
    cookie : str
        Name of the cookie that keeps the token.
    local_pages : bool
        Pages that any server of this machine has sent may ask too, such as a page of ``python3 -m http.server``.
    origins : collection of str
        Other pages that may ask, as browsers write them, such as ``https://app.example`` and ``null``.
    any_host : bool
        A request may name any machine. Only for a server that is open to a network without a token.
    sites : sequence of str
        Names under which a service forwards pages to this machine, such as that of a Codespace; the service checks who
        opens them.
    """

    def __init__(self, token: str, cookie: str, local_pages: bool = False, origins: Collection[str] = (),
                 any_host: bool = False, sites: Sequence[str] = ()) -> None:
        self.token, self.cookie = token, cookie
        self._sites = frozenset(site.lower() for site in sites)
        self._local_pages, self._any_host = local_pages, any_host
        self._origins = frozenset(origin.rstrip("/").lower() for origin in origins)

    def refusal(self, path: str, headers: Mapping[str, str]) -> Optional[str]:
        """Return why a request is refused, or None.

        Parameters
        ----------
        path : str
            With the query.
        headers : mapping of str to str
            Of the request; names without regard to case.
        """
        host, origin = headers.get("Host", ""), headers.get("Origin")
        if self.token and self._is_token(parse_qs(urlsplit(path).query).get(TOKEN, [])):
            return None
        if self.token and not self._is_token(self._cookies(headers)):
            return "the link has no valid token; expected the link that was printed at the start"
        # cookies do not know ports: a browser sends that of this server for a page of any server of the machine
        if origin is not None and not self._is_known(origin, host):
            return "a page of %s asks; expected one of %s" % (origin[:100], host[:100])
        if self.token:
            return None
        name = _host_of("//" + host)
        return None if self._any_host or is_loopback(name) or host.lower() in self._sites else \
            "the host is %r; expected localhost, or a link with a token" % host[:100]

    def _is_known(self, origin: str, host: str) -> bool:
        if origin.lower().rstrip("/") in self._origins:
            return True
        scheme, mark, place = origin.lower().partition("://")
        return bool(mark) and (place == host.lower() or place in self._sites or (
            self._local_pages and scheme in ("http", "https") and is_loopback(_host_of("//" + place))))

    def _is_token(self, given: Sequence[str]) -> bool:
        return any(hmac.compare_digest(value.encode(), self.token.encode()) for value in given)

    def _cookies(self, headers: Mapping[str, str]) -> List[str]:
        """Return the values of this server's cookie."""
        parts = (part.strip().partition("=") for part in headers.get("Cookie", "").split(";"))
        return [value for name, _, value in parts if name == self.cookie]

    def cookie_line(self, path: str) -> Optional[str]:
        """Return the header Set-Cookie for a link with the token, or None."""
        if self.token and TOKEN in parse_qs(urlsplit(path).query):
            return "%s=%s; HttpOnly; SameSite=Strict; Path=/" % (self.cookie, self.token)
        return None
