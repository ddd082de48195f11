# SPDX-License-Identifier: BSD-3-Clause
"""A costmap of 6 x 6 m with a robot in the middle, its layers and what its laser sees."""
import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, Observation, Source
from m2wr_navigation.parameters import read

CORNERS = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
RESOLUTION = 0.1
MIDDLE = np.array([3.0, 3.0, 0.0])


def layer(kind, **given):
    made = registry.find(registry.LAYERS, kind)
    return made(kind, read(made.PARAMETERS, given, "~" + kind)[0])


def laser(name="laser", **given):
    given = dict(dict(clearing=True, obstacle_range=4.0, raytrace_range=4.5), **given)
    return Source(name, read(SOURCE_PARAMETERS, given, "~laser")[0])


def costmap(*layers, size=(6.0, 6.0), origin=(0.0, 0.0), rolling=False, track_unknown=False):
    made = LayeredCostmap("odom", size, RESOLUTION, origin, rolling, track_unknown)
    made.set_footprint(CORNERS)
    for each in layers:
        made.add(each)
    return made


def see(source, stamp, points, sensor=(3.0, 3.0, 0.3), free=()):
    source.add(Observation(stamp, np.array(sensor), np.array(points, float).reshape(-1, 3),
                           np.array(free, float).reshape(-1, 3)), stamp)
