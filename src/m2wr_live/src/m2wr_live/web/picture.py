# SPDX-License-Identifier: BSD-3-Clause
"""Draws a :class:`~m2wr_live.scene.live_scene.LiveScene` with viser; only what has changed is sent."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Optional

import numpy as np

from m2wr_live.scene.shapes import UNITS, Geometry, quaternions_of
from m2wr_live.web.annotation_picture import AnnotationPicture, node_name
from m2wr_live.web.batches import Batches, LinkShapes
from m2wr_live.web.layers import LAYERS
from m2wr_live.web.map_pixels import pixels_of
from m2wr_live.web.segments import Segments
from m2wr_live.web.trail_picture import TrailPicture

if TYPE_CHECKING:
    from m2wr_live.scene.live_scene import Grid, LiveScene, Robot
    from m2wr_node.array_types import FloatArray

#: Where the grid is [m]; it is drawn around the camera in any case. What is transparent is drawn in the order of the
#: distance of its middle: lines on the floor whose middle was further away than the grid's were covered by it.
_GRID = (0.0, -1000.0, 0.0)
GROUND = 0.004              # m; height at which maps are drawn, above the grid
ABOVE = 0.02                # m; height of lines on the floor, above maps
SELDOM = 3                  # pictures from one drawing of beams, names and trails to the next
BEAMS, PATH, LINE = (240, 150, 100), (0, 158, 115), (204, 121, 167)
SKY, GROUND_LIGHT = (255, 255, 255), (140, 140, 140)       # light from above and from below
HIT, LEAVE, GOAL = (213, 43, 30), (0, 158, 115), (230, 159, 0)


class _Held:
    """An object that is compared by identity; it is held, so that no new object can have its address."""

    __slots__ = ("_object",)

    def __init__(self, held: object) -> None:
        self._object = held

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Held) and other._object is self._object

    def __hash__(self) -> int:
        return id(self._object)


class Picture:
    """What all pages show of a scene.

    Parameters
    ----------
    scene : viser.SceneApi
    source : LiveScene

    Attributes
    ----------
    robot_shapes : LinkShapes
        Of all robots.
    """

    def __init__(self, scene: Any, source: LiveScene) -> None:
        self._scene, self.source = scene, source
        scene.set_up_direction("+z")
        scene.configure_default_lights(cast_shadow=True)
        scene.configure_environment_map(hdri=None)      # a browser without a GPU needs seconds for one
        scene.add_light_hemisphere("/sky", sky_color=SKY, ground_color=GROUND_LIGHT, intensity=2.0)
        self._floor = scene.add_grid("/floor", width=100.0, height=100.0, cell_size=1.0, section_size=5.0, plane="xy",
                                     infinite_grid=True, shadow_opacity=0.25, position=_GRID)
        for name in [name for _, name in LAYERS] + ["names"]:
            scene.add_frame("/" + name, show_axes=False)
        self.world, self._robots = Batches(scene, "/world"), Batches(scene, "/robots")
        self._looks, self._look_shapes = Batches(scene, "/looks"), LinkShapes([])
        self.robot_shapes = LinkShapes([])
        self._drawn: Dict[str, object] = {}
        self._nodes: Dict[str, Any] = {}
        self._number = 0                    # of the picture
        self._beams, self._trails = Segments(scene, "/beams/all", BEAMS, 0.8), TrailPicture(scene, source)
        self._annotations = AnnotationPicture(scene, source)

    def draw(self) -> None:
        """Send what has changed since the last call."""
        self._draw_world()
        self._draw_relief()
        self._draw_robots()
        self._draw_paths()
        self._draw_particles()
        self._draw_marks()
        self._annotations.draw()
        if self._number % SELDOM == 0:
            self._draw_beams()
            self._place_names()
            self._trails.draw()
        self._number += 1
        for number, (topic, grid) in enumerate(sorted(self.source.grids.items())):
            if self._changed("map " + topic, _Held(grid.cells), grid.pose.tobytes(), number):
                self._draw_map(topic, grid, GROUND * (1 + number))

    def _changed(self, name: str, *content: object) -> bool:
        """Return whether something differs from what was drawn under this name."""
        if self._drawn.get(name) == content:
            return False
        self._drawn[name] = content
        return True

    def _forget(self, name: str) -> None:
        node = self._nodes.pop(name, None)
        if node is not None:
            node.remove()

    # ---- bodies ------------------------------------------------------------------------------------------------

    @property
    def geometries(self) -> Dict[str, Geometry]:
        """All geometries of the scene."""
        found = dict(UNITS)
        found.update(self.source.markers.geometries)
        for robot in list(self.source.robots.values()) + list(self.source.models_with_looks.values()):
            found.update(robot.model.geometries)
        return found

    def world_poses(self) -> FloatArray:
        """Return the poses (n, 4, 4) of the shapes of the world."""
        return np.array([shape.pose for shape in self.source.markers.shapes]).reshape(-1, 4, 4)

    def _draw_world(self) -> None:
        """Draw the markers, but for models that have looks of their own."""
        markers, models = self.source.markers, dict(self.source.models_with_looks)
        if self._changed("looks", *map(_Held, models.values())):
            self._look_shapes = LinkShapes(list(models.values()))
            self._look_shapes.draw(self._looks, self.geometries)
        elif models:
            self._looks.move(self._look_shapes.poses())
        if self._changed("world", markers.version, tuple(models)):
            shapes = [shape for shape in markers.shapes if shape.owner not in models]
            self.world.set_shapes(shapes, self.geometries, np.array([shape.pose for shape in shapes]).reshape(-1, 4, 4))

    def _draw_relief(self) -> None:
        """Draw ground that is not level instead of the grid, which would lie above its hollows."""
        relief = self.source.relief
        if not self._changed("relief", _Held(relief)):
            return
        self._forget("relief")
        self._floor.visible = relief is None
        if relief is not None:
            self._nodes["relief"] = self._scene.add_mesh_trimesh("/relief", relief.mesh())

    def _draw_robots(self) -> None:
        robots = list(self.source.robots.values())
        if self._changed("robots", *map(_Held, robots)):
            self.robot_shapes = LinkShapes(robots)
            self.robot_shapes.draw(self._robots, self.geometries)
            self._draw_names(robots)
        elif robots:
            self._robots.move(self.robot_shapes.poses())

    def _place_names(self) -> None:
        for robot in self.source.robots.values():
            label = self._nodes.get("name " + robot.name)
            if label is not None and robot.pose is not None:
                label.position = robot.pose[:3, 3] + (0.0, 0.0, 0.45)

    def _draw_names(self, robots: List[Robot]) -> None:
        for name in [name for name in self._nodes if name.startswith("name ")]:
            self._forget(name)
        if len(robots) > 1:
            for number, robot in enumerate(robots):
                self._nodes["name " + robot.name] = self._scene.add_label("/names/%d" % number, robot.name[:40])

    # ---- lines -------------------------------------------------------------------------------------------------

    def _draw_beams(self) -> None:
        beams = list(self.source.beams.values())
        if self._changed("beams", *map(_Held, beams)):
            self._beams.set(np.concatenate(beams) if beams else np.zeros((0, 2, 3)))

    def _draw_paths(self) -> None:
        for topic, points in list(self.source.paths.items()):
            name = "paths " + topic
            if not self._changed(name, _Held(points)):
                continue
            self._forget(name)
            if len(points) >= 2:
                raised = points + (0.0, 0.0, ABOVE)
                colour = LINE if topic.endswith("m_line") else PATH
                self._nodes[name] = self._scene.add_line_segments(
                    "/paths/" + node_name(topic), np.stack((raised[:-1], raised[1:]), axis=1).astype(np.float32),
                    colour, thickness=3.0, thickness_units="screen")

    def _draw_particles(self) -> None:
        for topic, points in list(self.source.particles.items()):
            name = "particles " + topic
            if not self._changed(name, _Held(points)):
                continue
            self._forget(name)
            if len(points):
                self._nodes[name] = self._scene.add_point_cloud(
                    "/particles/" + node_name(topic), (points + (0.0, 0.0, ABOVE)).astype(np.float32), (200, 30, 120),
                    point_size=0.03)

    def _draw_marks(self) -> None:
        """Draw hit points, leave points and the goal, which is the end of Bug 2's line."""
        source = self.source
        lines = [points for topic, points in source.paths.items() if topic.endswith("m_line") and len(points)]
        goal = tuple(lines[0][-1][:2]) if lines else None
        if not self._changed("marks", tuple(source.hits), tuple(source.leaves), goal):
            return
        for name in [name for name in self._nodes if name.startswith("mark ")]:
            self._forget(name)
        marks = [("H%d" % (number + 1), place, HIT) for number, place in enumerate(source.hits)]
        marks += [("L%d" % (number + 1), place, LEAVE) for number, place in enumerate(source.leaves)]
        if goal is not None:
            marks.append(("goal", (float(goal[0]), float(goal[1])), GOAL))
        for label, (x, y), colour in marks:
            self._nodes["mark " + label] = self._scene.add_cylinder(
                "/marks/" + label, radius=0.12, height=0.03, color=colour, position=(x, y, ABOVE))
            self._scene.add_label("/marks/%s/label" % label, label, position=(0.0, 0.0, 0.3))

    # ---- maps --------------------------------------------------------------------------------------------------

    def _draw_map(self, topic: str, grid: Grid, height_above: float) -> None:
        """Draw a map as a picture on the floor, at a height [m]."""
        rows, columns = grid.cells.shape
        self._forget("map " + topic)
        width, height = columns * grid.resolution, rows * grid.resolution
        # the picture's first row is its top, and its x axis goes to the right: it looks up after a turn about x
        centre = grid.pose.dot((0.5 * width, 0.5 * height, height_above, 1.0))[:3]
        turned = grid.pose[:3, :3].dot(np.diag((1.0, -1.0, -1.0)))
        self._nodes["map " + topic] = self._scene.add_image(
            "/maps/" + node_name(topic), pixels_of(topic, grid.cells), width, height, format="png", cast_shadow=False,
            position=centre, wxyz=quaternions_of(turned[None])[0])


def look_of(scene: LiveScene) -> Optional[FloatArray]:
    """Return the middle (3,) [m] of what a new page looks at: the first robot, else the world."""
    for robot in scene.robots.values():
        if robot.pose is not None:
            found: FloatArray = robot.pose[:3, 3]
            return found
    shapes = scene.markers.shapes
    return np.mean([shape.pose[:3, 3] for shape in shapes], axis=0) if shapes else None
