# SPDX-License-Identifier: BSD-3-Clause
"""An rviz configuration for a window, turned into one for pictures: no panels, few frames, camera on the robot."""
from __future__ import annotations

import math
from typing import Any, Dict, Tuple

import yaml

from m2wr_view.errors import ViewError

VIEWS = ("orbit", "top", "config")
#: Slant of the camera [rad], and the side it looks from: behind a robot that heads along x, 0.6 rad to its right.
#: rviz has one light, which shines along the camera's axis: seen straight along x, walls along x would be black.
PITCH, YAW = 0.95, math.pi + 0.6
NEAR_CLIP = 0.01            # m, as rviz has it


def camera(view: str, frame: str, distance: float, height: int) -> Dict[str, Any]:
    """Return rviz's settings of a camera that keeps above a frame and does not turn with it.

    Parameters
    ----------
    view : str
        ``orbit``: from behind and above; ``top``: straight down, without perspective.
    frame : str
        What it follows.
    distance : float
        From the frame [m]; for ``top`` half of what is to be seen from its lower to its upper edge [m].
    height : int
        Of the picture [pixels].

    Returns
    -------
    dict
    """
    if view == "top":
        return {"Class": "rviz/TopDownOrtho", "Name": "Current View", "Target Frame": frame, "Angle": 0, "X": 0, "Y": 0,
                "Scale": height / (2.0 * distance), "Near Clip Distance": NEAR_CLIP}
    return {"Class": "rviz/Orbit", "Name": "Current View", "Target Frame": frame, "Distance": distance,
            "Focal Point": {"X": 0, "Y": 0, "Z": 0}, "Pitch": PITCH, "Yaw": YAW, "Near Clip Distance": NEAR_CLIP}


def read_config(text: str, origin: str) -> Dict[str, Any]:
    """Return the contents of an rviz configuration.

    Parameters
    ----------
    text : str
        YAML.
    origin : str
        Where it is from, for messages.

    Raises
    ------
    ViewError
        If the text is no such configuration; the message names ``origin``.
    """
    try:
        config = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ViewError("rviz configuration %s: %s; expected YAML as rviz writes it"
                        % (origin, " ".join(str(error).split()))) from error
    if not isinstance(config, dict) or not isinstance(config.get("Visualization Manager"), dict):
        raise ViewError("rviz configuration %s: expected \"Visualization Manager\" in it, as rviz writes it" % origin)
    return config


def for_pictures(text: str, origin: str, size: Tuple[int, int], frame_rate: float, view: str = "config",
                 frame: str = "", distance: float = 10.0) -> str:
    """Return an rviz configuration for a virtual display.

    Parameters
    ----------
    text, origin : str
        The configuration, and where it is from.
    size : (int, int)
        Width and height of the display [pixels]; the window fills it.
    frame_rate : float
        Pictures that rviz draws per second at most [Hz]; a lower rate in the file is kept.
    view, frame, distance
        See :func:`camera`; ``config`` or an empty frame: as the file says.

    Raises
    ------
    ViewError
        If the text is no such configuration or the view is unknown.
    """
    config = read_config(text, origin)
    if view not in VIEWS:
        raise ViewError("view %r: expected one of %s" % (view, ", ".join(VIEWS)))
    manager = config["Visualization Manager"]
    options = manager.setdefault("Global Options", {})
    # an integer: rviz reads a float as a negative number and draws nothing
    options["Frame Rate"] = max(1, int(min(frame_rate, options.get("Frame Rate", frame_rate))))
    if view != "config" and frame:
        manager["Views"] = {"Current": camera(view, frame, distance, size[1])}
    geometry: Dict[str, Any] = {"Hide Left Dock": True, "Hide Right Dock": True, "X": 0, "Y": 0, "Width": size[0],
                                "Height": size[1]}
    for panel in config.get("Panels") or []:
        geometry[panel.get("Name", "")] = {"collapsed": True}
    config["Window Geometry"] = geometry
    return str(yaml.safe_dump(config, sort_keys=False))
