# SPDX-License-Identifier: BSD-3-Clause
"""Types of stored attributes: each converts values to numbers and arrays of a file, and back with checks.

Compiled code relies on the sizes and values of its arrays, so each type declares them, and other values are refused.
Sizes are numbers or names. A name has one value within an object; a name in lower case has one value in the whole
state.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_files.state_store import Kind, KindError, ListKind, Sizes, Store

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

MOST = 1e12         # no length, angle, time or weight in a state is greater
MOST_ITEMS = 2000000    # of a list: two weeks, one every half second


class Number(ListKind):
    """A bool, an int or a float; none may be NaN.

    Parameters
    ----------
    kind : type
        bool, int or float.
    low, high : float, optional
        Allowed range, both ends included.
    below : float or str, optional
        A number, or the name of a size, that the value must not reach.
    infinite : bool
        A float may be infinite.
    """

    def __init__(self, kind: type, low: Optional[float] = None, high: Optional[float] = None,
                 below: Union[str, float, None] = None, infinite: bool = False) -> None:
        self.kind, self.below, self.infinite = kind, below, infinite
        most = 2**62 if kind is int else MOST
        self.low, self.high = -most if low is None else low, most if high is None else high
        self.dtype = {bool: bool, int: np.int64, float: np.float64}[kind]

    def take(self, value: Any, where: str, store: Store) -> None:
        store.values[where] = self.kind(value)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        value = store.value(where)
        if self.kind is float and type(value) is int:
            value = float(value) if abs(value) < 2**62 else math.nan
        if type(value) is not self.kind:
            raise KindError("{} is {!r:.40}; expected {}".format(where, value, self.kind.__name__))
        self.check(np.array([value]), where, store, sizes)
        return value

    def take_all(self, items: Sequence[Any], where: str, store: Store) -> None:
        store.arrays[where] = np.array(items, self.dtype)

    def give_all(self, where: str, store: Store, sizes: Sizes) -> List[Any]:
        found = store.array(where, self.dtype)
        if found.ndim != 1:
            raise KindError("{} has {} axes; expected 1".format(where, found.ndim))
        _check_count(len(found), where)
        self.check(found, where, store, sizes)
        items: List[Any] = found.tolist()
        return items

    def check(self, found: NDArray[Any], where: str, store: Store, sizes: Sizes) -> None:
        if self.kind is bool or not found.size:
            return
        within = (found >= self.low) & (found <= self.high)
        if self.infinite:
            within |= np.isinf(found)
        if self.below is not None:
            within &= found < store.size(sizes, self.below)
        if not within.all():
            raise KindError("{} is {}; expected {:g} to {:g}{}".format(
                where, found[~within][0], self.low, self.high,
                "" if self.below is None else ", below {}".format(store.size(sizes, self.below))))


class Text(Kind):
    """A word of at most ``most`` letters."""

    def __init__(self, most: int) -> None:
        self.most = most

    def take(self, value: Any, where: str, store: Store) -> None:
        store.values[where] = str(value)[:self.most]

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        value = store.value(where)
        if not isinstance(value, str) or len(value) > self.most:
            raise KindError("{}: expected a word of at most {} letters".format(where, self.most))
        return value


class Array(ListKind):
    """An array.

    Parameters
    ----------
    dtype : dtype
    shape : str
        A size or its name for each axis, as "N 3".
    low, high, below
        Of the values, as for :class:`Number`.
    """

    def __init__(self, dtype: DTypeLike, shape: str, low: Optional[float] = None, high: Optional[float] = None,
                 below: Union[str, float, None] = None) -> None:
        self.dtype = np.dtype(dtype)
        self.shape: List[Union[int, str]] = [int(part) if part.isdigit() else part for part in shape.split()]
        self._values = Number(float if self.dtype.kind == "f" else int, low, high, below)
        self._any = self.dtype.kind == "b" or (
            self.dtype.kind in "iu" and low is None and high is None and below is None)
        # the axis along which those of a list are put together
        names = [axis for axis, part in enumerate(self.shape) if isinstance(part, str)]
        self._axis = names[0] if names else None

    def take(self, value: Any, where: str, store: Store) -> None:
        value = np.asarray(value)
        if value.dtype != self.dtype or value.ndim != len(self.shape):
            raise KindError("{} is {} with {} axes; expected {} with {}".format(
                where, value.dtype, value.ndim, self.dtype, len(self.shape)))
        store.arrays[where] = np.array(value, order="C")

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        found = store.array(where, self.dtype)
        self._check_shape(found.shape, where, store, sizes)
        self._check_values(found, where, store, sizes)
        return found

    def _check_shape(self, shape: Tuple[int, ...], where: str, store: Store, sizes: Sizes) -> None:
        if len(shape) != len(self.shape):
            raise KindError("{} has {} axes; expected {}".format(where, len(shape), len(self.shape)))
        for name, size in zip(self.shape, shape):
            store.bind(sizes, name, size, where)

    def _check_values(self, found: NDArray[Any], where: str, store: Store, sizes: Sizes) -> None:
        if not self._any:
            self._values.check(found, where, store, sizes)

    def take_all(self, items: Sequence[Any], where: str, store: Store) -> None:
        if self._axis is None:
            fixed = np.zeros([0, *map(int, self.shape)], self.dtype)
            self._expect(np.stack(items) if items else fixed, fixed.ndim, where)
            store.arrays[where] = np.stack(items) if items else fixed
            return
        if items:
            joined = np.concatenate(items, axis=self._axis)
        else:
            joined = np.zeros([0 if isinstance(part, str) else part for part in self.shape], self.dtype)
        self._expect(joined, len(self.shape), where)
        store.arrays[where] = np.ascontiguousarray(joined)
        store.arrays[where + ".lengths"] = np.array([item.shape[self._axis] for item in items], np.int64)

    def _expect(self, found: NDArray[Any], axes: int, where: str) -> None:
        if found.dtype != self.dtype or found.ndim != axes:
            raise KindError("{} is {} with {} axes; expected {} with {}".format(
                where, found.dtype, found.ndim, self.dtype, axes))

    def give_all(self, where: str, store: Store, sizes: Sizes) -> List[Any]:
        joined = store.array(where, self.dtype)
        if self._axis is None:
            if joined.shape[1:] != tuple(self.shape):
                raise KindError("{} is {} each; expected {}".format(where, joined.shape[1:], tuple(self.shape)))
            self._check_values(joined, where, store, sizes)
            _check_count(len(joined), where)
            return [item.copy() for item in joined]
        lengths = store.array(where + ".lengths", np.int64)
        if joined.ndim != len(self.shape):
            raise KindError("{} has {} axes; expected {}".format(where, joined.ndim, len(self.shape)))
        expected = [joined.shape[self._axis] if axis == self._axis else part for axis, part in enumerate(self.shape)]
        if list(joined.shape) != expected or lengths.ndim != 1 or (lengths < 0).any() \
                or (lengths > joined.shape[self._axis]).any() or int(lengths.sum()) != joined.shape[self._axis]:
            raise KindError("{}: {} does not fit the lengths of its parts".format(where, joined.shape))
        _check_count(len(lengths), where)
        before = sizes.setdefault(str(self.shape[self._axis]), lengths)
        if not np.array_equal(before, lengths):
            raise KindError("{}: lengths differ from those of the other attributes".format(where))
        self._check_values(joined, where, store, sizes)
        ends = np.cumsum(lengths)
        along = (slice(None),) * self._axis
        return [joined[along + (slice(end - length, end),)].copy()
                for end, length in zip(ends.tolist(), lengths.tolist())]


class Group(ListKind):
    """A tuple of kinds."""

    def __init__(self, *kinds: ListKind) -> None:
        self.kinds = kinds

    def take(self, value: Any, where: str, store: Store) -> None:
        if len(value) != len(self.kinds):
            raise KindError("{} has {} parts; expected {}".format(where, len(value), len(self.kinds)))
        for k, kind in enumerate(self.kinds):
            kind.take(value[k], "{}.{}".format(where, k), store)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        return tuple(kind.give("{}.{}".format(where, k), store, sizes) for k, kind in enumerate(self.kinds))

    def take_all(self, items: Sequence[Any], where: str, store: Store) -> None:
        for k, kind in enumerate(self.kinds):
            kind.take_all([item[k] for item in items], "{}.{}".format(where, k), store)

    def give_all(self, where: str, store: Store, sizes: Sizes) -> List[Any]:
        return _together([kind.give_all("{}.{}".format(where, k), store, sizes)
                          for k, kind in enumerate(self.kinds)], where)


class Record(Kind):
    """An object that is made of its attributes.

    Parameters
    ----------
    make : callable
        Returns the object of a dict of attributes.
    attributes : dict of str to Kind
    """

    def __init__(self, make: Callable[[Dict[str, Any]], Any], attributes: Mapping[str, Kind]) -> None:
        self.make, self.attributes = make, attributes

    def take(self, value: Any, where: str, store: Store) -> None:
        for name, kind in self.attributes.items():
            kind.take(getattr(value, name), "{}.{}".format(where, name), store)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        local: Sizes = {}
        return self.make({name: kind.give("{}.{}".format(where, name), store, local)
                          for name, kind in self.attributes.items()})


class ListedRecord(ListKind):
    """An object of which there is a list; made of its attributes as a :class:`Record`.

    Parameters
    ----------
    make : callable
        Returns the object of a dict of attributes.
    attributes : dict of str to ListKind
    """

    def __init__(self, make: Callable[[Dict[str, Any]], Any], attributes: Mapping[str, ListKind]) -> None:
        self.make, self.attributes = make, attributes
        self._single = Record(make, attributes)

    def take(self, value: Any, where: str, store: Store) -> None:
        self._single.take(value, where, store)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        return self._single.give(where, store, sizes)

    def take_all(self, items: Sequence[Any], where: str, store: Store) -> None:
        for name, kind in self.attributes.items():
            kind.take_all([getattr(item, name) for item in items], "{}.{}".format(where, name), store)

    def give_all(self, where: str, store: Store, sizes: Sizes) -> List[Any]:
        local: Sizes = {}
        columns = [kind.give_all("{}.{}".format(where, name), store, local)
                   for name, kind in self.attributes.items()]
        return [self.make(dict(zip(self.attributes, row))) for row in _together(columns, where)]


def _check_count(count: int, where: str) -> None:
    if count > MOST_ITEMS:
        raise KindError("{}: a list of {}; expected at most {}".format(where, count, MOST_ITEMS))


def _together(columns: Sequence[Sequence[Any]], where: str) -> List[Any]:
    if len({len(column) for column in columns}) != 1:
        raise KindError("{}: its parts are of different length".format(where))
    return list(zip(*columns))


class Many(Kind):
    """A list of one kind, stored by columns.

    Parameters
    ----------
    kind : ListKind
    size : str, optional
        Name of its length.
    """

    def __init__(self, kind: ListKind, size: Optional[str] = None) -> None:
        self.kind, self.count = kind, size

    def take(self, value: Any, where: str, store: Store) -> None:
        self.kind.take_all(list(value), where, store)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        found = self.kind.give_all(where, store, sizes)
        if self.count is not None:
            store.bind(sizes, self.count, len(found), where)
        return found


class Maybe(Kind):
    """One of a kind, or None."""

    def __init__(self, kind: ListKind) -> None:
        self._list = Many(kind)

    def take(self, value: Any, where: str, store: Store) -> None:
        self._list.take([] if value is None else [value], where, store)

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        found = self._list.give(where, store, sizes)
        if len(found) > 1:
            raise KindError("{}: {} where one is expected".format(where, len(found)))
        return found[0] if found else None


class Generator(Kind):
    """The state of a numpy random generator."""

    def take(self, value: Any, where: str, store: Store) -> None:
        found = value.bit_generator.state
        store.values[where] = [found["bit_generator"], found["state"]["state"], found["state"]["inc"],
                               found["has_uint32"], found["uinteger"]]

    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        found, generator = store.value(where), np.random.default_rng()
        limits, known = (2**128, 2**128, 2, 2**32), generator.bit_generator.state["bit_generator"]
        if not (isinstance(found, list) and len(found) == 5 and found[0] == known
                and all(type(part) is int and 0 <= part < limit for part, limit in zip(found[1:], limits))):
            raise KindError("{}: no state of a random generator".format(where))
        generator.bit_generator.state = {"bit_generator": found[0], "state": {"state": found[1], "inc": found[2]},
                                         "has_uint32": found[3], "uinteger": found[4]}
        return generator


class Part:
    """An object that is there already and gets the stored attributes.

    An object with ``compact()`` and ``restore(dict)`` is asked for its stored attributes, and given them back.

    Parameters
    ----------
    stored : dict of str to Kind or Part
    made : tuple of str
        Attributes that follow from parameters, or from the stored ones.
    """

    def __init__(self, stored: Mapping[str, Union[Kind, Part]], made: Tuple[str, ...] = ()) -> None:
        self.stored, self.made = stored, made

    def take(self, value: Any, where: str, store: Store) -> None:
        """Put the stored attributes of an object into a store; None has none.

        Parameters
        ----------
        value : object
        where : str
            Name of the object in the store; empty for the outermost.
        store : Store

        Raises
        ------
        KindError
            If an attribute is of another type, or neither in ``stored`` nor in ``made``.
        """
        if value is None:
            return
        values = value.compact() if hasattr(value, "compact") else vars(value)
        strange = set(vars(value)).symmetric_difference(set(self.made) | {
            name for name in self.stored if name in vars(value) or name not in values})
        if strange:
            raise KindError("{} has other attributes than this program stores: {}".format(
                type(value).__name__, ", ".join(sorted(strange))))
        for name, kind in self.stored.items():
            kind.take(values[name], _below(where, name), store)

    def give_to(self, owner: Any, where: str, store: Store) -> None:
        """Fill an object, with what is stored below a name.

        Parameters
        ----------
        owner : object
        where : str
            Name of the object in the store; empty for the outermost.
        store : Store

        Raises
        ------
        KindError
            If a value is missing, of another type or outside its range.
        """
        local: Sizes = {}
        values: Dict[str, Any] = {}
        for name, kind in self.stored.items():
            if not isinstance(kind, Part):
                values[name] = kind.give(_below(where, name), store, local)
            elif getattr(owner, name) is not None:
                kind.give_to(getattr(owner, name), _below(where, name), store)
        if hasattr(owner, "restore"):
            owner.restore(values)
        else:
            vars(owner).update(values)


def _below(where: str, name: str) -> str:
    return "{}.{}".format(where, name) if where else name
