# SPDX-License-Identifier: BSD-3-Clause
"""Options of a simulation."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Optional

from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.runtime.once_logger import OnceLogger


@dataclass(frozen=True)
class SimConfig:
    """Options of a simulation.

    ``wheel_conventions`` overrides ``wheel_convention`` for models by name; see
    :func:`m2wr_sim.control.diff_drive.is_swapped`.  ``command_timeout_ns`` stops a robot that has received no command
    for that time; with 0 the last command stays valid.  ``joint_states`` publishes joint states also for robots without
    a plugin for them.  A model that leaves the world is removed and logged; with ``loss_ends`` LostError is raised
    instead.  ``once_logger`` logs each remark on models once.
    """

    seed: int = 0
    clock_rate: float = 100.0
    wheel_convention: str = "noetic"
    wheel_conventions: Dict[str, str] = field(default_factory=dict)
    command_timeout_ns: int = 0
    joint_states: bool = True
    joint_state_rate: float = 50.0
    loss_ends: bool = False
    once_logger: OnceLogger = field(default_factory=OnceLogger, repr=False, compare=False)

    def wheel_convention_of(self, model_name: str, described: Optional[str] = None) -> str:
        """Return the wheel convention of a model: the one for its name, that of its description, or the general one.

        Parameters
        ----------
        model_name : str
        described : str, optional
            Text of a ``<wheelConvention>`` element; a text that is no convention is ignored.

        Returns
        -------
        str
        """
        general = described if described in CONVENTIONS else self.wheel_convention
        return self.wheel_conventions.get(model_name, general)
