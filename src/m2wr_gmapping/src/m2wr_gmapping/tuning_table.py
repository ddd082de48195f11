# SPDX-License-Identifier: BSD-3-Clause
"""Page of the documentation with all tuned constants."""
from __future__ import annotations

from typing import Any

from m2wr_gmapping import tuning

HEAD = """# Tuned constants of the mapper

Written by `make reference` from [`tuning.py`](../../src/m2wr_gmapping/src/m2wr_gmapping/tuning.py).
These values are no parameters: they are the same for every robot. A value with several components has one unit for
each. `rosrun m2wr_gmapping sensitivity` measures
[what each value does](../how-to/mapping_benchmark.md#see-what-a-constant-does).
"""


def text_of(value: Any) -> str:
    """Return a value with the digits that matter, such as 0.2, 0.3."""
    values = value if isinstance(value, tuple) else (value,)
    return ", ".join("{:.4g}".format(one) for one in values)


def markdown() -> str:
    """Return the page."""
    lines, group = [HEAD.rstrip()], ""
    for one in tuning.constants():
        if one.group != group:
            group = one.group
            lines += ["", "## " + group, str(getattr(tuning, group).__doc__).strip(), "",
                      "| name | value | unit | meaning | source of the value |", "|---|---|---|---|---|"]
        lines.append("| `{}` | {} | {} | {} | {} |".format(
            one.name, text_of(one.value), one.unit, one.meaning, one.source))
    return "\n".join(lines) + "\n"
