# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 6: a map, compared with the world in which it was made."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Iterator, Tuple

import numpy as np
import yaml
from PIL import Image

from m2wr_course.finding import Finding
from m2wr_sim.api.loading import read_world
from m2wr_sim.errors import WorldError
from m2wr_tools.map_comparison.agreement import LASER_HEIGHT, Truth, compare

if TYPE_CHECKING:
    from numpy.typing import NDArray

WORLD = "world02"
ON_WALLS, FREE, DRAWN, AREA = 0.95, 0.98, 0.6, 150.0       # least shares of a good map, and its least size [m2]
MOST_PIXELS = 4096 * 4096                       # 200 m x 200 m in cells of 0.05 m


def _read(path: str) -> Tuple[NDArray[np.int8], float, NDArray[np.float64]]:
    """Return cells (H, W) int8, resolution [m] and origin (2,) [m] of a map as map_saver writes it."""
    try:
        with open(path, encoding="utf-8") as stream:
            values = yaml.safe_load(stream)
        with Image.open(os.path.join(os.path.dirname(path), values["image"])) as opened:
            if opened.width * opened.height > MOST_PIXELS:
                raise ValueError("%d x %d pixels are too many" % opened.size)
            grey = np.asarray(opened.convert("L"))[::-1]
        resolution, origin = float(values["resolution"]), np.array(values["origin"][:2], float)
    except KeyError as error:
        raise WorldError("the field %s is missing; expected the .yaml file that map_saver writes" % error) from error
    except (OSError, TypeError, ValueError, yaml.YAMLError) as error:
        raise WorldError("the map cannot be read (%s); expected the .yaml file that map_saver writes, with its .pgm "
                         "beside it" % error) from error
    return np.select([grey > 250, grey < 5], [0, 100], -1).astype(np.int8), resolution, origin


def whole_map(path: str) -> Iterator[Finding]:
    """Exercise 6: a map of world02 in which most walls are drawn, where they are.

    Parameters
    ----------
    path : str
        YAML file of map_saver.

    Yields
    ------
    Finding
    """
    cells, resolution, origin = _read(path)
    found = compare(cells, resolution, origin, Truth(read_world(WORLD), LASER_HEIGHT))
    area = found.free * resolution ** 2
    yield Finding(area >= AREA, "%.0f m2 are drawn as free" % area,
                  "at least %g m2 are expected: drive farther, for instance with drive:=tour" % AREA)
    yield Finding(found.on_walls >= ON_WALLS, "%.0f %% of the wall cells lie on a wall" % (100.0 * found.on_walls),
                  "at least %g %% are asked for: a map that bends has too few particles" % (100.0 * ON_WALLS))
    yield Finding(found.truly_free >= FREE, "%.0f %% of the free cells are free" % (100.0 * found.truly_free),
                  "at least %g %% are asked for" % (100.0 * FREE))
    yield Finding(found.found >= DRAWN, "%.0f %% of the walls beside free cells are drawn" % (100.0 * found.found),
                  "at least %g %% are asked for: pass the walls nearer" % (100.0 * DRAWN))
