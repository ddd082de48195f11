# SPDX-License-Identifier: BSD-3-Clause
"""Names of ROS field types, such as ``float64[3]``."""
from __future__ import annotations

from typing import Dict, NamedTuple, Optional, Tuple

#: Least and greatest value of each integer type; ``byte`` and ``char`` are old names.
INTEGERS: Dict[str, Tuple[int, int]] = {
    "int8": (-2**7, 2**7 - 1), "int16": (-2**15, 2**15 - 1), "int32": (-2**31, 2**31 - 1),
    "int64": (-2**63, 2**63 - 1), "uint8": (0, 2**8 - 1), "uint16": (0, 2**16 - 1), "uint32": (0, 2**32 - 1),
    "uint64": (0, 2**64 - 1), "byte": (-2**7, 2**7 - 1), "char": (0, 2**8 - 1)}
#: Greatest finite value of each type of real numbers.
REALS: Dict[str, float] = {"float32": 3.4028234663852886e38, "float64": 1.7976931348623157e308}
TIMES = ("time", "duration")
#: Elements whose arrays rospy holds as bytes.
OCTETS = ("uint8", "char")


class FieldType(NamedTuple):
    """``base`` without brackets; ``length`` None: no array, 0: an array of any length, else the fixed length."""

    base: str
    length: Optional[int]

    @property
    def primitive(self) -> bool:
        """Whether the base is a number, truth value or text."""
        return self.base in INTEGERS or self.base in REALS or self.base in ("bool", "string")


def parse(text: str) -> FieldType:
    """Return the parts of a field type."""
    base, bracket, rest = text.partition("[")
    if not bracket:
        return FieldType(base, None)
    return FieldType(base, int(rest.rstrip("]") or 0))
