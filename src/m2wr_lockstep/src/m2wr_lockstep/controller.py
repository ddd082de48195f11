# SPDX-License-Identifier: BSD-3-Clause
"""The public name of the controller's side: ``from m2wr_lockstep.controller import Controller``."""
from m2wr_lockstep.client.controller import SERVICE, Controller

__all__ = ["SERVICE", "Controller"]
