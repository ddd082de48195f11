# SPDX-License-Identifier: BSD-3-Clause
"""Colours of Gazebo's material names, as in ``<material>Gazebo/Red</material>``."""
from __future__ import annotations

from typing import Dict, Optional, Tuple

Colour = Tuple[float, float, float]

#: Diffuse colours of Gazebo's scripts; of those with a picture, the picture's mean.
COLOURS: Dict[str, Colour] = {
    "black": (0.0, 0.0, 0.0), "blue": (0.0, 0.0, 1.0), "green": (0.0, 1.0, 0.0), "grey": (0.7, 0.7, 0.7),
    "gray": (0.7, 0.7, 0.7), "darkgrey": (0.175, 0.175, 0.175), "darkgray": (0.175, 0.175, 0.175),
    "orange": (1.0, 0.5088, 0.0468), "darkorange": (1.0, 0.5088, 0.0468), "purple": (1.0, 0.0, 1.0),
    "red": (1.0, 0.0, 0.0), "redbright": (0.87, 0.26, 0.07), "turquoise": (0.0, 1.0, 1.0), "white": (1.0, 1.0, 1.0),
    "yellow": (1.0, 1.0, 0.0), "darkyellow": (0.7, 0.7, 0.0), "zincyellow": (0.9725, 0.9529, 0.2078),
    "gold": (0.8, 0.64869, 0.120759), "skyblue": (0.13, 0.44, 0.70), "indigo": (0.33, 0.0, 0.5),
    "flatblack": (0.1, 0.1, 0.1), "darkmagentatransparent": (0.5, 0.0, 0.5), "whiteglow": (1.0, 1.0, 1.0),
    "redglow": (1.0, 0.0, 0.0), "greenglow": (0.0, 1.0, 0.0), "blueglow": (0.0, 0.0, 1.0),
    "yellowglow": (1.0, 1.0, 0.0), "purpleglow": (1.0, 0.0, 1.0), "turquoiseglow": (0.0, 1.0, 1.0),
    "wood": (0.72, 0.53, 0.30), "woodfloor": (0.66, 0.46, 0.28), "woodpallet": (0.64, 0.49, 0.33),
    "bricks": (0.65, 0.33, 0.24), "ceilingtiled": (0.80, 0.80, 0.78), "road": (0.30, 0.30, 0.30),
    "residential": (0.42, 0.42, 0.40), "asphalt": (0.30, 0.30, 0.30), "grass": (0.29, 0.44, 0.19),
    "greygrid": (0.6, 0.6, 0.6), "runway": (0.30, 0.30, 0.30), "pedestrian": (0.55, 0.53, 0.50),
    "cloudysky": (0.6, 0.7, 0.8), "paintedwall": (0.80, 0.76, 0.66), "pioneerbody": (0.80, 0.10, 0.10),
}


def colour_of_name(name: str) -> Optional[Colour]:
    """Return the colour of a material name of Gazebo, None if it is unknown; what is before a slash does not count."""
    return COLOURS.get(name.rsplit("/", 1)[-1].lower().replace("_", ""))
