# SPDX-License-Identifier: BSD-3-Clause
"""What makes a log difficult: for each aspect one of several classes, drawn so that every few logs have them all."""
from __future__ import annotations

from typing import Dict, Tuple

import numpy as np

#: Aspect -> its classes; one that is named twice is drawn twice as often.
CLASSES: Dict[str, Tuple[str, ...]] = {
    "building": ("aisles", "corridors", "hall", "house", "large", "loops", "office"),
    "range": ("6 to 8 m", "8 to 30 m", "30 to 80 m"),
    "mount": ("true", "yaw", "offset", "yaw and offset"),
    "odometry": ("calibrated", "uncalibrated", "wrong scale", "unequal wheels", "coarse encoder", "noisy",
                 "slipping wheel", "wrong centre"),
    "turn": ("measured", "measured", "measured", "misses 20 to 80 deg", "misses 80 to 180 deg", "carried"),
    "scans": ("complete", "complete", "complete", "30 % dropped", "sparse", "swapped and late"),
    "surroundings": ("still", "still", "people", "glass", "people and glass"),
}
#: Classes that are no difficulty.
PLAIN = {"range": "30 to 80 m", "mount": "true", "odometry": "calibrated", "turn": "measured", "scans": "complete",
         "surroundings": "still"}


def draw(seed: int, number: int) -> Dict[str, str]:
    """Return the class of each aspect of a log.

    The logs of a set are divided into blocks as long as the list of an aspect's classes; the classes of a block are a
    permutation of this list.  So any 100 logs have each class about equally often, in changing combinations.

    Parameters
    ----------
    seed : int
        Of the set.
    number : int
        Of the log, from 0.
    """
    found = {}
    for aspect, classes in CLASSES.items():
        block, place = divmod(number, len(classes))
        # the name of the aspect, not its place, so that a new aspect leaves the others as they are
        order = np.random.default_rng([seed, block, *aspect.encode()]).permutation(len(classes))
        found[aspect] = classes[int(order[place])]
    return found


def real_ones(classes: Dict[str, str]) -> Dict[str, str]:
    """Return the classes that are a difficulty."""
    return {aspect: name for aspect, name in classes.items() if PLAIN.get(aspect) != name}
