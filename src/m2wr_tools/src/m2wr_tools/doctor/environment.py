# SPDX-License-Identifier: BSD-3-Clause
"""Environment variables, names and addresses, space on disk; display, graphics and film."""
from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, List, Mapping, Optional, Tuple
from urllib.parse import urlparse

from m2wr_tools.doctor.finding import ok, problem, warning

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.machine import Machine

_ENVIRONMENT, _DISPLAY = "environment", "display"
_MASTER = "http://localhost:11311"
_ENOUGH, _LITTLE = 2 << 30, 200 << 20       # bytes
_LOCAL_DISPLAY = re.compile(r"^(?:unix)?:(\d+)(?:\.\d+)?$")
_DISPLAY_NAME = re.compile(r"^(.+):(\d+)(?:\.\d+)?$")
_X_PORT = 6000
_LOOPBACK = ("127.", "::1")


def master_address(environ: Mapping[str, str]) -> Optional[Tuple[str, int]]:
    """Return host and port of ROS_MASTER_URI, or None if it is no such address."""
    try:
        address = urlparse(environ.get("ROS_MASTER_URI") or _MASTER)
        if address.scheme == "http" and address.hostname and address.port:
            return address.hostname, address.port
    except ValueError:
        pass        # a port that is no number
    return None


def check_environment(machine: Machine) -> List[Finding]:
    """Return the findings on ROS's variables and on the disk."""
    return _master_name(machine) + _own_name(machine) + _disk(machine)


def _master_name(machine: Machine) -> List[Finding]:
    address = master_address(machine.environ)
    value = machine.environ.get("ROS_MASTER_URI")
    if address is None:
        return [problem(_ENVIRONMENT, "ROS_MASTER_URI is \"%s\"" % value,
                        "expected http://HOST:PORT: export ROS_MASTER_URI=%s" % _MASTER)]
    if not machine.addresses(address[0]):
        return [problem(_ENVIRONMENT, "the host of ROS_MASTER_URI, %s, has no address" % address[0],
                        "export ROS_MASTER_URI=%s, or add the host to /etc/hosts" % _MASTER)]
    return [ok(_ENVIRONMENT, "ROS_MASTER_URI: %s", value or _MASTER + " (not set, the default)")]


def _own_name(machine: Machine) -> List[Finding]:
    """Check the name under which other nodes connect to those of this machine."""
    environ = machine.environ
    variable = next((name for name in ("ROS_HOSTNAME", "ROS_IP") if environ.get(name)), None)
    host = environ[variable] if variable else machine.host_name()
    what = "%s is %s" % (variable, host) if variable else "the host name is %s" % host
    addresses = machine.addresses(host)
    if not addresses:
        return [problem(_ENVIRONMENT, what + ", which has no address: nodes cannot connect to each other",
                        "export ROS_HOSTNAME=localhost, if all nodes run on one machine")]
    if not any(machine.is_local(address) for address in addresses):
        return [problem(_ENVIRONMENT, "%s, but %s is not an address of this machine: nodes cannot connect to each other"
                        % (what, addresses[0]), "unset ROS_IP ROS_HOSTNAME, or export ROS_HOSTNAME=localhost")]
    found = [ok(_ENVIRONMENT, what)] if variable else _open(machine)
    elsewhere = _master_elsewhere(machine)
    if variable and elsewhere and all(address.startswith(_LOOPBACK) for address in addresses):
        found.append(problem(
            _ENVIRONMENT, "the master is on %s, but %s: nodes there cannot connect to nodes here" % (elsewhere, what),
            "export ROS_IP=, with the address of this machine in that network, and unset ROS_HOSTNAME"))
    if environ.get("ROS_IP") and environ.get("ROS_HOSTNAME"):
        found.append(warning(_ENVIRONMENT, "ROS_IP and ROS_HOSTNAME are both set; the latter is used",
                             "unset ROS_IP"))
    return found


def _master_elsewhere(machine: Machine) -> Optional[str]:
    """Return the host of ROS_MASTER_URI if it is another machine, or None."""
    master = master_address(machine.environ)
    addresses = machine.addresses(master[0]) if master else []
    return master[0] if master and addresses and not any(machine.is_local(address) for address in addresses) else None


def _open(machine: Machine) -> List[Finding]:
    """Report that nodes listen at every address if no variable limits them."""
    elsewhere = _master_elsewhere(machine)
    if elsewhere:
        return [ok(_ENVIRONMENT, "nodes accept connections from other machines, as the master is on %s", elsewhere)]
    return [warning(_ENVIRONMENT, "neither ROS_IP nor ROS_HOSTNAME is set: nodes and master accept connections from "
                    "every machine of the network, without a password",
                    "if all nodes run on one machine: source devel/setup.bash of the workspace again, or export "
                    "ROS_IP=127.0.0.1")]


def _disk(machine: Machine) -> List[Finding]:
    home = machine.environ.get("ROS_HOME") or os.path.join(machine.environ.get("HOME", "/"), ".ros")
    places = (("logs (ROS_LOG_DIR)", machine.environ.get("ROS_LOG_DIR") or os.path.join(home, "log"), problem,
               "export ROS_LOG_DIR=/tmp/roslog, or correct the permissions of that folder"),
              ("bags and pictures (working directory)", machine.folder, warning,
               "start roslaunch in another folder, or give record:= and pictures:= an absolute path"))
    found = []
    for what, folder, level, cure in places:
        free = machine.free_bytes(folder)
        if not machine.writable(folder):
            found.append(level(_ENVIRONMENT, "%s is not writable; it is the folder for %s" % (folder, what), cure))
        elif free is not None and free < _ENOUGH:
            found.append((problem if free < _LITTLE else warning)(
                _ENVIRONMENT, "only %d MB are free in %s, the folder for %s" % (free >> 20, folder, what),
                "rosclean purge deletes old logs; old bags are in the folders roslaunch was started in"))
        else:
            found.append(ok(_ENVIRONMENT, "%s is writable%s: %s", folder,
                            "" if free is None else ", %d GB free" % (free >> 30), what))
    return found


def check_display(machine: Machine) -> List[Finding]:
    """Return the findings on the display, rviz and films."""
    found = _screen(machine)
    if not machine.which("Xvfb"):
        found.append(warning(_DISPLAY, "Xvfb is missing: no rviz on a virtual display", "sudo apt install xvfb"))
    if not machine.which("ffmpeg"):
        found.append(warning(_DISPLAY, "ffmpeg is missing: pictures:=run.mp4 is not possible, .gif is",
                             "sudo apt install ffmpeg"))
    return found


def _screen(machine: Machine) -> List[Finding]:
    name = machine.environ.get("DISPLAY", "")
    if not name:
        return [ok(_DISPLAY, "DISPLAY is not set: launch files start no rviz; pictures:=true draws without a display")]
    local, remote = _LOCAL_DISPLAY.match(name), _DISPLAY_NAME.match(name)
    if local:
        there = machine.accepts_unix("/tmp/.X11-unix/X" + local.group(1))
    elif remote:
        there = machine.accepts(remote.group(1), _X_PORT + int(remote.group(2)))
    else:
        return [warning(_DISPLAY, "DISPLAY is \"%s\"" % name, "expected a name like :0; unset DISPLAY, or gui:=false")]
    if not there:
        return [warning(_DISPLAY, "DISPLAY %s does not answer: rviz cannot start" % name,
                        "unset DISPLAY, or gui:=false; over ssh: ssh -X, in a container: share /tmp/.X11-unix")]
    return [ok(_DISPLAY, "DISPLAY %s answers", name)] + _graphics(machine)


def _graphics(machine: Machine) -> List[Finding]:
    if not machine.which("glxinfo"):
        return []       # cannot be checked; rviz reports it
    code, text = machine.run(["glxinfo", "-B"])
    renderer = re.search(r"OpenGL renderer string:\s*(.*)", text)
    if code != 0 or renderer is None:
        return [warning(_DISPLAY, "OpenGL does not work on this display: rviz will exit at once",
                        "export LIBGL_ALWAYS_SOFTWARE=1, or gui:=false")]
    return [ok(_DISPLAY, "OpenGL: %s", renderer.group(1))]
