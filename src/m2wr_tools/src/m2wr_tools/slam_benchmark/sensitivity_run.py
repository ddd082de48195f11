# SPDX-License-Identifier: BSD-3-Clause
"""Maps some logs with one changed tuned constant: ``python3 -m m2wr_tools.slam_benchmark.sensitivity_run``.

Reads one JSON object from standard input: ``constant`` (such as MATCHING.narrow, or empty), ``factor``, ``memory``
[bytes], and ``runs``, a list of argument lists of slam_gmapping_replay. The changed value is set before any other
module of the mapper is imported, because modules and compiled kernels read it only once.
"""
from __future__ import annotations

import dataclasses
import json
import resource
import sys
from typing import Any

from m2wr_gmapping import tuning


def scaled(value: Any, factor: float) -> Any:
    """Return a value times a factor; integers stay integers of at least 1.

    Parameters
    ----------
    value : float, int or tuple
    factor : float
    """
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def change(constant: str, factor: float) -> None:
    """Scale one tuned constant of this process.

    Parameters
    ----------
    constant : str
        Group and name.
    factor : float
    """
    group, name = constant.split(".")
    present = getattr(tuning, group)
    setattr(tuning, group, dataclasses.replace(present, **{name: scaled(getattr(present, name), factor)}))


def main() -> int:
    """Run all logs; return the first exit code that is not 0."""
    task = json.load(sys.stdin)
    resource.setrlimit(resource.RLIMIT_AS, (task["memory"], task["memory"]))
    if task["constant"]:
        change(task["constant"], task["factor"])
    from m2wr_gmapping.replay import replay_command  # not before the change
    for arguments in task["runs"]:
        code = replay_command.main(arguments)
        if code:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
