# SPDX-License-Identifier: BSD-3-Clause
"""Switches with which a page hides parts of the scene for itself; the other pages keep showing them."""
from __future__ import annotations

from typing import Any

import viser._messages

#: Switches: label -> node of the scene.
LAYERS = (("Laser beams", "beams"), ("Trails", "trails"), ("Goals and points", "marks"), ("Maps", "maps"),
          ("Paths", "paths"), ("Particles", "particles"), ("Markers, frontiers", "markers"))


def add_layers(client: Any) -> None:
    """Add the switches to the panel of a page.

    Parameters
    ----------
    client : viser.ClientHandle
    """
    with client.gui.add_folder("Show", order=20, expand_by_default=False):
        for label, name in LAYERS:
            _add_switch(client, label, name)


def _add_switch(client: Any, label: str, name: str) -> None:
    box = client.gui.add_checkbox(label, True)

    @box.on_update
    def _(_event: Any) -> None:
        # the nodes are those of all pages, and viser's handles show or hide them on all
        client._websock_connection.queue_message(
            viser._messages.SetSceneNodeVisibilityMessage("/" + name, bool(box.value)))
