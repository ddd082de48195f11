# SPDX-License-Identifier: BSD-3-Clause
"""Table of the faults. A new one is a class in a file of its kind and one line here."""
from __future__ import annotations

import zlib
from typing import Any, Dict, Mapping, Type

import numpy as np

from m2wr_campaign.faults import command_faults, pose_faults, scan_faults
from m2wr_campaign.faults.fault import Fault

NONE = "none"
FAULTS: Dict[str, Type[Fault]] = {
    NONE: Fault,
    "laser_stops": scan_faults.LaserStops,
    "scan_loss": scan_faults.ScanLoss,
    "scan_delay": scan_faults.ScanDelay,
    "blind_beams": scan_faults.BlindBeams,
    "odometry_drift": pose_faults.OdometryDrift,
    "pose_jump": pose_faults.PoseJump,
    "command_delay": command_faults.CommandDelay,
    "pulls_aside": command_faults.PullsAside,
}


def make_fault(name: str, parameters: Mapping[str, Any], seed: int) -> Fault:
    """Return the fault of a run.

    Parameters
    ----------
    name : str
        Of FAULTS.
    parameters : mapping of str to object
        Those that differ from the defaults.
    seed : int
        Of the run.
    """
    kind = FAULTS[name]
    values: Dict[str, Any] = {key: parameter.default for key, parameter in kind.PARAMETERS.items()}
    values.update(parameters)
    return kind(values, np.random.default_rng([seed, zlib.crc32(name.encode())]))
