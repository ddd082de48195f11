# SPDX-License-Identifier: BSD-3-Clause
"""Shapes that pictures from above consist of, drawn by cairo."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Dict, Sequence, Tuple

import cairo
import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.frames import Numbers
    from m2wr_view.layout import View
    from m2wr_view.outlines import Outline
    from m2wr_view.team import Member, Team

    Colour = Tuple[float, float, float]
    Points = Sequence[Sequence[float]]

#: Of the robots of a team, in turn; from the palette of Okabe and Ito (2008), for all kinds of colour vision.
TEAM_COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")


def rgb(text: str) -> Colour:
    """Return red, green, blue from 0 to 1 of ``#RRGGBB``."""
    red, green, blue = (int(text[at:at + 2], 16) / 255.0 for at in (1, 3, 5))
    return red, green, blue


def polyline(context: cairo.Context, points: Points, closed: bool = False) -> None:
    """Add a line through some points to the current path.

    Parameters
    ----------
    context : cairo.Context
    points : sequence of (2,) float
        Column and row [pixels].
    closed : bool, optional
    """
    context.move_to(*points[0])
    for point in points[1:]:
        context.line_to(*point)
    if closed:
        context.close_path()


def trace_outline(context: cairo.Context, outline: Outline, view: View) -> None:
    """Add an outline to the current path: its polygon, or its disc where it is one.

    Parameters
    ----------
    context : cairo.Context
    outline : Outline
        In world [m].
    view : View
        Maps world to pixels.
    """
    points = view.pixels(outline.vertices).tolist()
    if len(points) == 1:
        context.new_sub_path()
        # the same sense of rotation as polygons have, so that what overlaps is one area in a common path
        context.arc_negative(points[0][0], points[0][1], outline.radius * view.scale, 2.0 * math.pi, 0.0)
    else:
        polyline(context, points, closed=True)


def triangle(context: cairo.Context, x: float, y: float, size: float, down: bool) -> None:
    """Add a triangle to the current path.

    Parameters
    ----------
    context : cairo.Context
    x, y : float
        Its centre [pixels].
    size : float
        Half its width [pixels].
    down : bool
        Whether it points down.
    """
    tall = size if down else -size
    context.move_to(x - size, y - 0.6 * tall)
    context.line_to(x + size, y - 0.6 * tall)
    context.line_to(x, y + tall)
    context.close_path()


def star(context: cairo.Context, x: float, y: float, size: float) -> None:
    """Add a star of five points to the current path.

    Parameters
    ----------
    context : cairo.Context
    x, y : float
        Its centre [pixels].
    size : float
        Its radius [pixels].
    """
    for corner in range(10):
        angle, radius = math.pi * (corner / 5.0 - 0.5), size if corner % 2 == 0 else 0.42 * size
        context.line_to(x + radius * math.cos(angle), y + radius * math.sin(angle))
    context.close_path()


def draw_robot(context: cairo.Context, pose: Numbers, footprint: Sequence[Outline], colour: str, view: View,
               unit: float) -> None:
    """Draw a robot, with an arrow ahead.

    Parameters
    ----------
    context : cairo.Context
    pose : (3,) float
        x, y [m] and yaw [rad].
    footprint : sequence of Outline
        In the robot's frame [m].
    colour : str
        As ``#RRGGBB``.
    view : View
    unit : float
        Of lines and texts [pixels].
    """
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turn: FloatArray = np.array(((cosine, sine), (-sine, cosine)))
    for fill in (False, True):                  # edges of all parts below the faces of all parts
        for part in footprint:
            trace_outline(context, replace(part, vertices=part.vertices.dot(turn) + (x, y)), view)
            if fill:
                context.set_source_rgb(*rgb(colour))
                context.fill()
            else:
                context.set_source_rgb(0, 0, 0)
                context.set_line_width(2.4 * unit)
                context.stroke()
    head = max(0.12 * view.scale, 4 * unit)     # which way is ahead
    column, row = view.pixel(x, y)
    context.move_to(column + 1.4 * head * cosine, row - 1.4 * head * sine)
    for side in (2.5, -2.5):
        context.line_to(column + head * math.cos(yaw + side), row - head * math.sin(yaw + side))
    context.close_path()
    context.set_source_rgb(1, 1, 1)
    context.fill()


def colours_of(team: Team) -> Dict[str, str]:
    """Return the colours of robots by their names, as ``#RRGGBB``; more than eight share some."""
    return {name: TEAM_COLOURS[number % len(TEAM_COLOURS)] for number, name in enumerate(sorted(team.members))}


def draw_team(context: cairo.Context, team: Team, footprint: Sequence[Outline], view: View, unit: float) -> None:
    """Draw several robots and where they have been.

    Parameters
    ----------
    context : cairo.Context
    team : Team
    footprint : sequence of Outline
        Of each robot, in its frame [m].
    view : View
    unit : float
        Of lines and texts [pixels].
    """
    colours = colours_of(team)
    context.set_line_width(2.4 * unit)
    context.set_line_join(cairo.LINE_JOIN_ROUND)
    for name, colour in colours.items():
        context.set_source_rgb(*rgb(colour))
        _trace_path(context, team.members[name], view)
        context.stroke()
    for name, colour in colours.items():
        draw_robot(context, team.members[name].pose, footprint, colour, view, unit)


def _trace_path(context: cairo.Context, member: Member, view: View) -> None:
    for x, y, driven in member.path:
        (context.line_to if driven else context.move_to)(*view.pixel(x, y))
    if member.path:
        context.line_to(*view.pixel(*member.pose[:2]))
