# SPDX-License-Identifier: BSD-3-Clause
"""The errors this package raises on purpose; each message says what was read, where, and what was expected."""


class SimError(Exception):
    """Base of all errors below."""


class ModelError(SimError):
    """A robot description (URDF, xacro or SDF model) cannot be used."""


class WorldError(SimError):
    """A world file cannot be used."""


class LostError(SimError):
    """Bodies have been thrown out of the world.

    Attributes
    ----------
    models : tuple of str
        The models they belong to.
    left : int
        How many of the steps that were asked for have not been taken.
    """

    def __init__(self, message, models, left):
        super().__init__(message)
        self.models, self.left = tuple(models), left


class PluginError(SimError):
    """A plugin cannot be configured; the simulation goes on without it."""


class ParameterError(SimError):
    """A node parameter has an unusable value."""


class NotFoundError(SimError):
    """A model, link, joint or frame of the given name does not exist in the world."""


class LockstepError(SimError):
    """A controller that the simulation runs in lockstep with does not answer."""
