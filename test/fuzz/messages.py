# SPDX-License-Identifier: BSD-3-Clause
"""Random ROS messages and requests of any type: mostly plausible, with some extreme values."""
import genpy
import roslib.message

import mutations

_LIMITS = {"int8": (-128, 127), "uint8": (0, 255), "byte": (-128, 127), "char": (0, 255),
           "int16": (-2 ** 15, 2 ** 15 - 1),
           "uint16": (0, 2 ** 16 - 1), "int32": (-2 ** 31, 2 ** 31 - 1), "uint32": (0, 2 ** 32 - 1),
           "int64": (-2 ** 63, 2 ** 63 - 1), "uint64": (0, 2 ** 64 - 1)}
_SMALLEST_FLOAT32, _GREATEST_FLOAT32 = 1.2e-38, 3.4e38


class Filler:
    """Fills messages in place.

    Parameters
    ----------
    names : callable
        Returns the texts that are valid for the receiver in a field of that name at present.
    extremes : float
        Share of the fields that get an extreme value.
    """

    def __init__(self, names, extremes=0.2):
        self._names, self._extremes = names, extremes

    def fill(self, rng, message):
        """Fill all fields of a message, nested ones too; returns it."""
        wild = rng.random() * self._extremes * 2.0 if rng.randrange(3) else 0.0
        for name, kind in zip(message.__slots__, message._slot_types):
            setattr(message, name, self._value(rng, kind, getattr(message, name), wild, name))
        if rng.randrange(4) == 0:
            self._one_extreme(rng, message)
        return message

    def _one_extreme(self, rng, message):
        """Give one field an extreme value, and leave the others as they are."""
        if not message.__slots__:
            return
        name, kind = rng.choice(list(zip(message.__slots__, message._slot_types)))
        value = getattr(message, name)
        if isinstance(value, genpy.Message):
            self._one_extreme(rng, value)
        else:
            setattr(message, name, self._value(rng, kind, value, 1.0, name))

    def _value(self, rng, kind, value, wild, field):
        if kind.endswith("]"):
            return self._array(rng, kind, value, wild, field)
        extreme = rng.random() < wild
        if kind in ("float64", "float32"):
            return self._float(rng, kind, extreme)
        if kind in _LIMITS:
            return self._integer(rng, kind, extreme)
        if kind == "bool":
            return bool(rng.randrange(2))
        if kind == "string":
            return rng.choice(mutations.WORDS) if extreme else rng.choice(self._names(field) or [""])
        if kind in ("time", "duration"):
            return self._time(rng, kind, extreme)
        for name, inner in zip(value.__slots__, value._slot_types):
            setattr(value, name, self._value(rng, inner, getattr(value, name), wild, name))
        if not extreme and kind == "geometry_msgs/Quaternion" and rng.randrange(2):
            value.x, value.y, value.z, value.w = 0.0, 0.0, 0.0, 1.0
        return value

    @staticmethod
    def _float(rng, kind, extreme):
        if not extreme:
            return rng.uniform(-2.0, 2.0) if rng.randrange(4) else 0.0
        value = rng.choice(mutations.FLOATS)
        if kind == "float32" and _GREATEST_FLOAT32 < abs(value) < float("inf"):
            return _GREATEST_FLOAT32
        return value

    @staticmethod
    def _integer(rng, kind, extreme):
        least, most = _LIMITS[kind]
        if extreme:
            return rng.choice((least, most, min(most, 2 ** 31 - 1), min(most, 10 ** 6), 0, max(least, -1)))
        return rng.randrange(max(least, 0), min(most, 60) + 1)

    @staticmethod
    def _time(rng, kind, extreme):
        if kind == "time":
            if extreme:
                return genpy.Time(2 ** 32 - 1, 999999999)
            return genpy.Time(rng.randrange(3), rng.randrange(10 ** 9))
        if extreme:
            return genpy.Duration(rng.choice((-2 ** 31, 2 ** 31 - 1, -1)), rng.choice((0, 999999999)))
        return genpy.Duration(0, rng.randrange(10 ** 8))

    def _array(self, rng, kind, value, wild, field):
        base, _, size = kind[:-1].partition("[")
        count = int(size) if size else rng.choice((0, 1, 1, 2, 2, 3, 200 if rng.random() < wild else 4))
        if base in ("uint8", "char"):
            return bytes(rng.randrange(256) for _ in range(count))
        prototype = roslib.message.get_message_class(base) if "/" in base else None
        return [self._value(rng, base, prototype() if prototype else None, wild, field) for _ in range(count)]


def finite_floats(message):
    """Yield the names of the fields of a message that hold a number that is not finite."""
    for name, kind in zip(message.__slots__, message._slot_types):
        value = getattr(message, name)
        if isinstance(value, genpy.Message):
            for inner in finite_floats(value):
                yield name + "." + inner
        elif kind.startswith("float"):
            for number in value if kind.endswith("]") else (value,):
                if not abs(number) < float("inf"):
                    yield name
