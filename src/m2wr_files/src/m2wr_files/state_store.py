# SPDX-License-Identifier: BSD-3-Clause
"""Store of the numbers and arrays of a state, and the interface of the types that fill and read it."""
from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Union

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray


class KindError(ValueError):
    """A value is not allowed for its attribute; the message says why."""


#: Name -> size within one object; of a list of arrays: the sizes of all.
Sizes = Dict[str, Any]


class Store:
    """Numbers (flat, by name) and arrays (by name) of one state, and the sizes met so far.

    Parameters
    ----------
    values : dict of str to str, number or list, optional
    arrays : dict of str to ndarray, optional
    """

    def __init__(self, values: Optional[Dict[str, Any]] = None,
                 arrays: Optional[Dict[str, NDArray[Any]]] = None) -> None:
        self.values, self.arrays = values or {}, arrays or {}
        self.sizes: Sizes = {}

    def value(self, where: str) -> Any:
        """Return a number or word; raises KindError where it is missing."""
        if where not in self.values:
            raise KindError("it has no {}".format(where))
        return self.values[where]

    def array(self, where: str, dtype: DTypeLike) -> NDArray[Any]:
        """Return an array.

        Parameters
        ----------
        where : str
            Its name.
        dtype : dtype
            Its expected type.

        Raises
        ------
        KindError
            If it is missing or of another type.
        """
        if where not in self.arrays:
            raise KindError("it has no {}".format(where))
        found = self.arrays[where]
        if found.dtype != dtype:
            raise KindError("{} is of {}; expected {}".format(where, found.dtype, np.dtype(dtype)))
        return found

    def bind(self, sizes: Sizes, name: Union[str, int], size: int, where: str) -> None:
        """Let a name stand for a size from now on.

        Parameters
        ----------
        sizes : dict
            Of the object; is changed.
        name : str or int
            A number stands for itself.
        size : int
        where : str
            Name of the attribute, for messages.

        Raises
        ------
        KindError
            If the name stands for another size.
        """
        if isinstance(name, int):
            expected = name
        else:
            expected = (self.sizes if name.islower() else sizes).setdefault(name, size)
        if size != expected:
            raise KindError("{}: {} where {} are expected".format(where, size, expected))

    def size(self, sizes: Sizes, name: Union[str, float]) -> float:
        """Return what a name stands for.

        Parameters
        ----------
        sizes : dict
            Of the object.
        name : str, int or float
            A number stands for itself.
        """
        return (self.sizes if name.islower() else sizes)[name] if isinstance(name, str) else name


class Kind(abc.ABC):
    """Type of a stored attribute."""

    @abc.abstractmethod
    def take(self, value: Any, where: str, store: Store) -> None:
        """Put a value into a store.

        Parameters
        ----------
        value : object
        where : str
            Name of the attribute in the store.
        store : Store

        Raises
        ------
        KindError
            If the value is of another type.
        """

    @abc.abstractmethod
    def give(self, where: str, store: Store, sizes: Sizes) -> Any:
        """Return a value of a store after checking it.

        Parameters
        ----------
        where : str
            Name of the attribute in the store.
        store : Store
        sizes : dict
            Sizes of the object that the value belongs to; is extended.

        Raises
        ------
        KindError
            If it is missing, of another type or outside its range.
        """


class ListKind(Kind):
    """Type of a stored attribute of which there may be a list, stored as columns."""

    @abc.abstractmethod
    def take_all(self, items: Sequence[Any], where: str, store: Store) -> None:
        """Put a list of values into a store.

        Parameters
        ----------
        items : list
        where : str
            Name of the list in the store.
        store : Store

        Raises
        ------
        KindError
            If a value is of another type.
        """

    @abc.abstractmethod
    def give_all(self, where: str, store: Store, sizes: Sizes) -> List[Any]:
        """Return a list of values of a store after checking them.

        Parameters
        ----------
        where : str
            Name of the list in the store.
        store : Store
        sizes : dict
            Sizes of the object that the list belongs to; is extended.

        Raises
        ------
        KindError
            If it is missing, of another type or outside its range.
        """
