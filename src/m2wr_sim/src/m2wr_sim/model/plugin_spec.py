# SPDX-License-Identifier: BSD-3-Clause
"""A ``<plugin>`` element of SDF or of a URDF ``<gazebo>`` block -> PluginSpec."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Iterator, Optional, Tuple

from lxml import etree

from m2wr_sim.model.types import PluginSpec
from m2wr_sim.model.xml.safe import fail, line_of, place

if TYPE_CHECKING:
    from m2wr_sim.model.notes import Notes


def tag_value(element: Any) -> str:
    """Return an element's stripped text or, without text, its ``value`` attribute or an empty string."""
    text = (element.text or "").strip()
    return text if text else (element.get("value") or "").strip()


def _parameters(element: Any, prefix: str = "") -> Iterator[Tuple[str, str]]:
    for child in element:
        tag = prefix + etree.QName(child).localname
        for name, text in child.attrib.items():
            if name != "value":
                yield "{}/@{}".format(tag, etree.QName(name).localname), text.strip()
        value = tag_value(child)
        if value or len(child) == 0:
            yield tag, value
        if len(child):
            yield from _parameters(child, tag + "/")


def read_plugin(element: Any, reference: Optional[str] = None, notes: Optional[Notes] = None) -> PluginSpec:
    """Read one ``<plugin name= filename=>``.

    Parameters
    ----------
    element : lxml element
        The plugin; its children become (tag, text) pairs, deeper ones under ``tag/tag``, attributes under
        ``tag/@name``.
    reference : str or None
        Link that a sensor plugin belongs to.
    notes : Notes or None
        Gets a warning if the plugin has no name, which Gazebo requires.

    Returns
    -------
    PluginSpec

    Raises
    ------
    XmlError
        If ``filename`` is missing.
    """
    filename = (element.get("filename") or "").strip()
    if not filename:
        fail(element, "attribute filename is missing or empty", "the library's file name, e.g. libgazebo_ros_laser.so")
    name = (element.get("name") or "").strip()
    if not name:
        name = filename
        if notes is not None:
            notes.add("{}: attribute name is missing or empty; expected a name; using {}.".format(
                place(element), filename))
    return PluginSpec(name=name, filename=filename, parameters=tuple(_parameters(element)), reference=reference,
                      where='{}: plugin "{}" ({})'.format(line_of(element), name, filename))
