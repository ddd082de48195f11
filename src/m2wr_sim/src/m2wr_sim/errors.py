# SPDX-License-Identifier: BSD-3-Clause
"""The exceptions of this package. Each message states what was read, where, and what was expected."""
from __future__ import annotations

from typing import Iterable


class SimError(Exception):
    """Base class of all exceptions below."""


class ModelError(SimError):
    """A robot description (URDF, xacro or SDF model) cannot be used."""


class WorldError(SimError):
    """A world file cannot be used."""


class LostError(SimError):
    """Bodies have left the world.

    Attributes
    ----------
    models : tuple of str
        Models to which these bodies belong.
    left : int
        Number of requested steps that were not made.
    """

    def __init__(self, message: str, models: Iterable[str], left: int) -> None:
        super().__init__(message)
        self.models, self.left = tuple(models), left


class PluginError(SimError):
    """A plugin cannot be configured; the simulation continues without it."""


class ParameterError(SimError):
    """A node parameter has an invalid value."""


class NotFoundError(SimError):
    """The world has no model, link, joint or frame of the given name."""
