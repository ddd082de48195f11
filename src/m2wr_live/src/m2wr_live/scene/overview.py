# SPDX-License-Identifier: BSD-3-Clause
"""Nodes with their topics, the tree of frames, parameters and controllers, as lists, and how a page shows them."""
from __future__ import annotations

import html
from typing import Dict, Iterable, List, Mapping, NamedTuple, Sequence, Tuple

MOST_LINES = 400            # of a section; the rest is counted
LONGEST = 100               # characters of a line
_INDENT = 10                # px for each level
_STYLE = "font:11px/1.4 system-ui,sans-serif;overflow-wrap:anywhere;padding:0 4px 6px"
_HIDDEN = ("/rosout",)      # every node has it

#: What the master tells: topics, or services, each with its nodes.
Names = Iterable[Tuple[str, Sequence[str]]]


class Section(NamedTuple):
    """A list with a ``title``; ``lines`` are (level of indentation, text)."""

    title: str
    lines: Tuple[Tuple[int, str], ...]


class Controller(NamedTuple):
    """A controller of ros_control: ``name``, ``kind``, ``state`` and the ``joints`` that it claims."""

    name: str
    kind: str
    state: str
    joints: Tuple[str, ...]


def nodes_section(published: Names, subscribed: Names) -> Section:
    """Return all nodes, each with the topics that it publishes and reads.

    Parameters
    ----------
    published, subscribed : iterable of (str, sequence of str)
        Topics and their nodes.
    """
    found: Dict[str, List[str]] = {}
    for mark, topics in (("publishes", published), ("reads", subscribed)):
        for topic, nodes in sorted(topics):
            for node in nodes:
                lines = found.setdefault(node, [])
                if topic not in _HIDDEN:
                    lines.append("%s %s" % (mark, topic))
    flat: List[Tuple[int, str]] = []
    for node in sorted(found):
        flat.append((0, node))
        flat += [(1, line) for line in found[node]]
    return Section("Nodes and topics", _bounded(flat))


def frames_section(parents: Mapping[str, str]) -> Section:
    """Return the tree of frames; frames whose parents form a loop are told as such.

    Parameters
    ----------
    parents : mapping of str to str
        Parent of each frame that has one.
    """
    children: Dict[str, List[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    waiting = [(0, root) for root in sorted(set(children) - set(parents), reverse=True)]
    lines, shown = [], set()
    while waiting:
        level, frame = waiting.pop()
        lines.append((level, frame))
        shown.add(frame)
        waiting += [(level + 1, child) for child in sorted(children.get(frame, ()), reverse=True)]
    lines += [(0, "%s: its parents form a loop" % frame) for frame in sorted(set(parents) - shown)]
    return Section("Frames", _bounded(lines))


def parameters_section(nodes: Mapping[str, Mapping[str, object]]) -> Section:
    """Return the parameters of nodes that can be changed while they run.

    Parameters
    ----------
    nodes : mapping of str to mapping
        Values of the parameters of each node.
    """
    lines: List[Tuple[int, str]] = []
    for node in sorted(nodes):
        lines.append((0, node))
        lines += [(1, "%s = %s" % (name, value)) for name, value in sorted(nodes[node].items())
                  if isinstance(value, (bool, int, float, str))]
    return Section("Parameters", _bounded(lines))


def controllers_section(managers: Mapping[str, Sequence[Controller]]) -> Section:
    """Return the controllers of each controller manager.

    Parameters
    ----------
    managers : mapping of str to sequence of Controller
        By the namespace of the manager.
    """
    lines: List[Tuple[int, str]] = []
    for manager in sorted(managers):
        lines.append((0, manager))
        for one in managers[manager]:
            lines.append((1, "%s: %s" % (one.name, one.state)))
            lines.append((2, one.kind))
            lines += [(2, joint) for joint in one.joints]
    return Section("Controllers", _bounded(lines))


def _bounded(lines: Sequence[Tuple[int, str]]) -> Tuple[Tuple[int, str], ...]:
    kept = [(level, text if len(text) <= LONGEST else text[:LONGEST - 3] + "...") for level, text in lines[:MOST_LINES]]
    if len(lines) > MOST_LINES:
        kept.append((0, "and %d more" % (len(lines) - MOST_LINES)))
    return tuple(kept)


def html_of(sections: Iterable[Section]) -> str:
    """Return the sections that have lines as HTML, each folded; nothing in a line can be a tag."""
    parts = []
    for title, lines in sections:
        if lines:
            body = "".join("<div style='padding-left:%dpx%s'>%s</div>" % (
                _INDENT * min(level + 1, 20), ";font-weight:600" if level == 0 else "", html.escape(text))
                for level, text in lines)
            parts.append("<details><summary>%s</summary>%s</details>" % (html.escape(title), body))
    return "<div style='%s'>%s</div>" % (_STYLE, "".join(parts)) if parts else ""
