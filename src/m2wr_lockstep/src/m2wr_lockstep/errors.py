# SPDX-License-Identifier: BSD-3-Clause
"""Errors of lockstep."""


class LockstepError(Exception):
    """A node that the simulation runs in lockstep with does not answer."""


class ConfigError(LockstepError):
    """An entry of a lockstep parameter cannot be read; the message quotes it."""
