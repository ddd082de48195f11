# SPDX-License-Identifier: BSD-3-Clause
"""Private parameters of a bridge, each checked."""
from __future__ import annotations

import logging
import math
import secrets
import ssl
from typing import Any, List, Optional

import rospy

from m2wr_bridge.errors import BridgeError
from m2wr_node.numbers import number
from m2wr_node.web_access import Access, is_loopback

log = logging.getLogger("m2wr_bridge")

OPEN = "off"                # value of ~token that lets a network in without one


def log_through_ros() -> None:
    """Send this package's log through rospy."""
    own = logging.getLogger("m2wr_bridge")
    own.setLevel(logging.INFO)
    own.propagate = False
    own.handlers = logging.getLogger("rosout").handlers


def text(name: str, default: str) -> str:
    """Return a parameter; numbers and None, which YAML makes of some words, are texts too.

    Parameters
    ----------
    name : str
    default : str

    Raises
    ------
    BridgeError
        If it is a list or a dictionary.
    """
    value = rospy.get_param("~" + name, default)
    if value is None or isinstance(value, (dict, list)):
        raise BridgeError("parameter ~%s is %r; expected a text" % (name, value))
    return str(value)


def flag(name: str, default: bool) -> bool:
    """Return a parameter that is true or false.

    Parameters
    ----------
    name : str
    default : bool

    Raises
    ------
    BridgeError
        If it is anything else.
    """
    value = rospy.get_param("~" + name, default)
    if not isinstance(value, bool):
        raise BridgeError("parameter ~%s is %r; expected true or false" % (name, value))
    return value


def amount(name: str, default: float, most: float = 1e9) -> float:
    """Return a parameter that is a number from 0 on; the text "None" is the default.

    Parameters
    ----------
    name : str
    default : float
    most : float

    Raises
    ------
    BridgeError
        If it is anything else.
    """
    given = rospy.get_param("~" + name, default)
    if given == "None":
        return default
    value: Any = number(given)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= most or \
            not math.isfinite(value):
        raise BridgeError("parameter ~%s is %r; expected a number from 0 to %g" % (name, given, most))
    return float(value)


def whole(name: str, default: int, most: int) -> int:
    """Return a parameter that is a whole number from 0 on.

    Parameters
    ----------
    name : str
    default, most : int

    Raises
    ------
    BridgeError
        If it is anything else.
    """
    value = amount(name, default, most)
    if value != int(value):
        raise BridgeError("parameter ~%s is %r; expected a whole number" % (name, value))
    return int(value)


def access_of(host: str, port: int, origins: List[str]) -> Access:
    """Return who may connect to an address, from ~token.

    Parameters
    ----------
    host : str
    port : int
    origins : list of str
        Pages of other sites that may connect.
    """
    token = text("token", "")
    if is_loopback(host):
        return Access("" if token == OPEN else token, "m2wr_bridge_%d" % port, local_pages=True, origins=origins)
    if token == OPEN:
        log.warning("%s:%d is open without a token: all who reach it can drive the robot", host, port)
        return Access("", "", local_pages=True, origins=origins, any_host=True)
    return Access(token or secrets.token_urlsafe(16), "m2wr_bridge_%d" % port)


def tls_of() -> Optional[ssl.SSLContext]:
    """Return the context for encrypted connections, from ~ssl, ~certfile and ~keyfile; None where ~ssl is false.

    Raises
    ------
    BridgeError
        If it cannot be used.
    """
    certificate, key = text("certfile", ""), text("keyfile", "")
    if not flag("ssl", bool(certificate)):
        return None
    if not certificate:
        raise BridgeError("ssl is true and parameter ~certfile is empty; expected the path of a certificate")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key or None)
    except (OSError, ValueError) as error:
        raise BridgeError("certificate %r with key %r cannot be used: %s" % (certificate, key, error)) from error
    return context


def link(scheme: str, host: str, port: int, access: Access) -> str:
    """Return the address for a client, with the token.

    Parameters
    ----------
    scheme : str
        ``ws`` or ``wss``.
    host : str
    port : int
    access : Access
    """
    shown = "localhost" if is_loopback(host) or host in ("0.0.0.0", "::", "") else host
    return "%s://%s:%d%s" % (scheme, shown, port, "/?token=" + access.token if access.token else "")
