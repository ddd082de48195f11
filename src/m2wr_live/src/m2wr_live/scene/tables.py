# SPDX-License-Identifier: BSD-3-Clause
"""Tables that nodes publish as diagnostics, such as the scores of paths, and how a page shows them."""
from __future__ import annotations

import html
from typing import Any, List, NamedTuple, Sequence, Tuple

MOST_ROWS, MOST_COLUMNS = 40, 8
LONGEST = 60                # characters of a cell
_OK, _ERROR = 0, 2          # of diagnostic_msgs/DiagnosticStatus
_STYLE = "font:10px/1.35 system-ui,sans-serif;padding:0 2px 6px;overflow-x:auto"
_IN_SIGHT = 4               # columns that the panel shows without scrolling


class Row(NamedTuple):
    """One row: ``name``, ``level`` of diagnostics, ``message`` and ``values``, pairs of key and value."""

    name: str
    level: int
    message: str
    values: Tuple[Tuple[str, str], ...]


def read_table(message: Any) -> List[Row]:
    """Return the rows of a diagnostic_msgs/DiagnosticArray; what is too long is cut off."""
    return [Row(str(status.name)[:LONGEST], int(status.level), str(status.message)[:LONGEST],
                tuple((str(pair.key)[:LONGEST], str(pair.value)[:LONGEST]) for pair in status.values[:MOST_COLUMNS]))
            for status in message.status[:MOST_ROWS]]


def html_of(rows: Sequence[Row]) -> str:
    """Return a table as HTML; nothing in a cell can be a tag. The row with level OK is bold."""
    keys = list(dict.fromkeys(key for row in rows for key, _ in row.values))[:MOST_COLUMNS]
    head = "".join("<th align=right>%s</th>" % html.escape(key) for key in keys)
    lines = ["<tr><th></th><th align=left>path</th>%s</tr>" % head]
    for number, row in enumerate(rows, 1):
        known = dict(row.values)
        cells = "".join("<td align=right>%s</td>" % html.escape(known.get(key, "")) for key in keys)
        if row.level >= _ERROR or not known:
            cells = "<td colspan=%d>%s</td>" % (min(max(len(keys), 1), _IN_SIGHT), html.escape(row.message))
        style = " style='font-weight:bold;color:#007a5a'" if row.level == _OK else ""
        lines.append("<tr%s><td>%d</td><td>%s</td>%s</tr>" % (style, number, html.escape(row.name), cells))
    return "<div style='%s'><table cellspacing=1>%s</table></div>" % (_STYLE, "".join(lines))
