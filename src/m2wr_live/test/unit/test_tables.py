# SPDX-License-Identifier: BSD-3-Clause
"""Tables of scores, as a page shows them."""
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.scene.tables import LONGEST, MOST_ROWS, html_of, read_table


def row(name, level=1, message="not driven", **values):
    return DiagnosticStatus(level=level, name=name, message=message,
                            values=[KeyValue(key, value) for key, value in values.items()])


def test_rows_have_their_values_below_the_keys():
    scene = LiveScene()
    scene.take_table("/best_path/scores", DiagnosticArray(status=[
        row("ThetaStar", 0, "driven", score="24.6", time="30"), row("RRT", score="28.1"),
        row("AStar", 2, "no way through")]))
    text = html_of(scene.tables["/best_path/scores"])
    assert text.index("score</th>") < text.index("time</th>")
    assert "<td>1</td><td>ThetaStar</td><td align=right>24.6</td><td align=right>30</td>" in text
    assert "<td align=right>28.1</td><td align=right></td>" in text
    assert "<td colspan=2>no way through</td>" in text and text.count("bold") == 1


def test_names_and_values_cannot_be_tags():
    rows = read_table(DiagnosticArray(status=[row("<script>", 2, "<b>"), row("x", **{"<i>": "<img src=x>"})]))
    text = html_of(rows)
    assert not {"<script>", "<b>", "<i>", "<img src=x>"} & set(text.split(">")) and "&lt;script&gt;" in text
    assert "<img" not in text and "<script" not in text and "<b>" not in text


def test_a_table_is_limited():
    rows = read_table(DiagnosticArray(status=[row("n" * 1000, key="v" * 1000)] * 1000))
    assert len(rows) == MOST_ROWS and len(rows[0].name) == len(rows[0].values[0][1]) == LONGEST
