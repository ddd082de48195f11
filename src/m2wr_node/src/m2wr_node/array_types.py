# SPDX-License-Identifier: BSD-3-Clause
"""Names of the array types in type hints. Docstrings give the shapes.

They can be imported like other names. At run time they are ``Any``: numpy's own need a newer numpy, and time to import.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import Sequence, Union

    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    Float32Array = NDArray[np.float32]
    Complex64Array = NDArray[np.complex64]
    IndexArray = NDArray[np.int64]
    Int32Array = NDArray[np.int32]
    Int16Array = NDArray[np.int16]
    Int8Array = NDArray[np.int8]
    Uint32Array = NDArray[np.uint32]
    Uint16Array = NDArray[np.uint16]
    Uint8Array = NDArray[np.uint8]
    CountArray = Union[Uint16Array, Uint32Array]
    BoolArray = NDArray[np.bool_]
    Vector = Union[Sequence[float], FloatArray]      # a few numbers that are read one by one
else:
    FloatArray = Float32Array = Complex64Array = Any
    IndexArray = Int32Array = Int16Array = Int8Array = Any
    Uint32Array = Uint16Array = Uint8Array = CountArray = BoolArray = Vector = Any
