# SPDX-License-Identifier: BSD-3-Clause
"""All pages of a live view: what is drawn for all, a panel for each, plots, the status."""
from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING, Any, Dict, List, Optional

import numpy as np

from m2wr_live.scene import overview
from m2wr_live.scene.series import RealTimeFactor, Series, contacts_of
from m2wr_live.scene.tables import html_of
from m2wr_live.web.panel import Panel
from m2wr_live.web.picture import Picture, look_of
from m2wr_view.frames import planar
from m2wr_view.outlines import M2WR_FOOTPRINT
from m2wr_view.solids import Solids

if TYPE_CHECKING:
    from m2wr_live.scene.live_scene import LiveScene
    from m2wr_live.web.actions import Actions
    from m2wr_live.web.server import PageServer
    from m2wr_view.outlines import Outline

log = logging.getLogger("m2wr_live")

LISTS = "Nodes, frames, parameters"
_PROBLEMS = 3               # lines of the status
_PLOTS = (("Speed [m/s]", 1, "#0072b2"), ("Clearance [m]", 2, "#d55e00"), ("Distance [m]", 3, "#009e73"))

#: The least range of values is from 0 to 0.1; a robot at rest would have an axis of numbers that are all written "0".
_SCALES = {"x": {"time": False}, "y": {"range": {"min": {"pad": 0.0, "soft": 0.0, "mode": 1},
                                                 "max": {"pad": 0.1, "soft": 0.11, "mode": 1}}}}


class Pages:
    """Draws a scene for all pages.

    Parameters
    ----------
    server : PageServer
    source : LiveScene
    actions : Actions or None
        None: pages may only watch.
    """

    def __init__(self, server: PageServer, source: LiveScene, actions: Optional[Actions]) -> None:
        self.server, self.source, self._actions = server, source, actions
        self.viser: Any = server.viser
        self.picture = Picture(self.viser.scene, source)
        self.solids, self.footprint, self.footprint_of = Solids(), list(M2WR_FOOTPRINT), ""
        self._series, self._factor = Series(), RealTimeFactor()
        self._panels: Dict[int, Panel] = {}
        self._lock = threading.Lock()
        self._plots: List[Any] = []
        self._shown_tables: List[Any] = []
        self.problems: List[str] = []       # what is not shown, and why
        self.sections: List[overview.Section] = []
        self.viser.gui.configure_theme(show_logo=False, show_share_button=False)
        self.viser.gui.set_panel_label("m2wr live view")
        self._make_shared_panel()
        self.viser.on_client_connect(self._connected)
        self.viser.on_client_disconnect(self._disconnected)

    def _make_shared_panel(self) -> None:
        gui = self.viser.gui
        with gui.add_folder("Last minute", order=10):
            empty = np.zeros(1)
            for title, _, colour in _PLOTS:
                self._plots.append(gui.add_uplot(
                    (empty, empty), ({"label": "t [s]"}, {"label": title, "stroke": colour, "width": 2}), title=title,
                    scales=_SCALES, height=130, legend={"show": False}))
        self._table_folder = gui.add_folder("Paths to choose from", order=5, visible=False)
        with self._table_folder:
            self._table = gui.add_html("")
        self._lists_folder = gui.add_folder(LISTS, order=21, expand_by_default=False, visible=False)
        with self._lists_folder:
            self._lists = gui.add_html("")

    # ---- pages -------------------------------------------------------------------------------------------------

    def _connected(self, client: Any) -> None:
        try:
            panel = Panel(client, self.picture, self._actions)
            middle = look_of(self.source)
            if middle is not None:
                panel.look(middle)
            with self._lock:
                self._panels[client.client_id] = panel
        except Exception as error:      # the page was closed meanwhile
            log.debug("page %d: %s", client.client_id, error)

    def _disconnected(self, client: Any) -> None:
        with self._lock:
            self._panels.pop(client.client_id, None)

    @property
    def panels(self) -> List[Panel]:
        """The panels of all open pages."""
        with self._lock:
            return list(self._panels.values())

    # ---- drawing -----------------------------------------------------------------------------------------------

    def draw(self) -> None:
        """Send what has changed; called up to thirty times a second."""
        with self.viser.atomic():
            self.picture.draw()
        for panel in self.panels:
            panel.set_robots(list(self.source.robots))
            panel.follow()

    def forget_run(self) -> None:
        """Begin the plots again, after a jump in a recording."""
        self._series, self._factor = Series(), RealTimeFactor()

    def measure(self, wall: float, obstacles: List[Outline], paused: Optional[bool], topics: List[str],
                others: Dict[str, str]) -> None:
        """Update status and plots; called a few times a second.

        Parameters
        ----------
        wall : float
            [s]
        obstacles : list of Outline
            In the world.
        paused : bool or None
            Whether the simulation is paused; None: not known.
        topics : list of str
            On which pages may drive.
        others : dict of str to str
            Topic -> another node that drives on it.
        """
        source = self.source
        robot = next(iter(source.robots.values()), None)
        pose = None if robot is None or robot.pose is None else planar(robot.pose)
        factor = self._factor.update(wall, source.now)
        if self._series.sample(source.now, pose, obstacles, self.footprint) and self._panels:
            columns = self._series.columns()
            for plot, (_, row, _) in zip(self._plots, _PLOTS):
                known = np.isfinite(columns[row])           # the plot shows nothing if one value is not a number
                if known.any():
                    plot.data = (columns[0][known], columns[row][known])
        self._show_table()
        self._show_lists()
        for panel in self.panels:
            panel.show_speed()
        clearance = self._series.clearance
        contacts = contacts_of(source.values)
        lines = ["time  %.1f s%s" % (source.now, "   paused" if paused else ""),
                 "real-time factor  %.2f" % factor]
        if not source.now and robot is None:
            lines.append("waiting for the simulation")
        if robot is not None:
            lines.append("clearance  %s" % ("no obstacle near" if clearance is None else "%.2f m" % clearance))
            lines.append("contacts  %s" % (contacts.get(robot.name, 0) if contacts or source.values else "not known"))
        if source.state:
            lines.append("state  " + source.state[:60])
        recorded = None if self._actions is None else self._actions.recording()
        if recorded is not None:
            lines.append("recording  %.0f s" % recorded)
        lines += self.problems[:_PROBLEMS]
        if len(source.robots) > 1:
            lines.append("robots  %d" % len(source.robots))
        if source.markers.left_out:
            lines.append("%d shapes are not shown" % source.markers.left_out)
        self.server.status = {"lines": lines, "drive": topics, "others": others}

    def _show_table(self) -> None:
        """Show the tables of the scene, if they have changed."""
        tables = [rows for _, rows in sorted(self.source.tables.items())]
        if tables != self._shown_tables:
            self._shown_tables = tables
            self._table.content = "".join(map(html_of, tables))
            self._table_folder.visible = bool(tables)

    def _show_lists(self) -> None:
        """Show nodes, frames and parameters, if they have changed."""
        text = overview.html_of(self.sections)
        if text != self._lists.content:
            self._lists.content = text
            self._lists_folder.visible = bool(text)
