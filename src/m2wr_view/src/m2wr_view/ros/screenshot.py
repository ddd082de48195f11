# SPDX-License-Identifier: BSD-3-Clause
"""Take a picture of rviz on its virtual display, or of a real display."""
from __future__ import annotations

import argparse
import os
import shutil
import sys
import threading
from typing import Any, Callable, List, Mapping, Optional

import rosgraph
import rospy
from PIL import Image, features
from std_srvs.srv import Trigger

from m2wr_view.errors import ViewError
from m2wr_view.screenshots import png_file
from m2wr_view.writers import write_whole

_ANSWER = 45.0              # s; rviz may have to start first
_NODE = "virtual_display"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="screenshot", description=__doc__ + "  Calls the service of virtual_display if that runs, else it "
        "captures the display of DISPLAY. Prints the path of the picture.")
    parser.add_argument("--out", metavar="FILE.png", help="path of the picture (default: the node's folder, or "
                        "screenshot.png here)")
    parser.add_argument("--service", help="name of the service, where there are several virtual displays")
    parser.add_argument("--display", help="take this X display, for instance :0, and call no service")
    return parser


def find_service(state: List[Any], wanted: Optional[str] = None) -> Optional[str]:
    """Return the name of the service to ask, or None.

    Parameters
    ----------
    state : list
        Services of a master: ``[[name, [node]], ...]``.
    wanted : str, optional
        The name that the user gave.

    Raises
    ------
    ViewError
        If there are several, or not the one that is wanted.
    """
    found = sorted(name for name, nodes in state if name.endswith("/screenshot") and name.count("/") >= 2)
    if wanted is not None:
        name = "/" + wanted.strip("/")
        if name not in [entry[0] for entry in state]:
            raise ViewError("there is no service %s; of this kind there are: %s" % (name, ", ".join(found) or "none"))
        return name
    if len(found) > 1:
        raise ViewError("there are several virtual displays; choose with --service: %s" % ", ".join(found))
    return found[0] if found else None


def services() -> List[Any]:
    """Return the services that the master knows; none if there is no master."""
    try:
        return rosgraph.Master("/screenshot").getSystemState()[2]
    except (rosgraph.MasterException, OSError):
        return []


def ask(name: str) -> str:
    """Return the path of the picture that a service has saved; ViewError if it has not."""
    answer: List[Any] = []          # the response, or the error

    def call() -> None:
        try:
            rospy.wait_for_service(name, timeout=5.0)
            answer.append(rospy.ServiceProxy(name, Trigger)())
        except (rospy.ROSException, rospy.ServiceException) as error:
            answer.append(error)

    thread = threading.Thread(target=call, daemon=True)     # rospy's calls have no deadline of their own
    thread.start()
    thread.join(_ANSWER)
    if not answer:
        raise ViewError("service %s has not answered within %g s" % (name, _ANSWER))
    if isinstance(answer[0], Exception):
        raise ViewError("service %s: %s" % (name, answer[0]))
    if not answer[0].success:
        raise ViewError("service %s: %s" % (name, answer[0].message))
    return answer[0].message


def grab(display: str) -> Image.Image:
    """Return the picture on an X display; ViewError if it cannot be read."""
    if not features.check("xcb"):
        raise ViewError("this Pillow cannot read X displays; expected one with XCB (7.1 or newer)")
    from PIL import ImageGrab  # an older Pillow refuses the import itself
    try:
        return ImageGrab.grab(xdisplay=display).convert("RGB")
    except OSError as error:
        raise ViewError("display %s: %s" % (display, error)) from error


def take(options: argparse.Namespace, environment: Mapping[str, str], ask_service: Callable[[str], str] = ask,
         known: Callable[[], List[Any]] = services) -> str:
    """Return the path of a new picture.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command line.
    environment : mapping
        Of the process.
    ask_service : callable
        As :func:`ask`.
    known : callable
        As :func:`services`.

    Raises
    ------
    ViewError
        If no picture can be taken.
    """
    name = None if options.display else find_service(known(), options.service)
    if name is not None:
        path = ask_service(name)
        if options.out is None:
            return path
        try:
            shutil.copyfile(path, options.out)
        except OSError as error:
            raise ViewError("picture %s: %s; it is at %s" % (options.out, error.strerror, path)) from error
        return os.path.abspath(options.out)
    display = options.display or environment.get("DISPLAY")
    if not display:
        raise ViewError("no node %s runs (start with virtual_display:=true) and DISPLAY is not set" % _NODE)
    path = os.path.abspath(options.out or "screenshot.png")
    write_whole(path, png_file(grab(display)))
    return path


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; 0 with a picture, 1 without, 2 for wrong usage."""
    options = _parser().parse_args(rospy.myargv(sys.argv if argv is None else ["screenshot"] + argv)[1:])
    try:
        print(take(options, os.environ))
    except ViewError as error:
        sys.stderr.write("screenshot: %s\n" % error)
        return 1
    return 0
