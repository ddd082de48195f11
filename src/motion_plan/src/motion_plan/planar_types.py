# SPDX-License-Identifier: BSD-3-Clause
"""Names of the types that the behaviours share. Plain Python and numpy, no ROS types."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Sequence, Tuple, Union

#: x, y [m] in the odometry frame.
Point = Tuple[float, float]
#: x, y [m] and yaw [rad] of link_chassis in the odometry frame.
Pose = Tuple[float, float, float]
#: linear_x [m/s] and angular_z [rad/s], positive to the left.
Command = Tuple[float, float]
#: Least range [m] of each laser sector, by its name.
Regions = Dict[str, float]

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    #: Ranges [m] of a scan: of a message, or an array (n,).
    Readings = Union[Sequence[float], NDArray[np.floating[Any]]]
    IndexArray = NDArray[np.int64]
    BoolArray = NDArray[np.bool_]
