# SPDX-License-Identifier: BSD-3-Clause
"""Page of the documentation with all tuned constants."""
from __future__ import annotations

from typing import Any

from m2wr_gmapping import tuning
from m2wr_tools.slam_benchmark.tuned_constants import constants, derived

HEAD = """# Tuned constants of the mapper

Written by `make reference` from [`tuning.py`](../../src/m2wr_gmapping/src/m2wr_gmapping/tuning.py).
These values are no parameters: they are the same for every robot. There are {count} constants, with {numbers}
numbers. What follows from them is listed below each table. A value with several components has one unit for each.
`rosrun m2wr_gmapping sensitivity` measures
[what each value does](../how-to/mapping_benchmark.md#see-what-a-constant-does).
"""


def text_of(value: Any) -> str:
    """Return a value with the digits that matter, such as 0.2, 0.3."""
    values = value if isinstance(value, tuple) else (value,)
    return ", ".join("{:.4g}".format(one) for one in values)


def markdown() -> str:
    """Return the page."""
    chosen, following = list(constants()), list(derived())
    numbers = sum(len(one.value) if isinstance(one.value, tuple) else 1 for one in chosen)
    lines = [HEAD.format(count=len(chosen), numbers=numbers).rstrip()]
    for group in tuning.GROUPS:
        lines += ["", "## " + group, str(getattr(tuning, group).__doc__).strip(), "",
                  "| name | value | unit | meaning | source of the value |", "|---|---|---|---|---|"]
        lines += ["| `{}` | {} | {} | {} | {} |".format(one.name, text_of(one.value), one.unit, one.meaning, one.source)
                  for one in chosen if one.group == group]
        rows = ["| `{}` | {} | {} | {} |".format(one.name, text_of(one.value), one.unit, one.meaning)
                for one in following if one.group == group]
        if rows:
            lines += ["", "| follows | value | unit | from what |", "|---|---|---|---|"] + rows
    lines += ["", "## Taken from gmapping", "Not chosen here: the mapper keeps what OpenSLAM gmapping has.", "",
              "| name | value | unit | meaning |", "|---|---|---|---|",
              "| `CROSS_NOISE` | {} | 1 | Share of the noise along a direction that motion across it adds. |".format(
                  text_of(tuning.CROSS_NOISE)),
              "| `NULL_DISTANCE2` | {} | m^2 | Squared distance of an end point without a partner, for the likelihood. "
              "|".format(text_of(tuning.NULL_DISTANCE2))]
    return "\n".join(lines) + "\n"
