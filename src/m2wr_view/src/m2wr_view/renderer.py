# SPDX-License-Identifier: BSD-3-Clause
"""Draws a scene from above, by cairo.

Layers that rarely change (background, axes, map, world, line, legend) and the trail are cached as images.  A frame
needs two copies, the scan, the robot and a line of text.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence, Tuple

import cairo
import numpy as np
from PIL import Image

from m2wr_view.layout import Framing, Window, nice_step
from m2wr_view.run_picture import (
    GOAL_COLOUR,
    HIT_COLOUR,
    LEAVE_COLOUR,
    LINE_COLOUR,
    OBSTACLE_COLOUR,
    OTHER_COLOUR,
    OVERHANG_COLOUR,
    STATE_COLOURS,
)
from m2wr_view.shapes import colours_of, draw_robot, draw_team, polyline, rgb, star, trace_outline, triangle

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array, Uint32Array
    from m2wr_view.layout import View
    from m2wr_view.scene import Scene
    from m2wr_view.solids import Ground

    LegendRow = Tuple[str, str, str]        # kind, colour, words

SCAN_COLOUR, ROBOT_COLOUR, MAP_COLOUR = "#56B4E9", "#D55E00", "#101010"
GRID_COLOUR, TEXT_COLOUR, EDGE_COLOUR, OVERHANG_EDGE = "#E6E6E6", "#202020", "#606060", "#A8A8A8"
RAYS_DRAWN = 90                     # of a scan; more would not be distinguishable
FONT = "DejaVu Sans"
HIDDEN = 0.25                       # m around the robot's origin, half the length of m2wr: a path there is hidden
LEGEND_WIDTH = 1400                 # units; of all entries of a run of Bug 2 with a map, beside each other
NAMED = 8                           # robots of a team that the legend names
LEAST_UNIT = 0.75                   # of texts, lines and margins; 12 units, the smaller font, are then 9 pixels


def _cell_colours() -> Uint32Array:
    """Return the pixels (256,) uint32 of cells by their values taken for uint8; unknown ones are clear."""
    pixels = np.zeros((256, 4), dtype=np.uint8)         # blue, green, red, alpha; colours times alpha
    pixels[:25], pixels[25:66], pixels[66:128] = (40, 36, 20, 40), (60, 60, 60, 120), (16, 16, 16, 255)
    return pixels.view(np.uint32).ravel()


CELL_COLOURS = _cell_colours()


def _state_colour(state: Optional[str]) -> str:
    return OTHER_COLOUR if state is None else STATE_COLOURS.get(state, OTHER_COLOUR)


def _has_moved(scene: Scene) -> bool:
    """Return whether some of the path is not hidden below the robot."""
    if scene.pose is None:
        return len(scene.trail) > 1
    return any(math.hypot(x - scene.pose[0], y - scene.pose[1]) > HIDDEN for x, y, _, _ in scene.trail)


class Renderer:
    """Draws scenes.

    Parameters
    ----------
    width, height : int
        Of the pictures [pixels].
    bounds : (4,) floats, optional
        Least x, least y, greatest x, greatest y to show [m]; default: everything is shown.
    """

    def __init__(self, width: int = 800, height: int = 800, bounds: Optional[Sequence[float]] = None) -> None:
        self.width, self.height = int(width), int(height)
        self._unit = max(LEAST_UNIT, min(width, height) / 800.0)
        unit = self._unit
        rows = min(math.ceil(LEGEND_WIDTH * unit / (width - 76 * unit)), int(0.2 * height / (20 * unit)))
        self._legend_height = 20 * unit * max(2, rows)
        window = Window(58 * unit, 40 * unit, width - 76 * unit, height - 104 * unit - self._legend_height)
        self._framing, self._window = Framing(window, bounds), window
        self._surface = cairo.ImageSurface(cairo.FORMAT_RGB24, self.width, self.height)
        self._base = cairo.ImageSurface(cairo.FORMAT_RGB24, self.width, self.height)
        self._base_key: Optional[Tuple[int, int, Tuple[LegendRow, ...]]] = None
        self._trail = cairo.ImageSurface(cairo.FORMAT_ARGB32, self.width, self.height)
        self._trail_key: Optional[Tuple[int, int]] = None
        self._drawn = 0                             # points of the trail that are in its image
        self._view: Optional[View] = None
        self._cells: Optional[Int8Array] = None     # of the newest map
        self._map: Optional[cairo.ImageSurface] = None      # what they look like
        self._ground: Optional[Tuple[int, Sequence[Ground], cairo.ImageSurface]] = None      # view, content, picture

    def draw(self, scene: Scene) -> Image.Image:
        """Return a scene as an RGB image of Pillow; a new image each time."""
        self._view = view = self._framing.view(scene)
        self._refresh_base(scene, view)
        self._refresh_trail(scene, view)
        context = cairo.Context(self._surface)
        context.set_operator(cairo.OPERATOR_SOURCE)
        context.set_source_surface(self._base, 0, 0)
        context.paint()
        context.set_operator(cairo.OPERATOR_OVER)
        self._header(context, scene)
        context.rectangle(*self._window)
        context.clip()
        self._draw_scan(context, scene, view)
        context.set_source_surface(self._trail, 0, 0)
        context.paint()
        self._draw_marks(context, scene, view)
        self._draw_robot(context, scene, view)
        self._surface.flush()
        return Image.frombuffer("RGB", (self.width, self.height), bytes(self._surface.get_data()), "raw", "BGRX",
                                self._surface.get_stride(), 1)

    # ---- cached layers ----------------------------------------------------------------------------------------

    def _refresh_base(self, scene: Scene, view: View) -> None:
        key = (id(view), scene.version, tuple(self._legend(scene, view)))
        if key == self._base_key:
            return
        self._base_key = key
        context = cairo.Context(self._base)
        context.set_source_rgb(1, 1, 1)
        context.paint()
        steps = self._grid(context, view)
        context.save()
        context.rectangle(*self._window)
        context.clip()
        self._draw_ground(context, scene.ground, view)
        self._draw_world(context, scene, view)
        if scene.grid is not None:
            self._draw_map(context, scene.grid, view)
        self._draw_line(context, scene, view)
        self._draw_names(context, scene, view)
        self._scale_bar(context, view)
        context.restore()
        self._axes(context, view, steps)
        self._draw_legend(context, scene, view)

    def _refresh_trail(self, scene: Scene, view: View) -> None:
        key = (id(view), scene.trail_version)
        context = cairo.Context(self._trail)
        if key != self._trail_key:
            self._trail_key, self._drawn = key, 0
            context.set_operator(cairo.OPERATOR_CLEAR)
            context.paint()
            context.set_operator(cairo.OPERATOR_OVER)
        context.rectangle(*self._window)
        context.clip()
        context.set_line_width(3.0 * self._unit)
        context.set_line_cap(cairo.LINE_CAP_ROUND)
        context.set_line_join(cairo.LINE_JOIN_ROUND)
        begin, trail = max(self._drawn - 1, 0), scene.trail
        while begin < len(trail) - 1:               # one stroke for each visit of a state
            end = begin + 1
            state = trail[end][2]
            while end < len(trail) - 1 and trail[end + 1][2] == state:
                end += 1
            context.set_source_rgb(*rgb(_state_colour(state)))
            context.move_to(*view.pixel(*trail[begin][:2]))
            for x, y, _, driven in trail[begin + 1:end + 1]:
                (context.line_to if driven else context.move_to)(*view.pixel(x, y))
            context.stroke()
            begin = end
        self._drawn = len(trail)

    # ---- layers of the base ------------------------------------------------------------------------------------

    def _grid(self, context: cairo.Context, view: View) -> List[List[float]]:
        """Draw lines at round metres; returns the positions of those along x and y."""
        low_x, low_y, high_x, high_y = view.bounds
        step = nice_step(max(high_x - low_x, high_y - low_y), 12)
        steps = [[number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]
                 for low, high in ((low_x, high_x), (low_y, high_y))]
        context.set_source_rgb(*rgb(GRID_COLOUR))
        context.set_line_width(1.0)
        left, top, width, height = self._window
        for x in steps[0]:
            column = round(view.pixel(x, 0.0)[0]) + 0.5
            polyline(context, ((column, top), (column, top + height)))
        for y in steps[1]:
            row = round(view.pixel(0.0, y)[1]) + 0.5
            polyline(context, ((left, row), (left + width, row)))
        context.stroke()
        return steps

    def _axes(self, context: cairo.Context, view: View, steps: List[List[float]]) -> None:
        left, top, width, height = self._window
        unit = self._unit
        context.set_source_rgb(*rgb(TEXT_COLOUR))
        context.set_line_width(1.2 * unit)
        context.rectangle(left, top, width, height)
        context.stroke()
        self._font(context, 12)
        for x in steps[0]:
            column = view.pixel(x, 0.0)[0]
            polyline(context, ((column, top + height), (column, top + height + 4 * unit)))
            self._text(context, "%g" % x, column, top + height + 17 * unit, 0.5)
        for y in steps[1]:
            row = view.pixel(0.0, y)[1]
            polyline(context, ((left - 4 * unit, row), (left, row)))
            self._text(context, "%g" % y, left - 7 * unit, row + 4 * unit, 1.0)
        context.stroke()
        self._text(context, "x [m]", left + 0.5 * width, top + height + 33 * unit, 0.5)
        context.save()
        context.translate(15 * unit, top + 0.5 * height)
        context.rotate(-0.5 * math.pi)
        self._text(context, "y [m]", 0.0, 0.0, 0.5)
        context.restore()

    def _scale_bar(self, context: cairo.Context, view: View) -> None:
        left, top, width, height = self._window
        unit = self._unit
        length = nice_step(0.06 * width / view.scale, 1)
        right, bottom, pixels = left + width - 16 * unit, top + height - 14 * unit, length * view.scale
        context.set_source_rgba(1, 1, 1, 0.85)
        context.rectangle(right - pixels - 10 * unit, bottom - 22 * unit, pixels + 20 * unit, 30 * unit)
        context.fill()
        context.set_source_rgb(*rgb(TEXT_COLOUR))
        context.set_line_width(2.0 * unit)
        for points in (((right - pixels, bottom), (right, bottom)),
                       ((right - pixels, bottom - 4 * unit), (right - pixels, bottom + 4 * unit)),
                       ((right, bottom - 4 * unit), (right, bottom + 4 * unit))):
            polyline(context, points)
        context.stroke()
        self._font(context, 12)
        self._text(context, "%g m" % length, right - 0.5 * pixels, bottom - 8 * unit, 0.5)

    def _draw_ground(self, context: cairo.Context, ground: Sequence[Ground], view: View) -> None:
        """Draw ground, which is kept as a picture: it has thousands of triangles."""
        if not ground:
            return
        if self._ground is None or self._ground[0] != id(view) or self._ground[1] is not ground:
            surface = cairo.ImageSurface(cairo.FORMAT_ARGB32, self.width, self.height)
            painter = cairo.Context(surface)
            painter.set_antialias(cairo.ANTIALIAS_NONE)         # else the edges of neighbours would be seen
            for piece in ground:
                for corners, colour in zip(view.pixels(piece.corners).tolist(), piece.colours.tolist()):
                    painter.set_source_rgb(*colour)
                    polyline(painter, corners, closed=True)
                    painter.fill()
            self._ground = (id(view), ground, surface)
        context.set_source_surface(self._ground[2], 0, 0)
        context.paint()

    @staticmethod
    def _draw_world(context: cairo.Context, scene: Scene, view: View) -> None:
        """Draw obstacles with an edge around each group of shapes that overlap, but not between these."""
        context.set_fill_rule(cairo.FILL_RULE_WINDING)
        context.set_line_width(2.2)                 # its inner half is hidden
        for outlines, colour, edge in ((scene.solids.hanging, OVERHANG_COLOUR, OVERHANG_EDGE),
                                       (scene.solids.blocking, OBSTACLE_COLOUR, EDGE_COLOUR)):
            for outline in outlines:
                trace_outline(context, outline, view)
            context.set_source_rgb(*rgb(edge))
            context.stroke_preserve()
            context.set_source_rgb(*rgb(colour))
            context.fill()

    def _draw_map(self, context: cairo.Context, grid: Tuple[FloatArray, float, Int8Array], view: View) -> None:
        transform, resolution, cells = grid
        rows, columns = cells.shape
        if cells is not self._cells:        # a map moves with every correction of the odometry, and changes seldom
            self._cells, self._map = cells, cairo.ImageSurface.create_for_data(
                CELL_COLOURS[cells.view(np.uint8)].data, cairo.FORMAT_ARGB32, columns, rows)
        context.save()
        # first cells, then metres of the map's origin, then metres of the scene, then pixels
        context.transform(cairo.Matrix(view.scale, 0, 0, -view.scale, *view.pixel(0.0, 0.0)))
        context.transform(cairo.Matrix(transform[0, 0], transform[1, 0], transform[0, 1], transform[1, 1],
                                       transform[0, 3], transform[1, 3]))
        context.scale(resolution, resolution)
        assert self._map is not None        # made with self._cells
        context.set_source_surface(self._map, 0, 0)
        fine = resolution * view.scale >= 1.0
        context.get_source().set_filter(cairo.FILTER_NEAREST if fine else cairo.FILTER_GOOD)
        context.paint()
        context.restore()

    def _draw_line(self, context: cairo.Context, scene: Scene, view: View) -> None:
        if len(scene.line) < 2:
            return
        unit = self._unit
        context.set_source_rgb(*rgb(LINE_COLOUR))
        context.set_line_width(1.4 * unit)
        context.set_dash((7 * unit, 5 * unit))
        polyline(context, view.pixels(scene.line).tolist())
        context.stroke()
        context.set_dash(())

    def _draw_names(self, context: cairo.Context, scene: Scene, view: View) -> None:
        """Draw places as white discs with their names."""
        self._font(context, 15, bold=True)
        for x, y, name in scene.names:
            column, row = view.pixel(x, y)
            width = context.text_extents(name)[4]
            context.new_sub_path()
            context.arc(column, row, max(0.5 * width + 4 * self._unit, 11 * self._unit), 0.0, 2.0 * math.pi)
            context.set_source_rgba(1.0, 1.0, 1.0, 0.7)
            context.fill()
            context.set_source_rgb(*rgb(TEXT_COLOUR))
            self._text(context, name, column, row + 5 * self._unit, 0.5)

    # ---- layers of each frame ----------------------------------------------------------------------------------

    def _draw_scan(self, context: cairo.Context, scene: Scene, view: View) -> None:
        rays = scene.rays()
        if rays is None:
            return
        origin, ends, hits = view.pixel(*rays[0]), view.pixels(rays[1]), rays[2]
        points = ends.tolist()
        colour = rgb(SCAN_COLOUR)
        context.move_to(*origin)
        for x, y in points:
            context.line_to(x, y)
        context.close_path()
        context.set_source_rgba(*colour, 0.16)
        context.fill()
        context.set_source_rgba(*colour, 0.55)
        context.set_line_width(0.8 * self._unit)
        context.set_antialias(cairo.ANTIALIAS_FAST)     # the best one takes three times as long here
        for x, y in points[::max(1, len(points) // RAYS_DRAWN)]:
            context.move_to(*origin)
            context.line_to(x, y)
        context.stroke()
        context.set_antialias(cairo.ANTIALIAS_DEFAULT)
        size = max(1, round(2.6 * self._unit))          # whole pixels, which are filled without any blending
        context.set_source_rgb(0.0, 0.33, 0.62)
        for x, y in np.rint(ends[hits] - 0.5 * size).tolist():
            context.rectangle(x, y, size, size)
        context.fill()

    def _draw_marks(self, context: cairo.Context, scene: Scene, view: View) -> None:
        unit = self._unit
        context.set_line_width(1.0 * unit)
        if scene.goal is not None:
            self._mark(context, GOAL_COLOUR, star, *view.pixel(*scene.goal), 12 * unit)
        for points, colour, down in ((scene.hits, HIT_COLOUR, True), (scene.leaves, LEAVE_COLOUR, False)):
            for point in points:
                self._mark(context, colour, triangle, *view.pixel(*point), 7 * unit, down)

    @staticmethod
    def _mark(context: cairo.Context, colour: str, shape: Callable[..., None], *arguments: Any) -> None:
        shape(context, *arguments)
        context.set_source_rgb(*rgb(colour))
        context.fill_preserve()
        context.set_source_rgb(0, 0, 0)
        context.stroke()

    def _draw_robot(self, context: cairo.Context, scene: Scene, view: View) -> None:
        if scene.pose is not None:
            draw_robot(context, scene.pose, scene.footprint, ROBOT_COLOUR, view, self._unit)
        draw_team(context, scene.team, scene.footprint, view, self._unit)

    # ---- words -------------------------------------------------------------------------------------------------

    def _font(self, context: cairo.Context, size: float, bold: bool = False) -> None:
        context.select_font_face(FONT, cairo.FONT_SLANT_NORMAL,
                                 cairo.FONT_WEIGHT_BOLD if bold else cairo.FONT_WEIGHT_NORMAL)
        context.set_font_size(size * self._unit)

    @staticmethod
    def _text(context: cairo.Context, text: str, x: float, y: float, anchor: float = 0.0) -> float:
        """Write at a baseline; ``anchor`` 0: begins at x, 1: ends there.  Returns its width."""
        width = context.text_extents(text)[4]
        context.move_to(x - anchor * width, y)
        context.show_text(text)
        context.new_path()
        return width

    def _header(self, context: cairo.Context, scene: Scene) -> None:
        """Write the state at the left, the time at the right, and the pose between them if it fits there."""
        unit, left = self._unit, self._window.left
        right = left + self._window.width
        if scene.state:
            context.set_source_rgb(*rgb(_state_colour(scene.state)))
            context.rectangle(left, 14 * unit, 14 * unit, 14 * unit)
            context.fill()
        context.set_source_rgb(*rgb(TEXT_COLOUR))
        self._font(context, 15, bold=True)
        if scene.state:
            left += 22 * unit
            left += self._text(context, scene.state.replace("_", " "), left, 26 * unit)
        if scene.now is not None:
            right -= self._text(context, "t = %.1f s" % scene.now, right, 26 * unit, 1.0)
        if scene.pose is not None:
            self._font(context, 12)
            # + 0.0 turns -0.00 into 0.00
            x, y, yaw = round(scene.pose[0], 2) + 0.0, round(scene.pose[1], 2) + 0.0, math.degrees(scene.pose[2])
            words = "x %.2f m, y %.2f m, heading %.0f°" % (x, y, round(math.remainder(yaw, 360.0)) + 0.0)
            if context.text_extents(words)[4] + 20 * unit <= right - left:
                self._text(context, words, 0.5 * (left + right), 26 * unit, 0.5)

    def _legend(self, scene: Scene, view: View) -> List[LegendRow]:
        """Return (kind, colour, words) of everything that is drawn."""
        shows = view.shows
        states = list(dict.fromkeys(state for _, _, state, _ in scene.trail[1:])) if _has_moved(scene) else []
        states += [scene.state] if scene.state and scene.state not in states and scene.trail else []
        rows: List[LegendRow] = [("patch", ROBOT_COLOUR, "robot")] if scene.pose is not None else []
        rows += [("patch", colour, name) for name, colour in list(colours_of(scene.team).items())[:NAMED]]
        rows += [("line", _state_colour(state), "path: " + state.replace("_", " ")
                  if state else "path") for state in states]
        rows += [("patch", OBSTACLE_COLOUR, "obstacle")] if any(map(shows, scene.solids.blocking)) else []
        rows += [("patch", OVERHANG_COLOUR, "above the robot")] if any(map(shows, scene.solids.hanging)) else []
        rows += [("patch", MAP_COLOUR, "occupied in the map")] if scene.grid is not None else []
        rows += [("fan", SCAN_COLOUR, "laser scan")] if scene.scan is not None else []
        rows += [("dash", LINE_COLOUR, "m-line"), ("star", GOAL_COLOUR, "goal (%.4g, %.4g) m" % scene.line[-1])] \
            if len(scene.line) > 1 else []
        rows += [("down", HIT_COLOUR, "hit point")] if scene.hits else []
        return rows + ([("up", LEAVE_COLOUR, "leave point")] if scene.leaves else [])

    def _draw_legend(self, context: cairo.Context, scene: Scene, view: View) -> None:
        unit = self._unit
        left, row = self._window.left, self.height - 12 * unit - self._legend_height
        column, end = left, left + self._window.width
        self._font(context, 12)
        for kind, colour, words in self._legend(scene, view):
            width = 26 * unit + context.text_extents(words)[4] + 16 * unit
            if column + width > end + 14 * unit and column > left:
                column, row = left, row + 20 * unit
            if row > self.height:
                break                               # a picture too small for its legend
            self._symbol(context, kind, colour, column, row - 4 * unit)
            context.set_source_rgb(*rgb(TEXT_COLOUR))
            self._text(context, words, column + 26 * unit, row)
            column += width

    def _symbol(self, context: cairo.Context, kind: str, colour: str, x: float, y: float) -> None:
        unit = self._unit
        context.set_source_rgb(*rgb(colour))
        context.set_line_width(3.0 * unit)
        if kind == "patch":
            context.rectangle(x, y - 6 * unit, 20 * unit, 12 * unit)
            context.fill()
        elif kind == "fan":
            context.set_source_rgba(*rgb(colour), 0.3)
            context.rectangle(x, y - 6 * unit, 20 * unit, 12 * unit)
            context.fill()
            context.set_source_rgb(0.0, 0.33, 0.62)
            context.rectangle(x + 16 * unit, y - 6 * unit, 3 * unit, 12 * unit)
            context.fill()
        elif kind in ("line", "dash"):
            context.set_dash((7 * unit, 5 * unit) if kind == "dash" else ())
            context.set_line_width((1.4 if kind == "dash" else 3.0) * unit)
            polyline(context, ((x, y), (x + 20 * unit, y)))
            context.stroke()
            context.set_dash(())
        else:
            context.set_line_width(1.0 * unit)
            if kind == "star":
                self._mark(context, colour, star, x + 10 * unit, y, 8 * unit)
            else:
                self._mark(context, colour, triangle, x + 10 * unit, y, 6 * unit, kind == "down")
