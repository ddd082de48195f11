# SPDX-License-Identifier: BSD-3-Clause
"""Names of the array types in type hints. Docstrings give the shapes."""
from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IndexArray = NDArray[np.int64]
    Int8Array = NDArray[np.int8]
    Uint8Array = NDArray[np.uint8]
    Uint32Array = NDArray[np.uint32]
    BoolArray = NDArray[np.bool_]
