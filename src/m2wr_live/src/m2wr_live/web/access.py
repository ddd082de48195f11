# SPDX-License-Identifier: BSD-3-Clause
"""Who may open a page: a token in the link, or programs and pages of this machine only."""
from __future__ import annotations

import hmac
import ipaddress
from typing import Mapping, Optional
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


class Access:
    """Decides on requests.

    Without a token a request must name this machine, and a page that sends it must be of this server. So neither a page
    of another site nor a name that another site lets point to this machine gets in.

    Parameters
    ----------
    token : str
        Expected in the link or in the cookie; empty: none.
    cookie : str
        Name of the cookie that keeps the token.
    """

    def __init__(self, token: str, cookie: str) -> None:
        self.token, self.cookie = token, cookie

    def refusal(self, path: str, headers: Mapping[str, str]) -> Optional[str]:
        """Return why a request is refused, or None.

        Parameters
        ----------
        path : str
            With the query.
        headers : mapping of str to str
            Of the request; names without regard to case.
        """
        if self.token:          # browsers send the cookie only for pages of this server
            return None if self._has_token(path, headers) else "the link has no valid token; expected the link " \
                "that the live view has printed"
        host, origin = headers.get("Host", ""), headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return "a page of %s asks; expected one of %s" % (origin[:100], host[:100])
        name = urlsplit("//" + host).hostname or ""
        return None if is_loopback(name) else "the host is %r; expected localhost, or a link with a token" % host[:100]

    def _has_token(self, path: str, headers: Mapping[str, str]) -> bool:
        given = parse_qs(urlsplit(path).query).get(TOKEN, [])
        for part in headers.get("Cookie", "").split(";"):
            name, _, value = part.strip().partition("=")
            if name == self.cookie:
                given.append(value)
        return any(hmac.compare_digest(value.encode(), self.token.encode()) for value in given)

    def cookie_line(self, path: str) -> Optional[str]:
        """Return the header Set-Cookie for a link with the token, or None."""
        if self.token and TOKEN in parse_qs(urlsplit(path).query):
            return "%s=%s; HttpOnly; SameSite=Strict; Path=/" % (self.cookie, self.token)
        return None
