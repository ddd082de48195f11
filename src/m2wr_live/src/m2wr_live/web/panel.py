# SPDX-License-Identifier: BSD-3-Clause
"""The panel of one page: buttons of the simulation, what a click does, the camera."""
from __future__ import annotations

import logging
import math
import threading
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple

import numpy as np

from m2wr_live.scene.relief import height_of
from m2wr_live.web.actions import PLACEABLE
from m2wr_live.web.layers import add_layers
from m2wr_live.web.picking import first_hit, on_ground, read_ray
from m2wr_live.web.speed import SpeedList
from m2wr_view.errors import ViewError
from m2wr_view.frames import yaw_of

if TYPE_CHECKING:
    from m2wr_live.web.actions import Actions
    from m2wr_live.web.picture import Picture
    from m2wr_node.array_types import FloatArray

log = logging.getLogger("m2wr_live")

SELECT, GOAL, PLACE, MODEL = "select and drag", "send a goal", "place a ", "place the model "
AS_IT_IS = "as it is"
FREE, FOLLOW, TOP = "free", "follow the robot", "from above"
_HEIGHT = 14.0              # m above the robot of the camera from above
_START = np.array((-5.0, -5.0, 4.5))        # m from what the page looks at first
_JUMP = 2.0                 # m in one picture; the camera follows at once


def attempt(client: Any, action: Callable[[], Any]) -> None:
    """Run an action of the user; tell the user of this page if it fails.

    Parameters
    ----------
    client : viser.ClientHandle
    action : callable
        Raises ViewError if it fails.
    """
    try:
        action()
    except ViewError as error:
        log.warning("%s", error)
        client.add_notification("That did not work", str(error), color="red", auto_close_seconds=8.0)


def add_downloads(gui: Any, bag: Callable[[], bytes], film: Callable[[], bytes]) -> None:
    """Add buttons with which a page gets the files of a recording.

    Parameters
    ----------
    gui : viser.GuiApi
    bag, film : callable
        Return the content of the files, or raise ViewError.
    """
    download = gui.add_button_group("Download", ("bag", "film"))

    @download.on_click
    def _(event: Any) -> None:
        client = event.client
        if download.value != "film":
            attempt(client, lambda: client.send_file_download("run.bag", bag()))
            return
        note = client.add_notification("Film", "It is being drawn.", loading=True, with_close_button=False)
        attempt(client, lambda: client.send_file_download("run.gif", film()))
        note.remove()


class Panel:
    """The panel, the selection and the camera of one page.

    Parameters
    ----------
    client : viser.ClientHandle
    picture : Picture
    actions : Actions or None
        None: the page may only watch.
    """

    def __init__(self, client: Any, picture: Picture, actions: Optional[Actions]) -> None:
        self._client, self._picture, self._actions = client, picture, actions
        self.selected: Optional[str] = None
        self._gizmo: Any = None
        self._dragged: Optional[Tuple[float, float, float, float]] = None       # x, y, z [m], yaw [rad]
        self._lock = threading.Lock()
        self._followed: Optional[FloatArray] = None
        self._speed: Optional[SpeedList] = None
        if actions is not None:
            self._make_simulation(actions)
            self._make_clicks(actions)
            self._make_recording(actions)
        self._make_camera()
        add_layers(client)

    # ---- parts of the panel ------------------------------------------------------------------------------------

    def _make_simulation(self, actions: Actions) -> None:
        gui = self._client.gui
        with gui.add_folder("Simulation", order=1):
            pause = gui.add_button_group("Time", ("pause", "continue", "step"))
            self._speed = SpeedList(gui, actions, self.attempt)
            reset = gui.add_button("Reset the world", color="gray", hint="all models go back to where they began")
            world = gui.add_dropdown("World", (AS_IT_IS,) + tuple(actions.worlds()),
                                     hint="its models replace those that are there; robots stay")
        orders: Dict[str, Callable[[], None]] = {"pause": actions.pause, "continue": actions.resume,
                                                 "step": actions.step}

        @pause.on_click
        def _(_event: Any) -> None:
            self.attempt(orders.get(str(pause.value), lambda: None))

        @reset.on_click
        def _(_event: Any) -> None:
            self.attempt(actions.reset)

        @world.on_update
        def _(_event: Any) -> None:
            if world.value != AS_IT_IS:
                self.attempt(lambda: actions.load_world(str(world.value)))

    def _make_recording(self, actions: Actions) -> None:
        gui = self._client.gui
        with gui.add_folder("Recording", order=4, expand_by_default=False):
            record = gui.add_button_group("All topics", ("record", "stop"))
            add_downloads(gui, actions.bag, actions.film)

        @record.on_click
        def _(_event: Any) -> None:
            self.attempt(actions.record if record.value == "record" else actions.stop_recording)

    def _make_clicks(self, actions: Actions) -> None:
        gui, client = self._client.gui, self._client
        with gui.add_folder("Click in the scene", order=2):
            self._mode = gui.add_dropdown("Action", (SELECT, GOAL) + tuple(PLACE + kind for kind in PLACEABLE)
                                          + tuple(MODEL + name for name in actions.models()))
            self._scale = gui.add_slider("Size", min=0.2, max=4.0, step=0.1, initial_value=1.0, visible=False)
            self._yaw = gui.add_slider("Heading [deg]", min=-180.0, max=180.0, step=5.0, initial_value=0.0,
                                       visible=False)
            self._shown = gui.add_text("Selected", initial_value="nothing", disabled=True)
            self._delete = gui.add_button("Delete the selected model", disabled=True)

        @self._mode.on_update
        def _(_event: Any) -> None:
            mode = str(self._mode.value)
            placing = mode.startswith((PLACE, MODEL))
            self._scale.visible, self._yaw.visible = mode.startswith(PLACE), placing
            self._shown.visible = self._delete.visible = not placing

        @self._delete.on_click
        def _(_event: Any) -> None:
            name = self.selected
            if name is not None:
                self.attempt(lambda: self._delete_model(name))

        @client.scene.on_click()
        def _(event: Any) -> None:
            self.attempt(lambda: self.click(event.ray_origin, event.ray_direction))

    def _make_camera(self) -> None:
        gui, client = self._client.gui, self._client
        with gui.add_folder("Camera", order=3):
            self._camera = gui.add_dropdown("View", (FREE, FOLLOW, TOP))
            self._robot = gui.add_dropdown("Robot", ("the first",), visible=False)
        client.camera.up_direction = (0.0, 0.0, 1.0)

        @self._camera.on_update
        def _(_event: Any) -> None:
            self._followed = None
            pose = self._robot_place()
            if pose is None:
                return
            offset = np.array((0.0, -0.01, _HEIGHT)) if self._camera.value == TOP else 0.7 * _START
            if self._camera.value != FREE:
                with client.atomic():
                    client.camera.position, client.camera.look_at = pose + offset, pose

    def attempt(self, action: Callable[[], Any]) -> None:
        """Run an action of the user; tell the user of this page if it fails."""
        attempt(self._client, action)

    # ---- clicks ------------------------------------------------------------------------------------------------

    def click(self, origin: Any, direction: Any) -> None:
        """Answer a click on the scene along a ray.

        Parameters
        ----------
        origin, direction : (3,) floats
            In the fixed frame [m].

        Raises
        ------
        ViewError
            If what is asked for is not possible.
        """
        actions, mode = self._actions, str(self._mode.value)
        if actions is None:
            return
        origin, direction = read_ray(origin, direction)
        if mode == SELECT:
            self._select(self._hit(origin, direction))
            return
        place = on_ground(origin, direction, self._picture.source.relief)
        if place is None:
            raise ViewError("the click is not on the ground")
        if mode == GOAL:
            actions.goal(place[0], place[1], self._picture.source.frame)
            return
        yaw = math.radians(float(self._yaw.value))
        if mode.startswith(MODEL):
            actions.place_model(mode[len(MODEL):], place, yaw)
        elif mode[len(PLACE):] in PLACEABLE:
            actions.place(mode[len(PLACE):], place, yaw, float(self._scale.value))

    def _hit(self, origin: Any, direction: Any) -> Optional[str]:
        """Return the name of the model that a ray meets first, or None."""
        picture = self._picture
        shapes, poses = list(picture.source.markers.shapes), list(picture.world_poses())
        for (robot, shape), pose in zip(picture.robot_shapes.shapes, picture.robot_shapes.poses()):
            shapes.append(shape._replace(owner=robot.name))
            poses.append(pose)
        return first_hit(origin, direction, shapes, poses, picture.geometries)

    def _select(self, name: Optional[str]) -> None:
        """Put the gizmo at a model; None: remove it."""
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None
        self.selected = name
        self._shown.value = "nothing" if name is None else name
        self._delete.disabled = name is None
        if name is None or self._actions is None:
            return
        place = self._actions.model_pose(name)
        yaw = yaw_of(place.quaternion)
        gizmo = self._client.scene.add_transform_controls(
            "/gizmo", scale=1.2, active_axes=(True, True, False), depth_test=False,
            position=(place.position[0], place.position[1], place.position[2] + 0.05),
            wxyz=(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)))
        source = self._picture.source
        above = place.position[2] - height_of(source.relief, place.position[0], place.position[1])

        @gizmo.on_update
        def _(_event: Any) -> None:
            w, x, y, z = (float(number) for number in gizmo.wxyz)
            px, py = float(gizmo.position[0]), float(gizmo.position[1])
            target = (px, py, above + height_of(source.relief, px, py), yaw_of((x, y, z, w)))
            with self._lock:
                self._dragged = target

        self._gizmo = gizmo

    def _delete_model(self, name: str) -> None:
        if self._actions is not None:
            self._actions.delete(name)
            self._select(None)

    def show_speed(self) -> None:
        """Show the real-time factor that the simulation has now; called a few times a second."""
        if self._speed is not None:
            self._speed.show()

    def apply_drag(self) -> None:
        """Move the selected model to where it was dragged last; called at most twenty times a second."""
        with self._lock:
            target, self._dragged = self._dragged, None
        name, actions = self.selected, self._actions
        if target is not None and name is not None and actions is not None:
            self.attempt(lambda: actions.move(name, *target))

    # ---- camera ------------------------------------------------------------------------------------------------

    def set_robots(self, names: List[str]) -> None:
        """Offer these robots for the camera."""
        options = tuple(["the first"] + [name[:40] for name in names])
        if len(names) > 1 and tuple(self._robot.options) != options:
            self._robot.options, self._robot.visible = options, True

    def _robot_place(self) -> Optional[FloatArray]:
        """Return where the chosen robot is (3,) [m], or None."""
        robots = self._picture.source.robots
        chosen = next((robot for name, robot in robots.items() if name[:40] == self._robot.value), None)
        chosen = chosen or next(iter(robots.values()), None)
        return None if chosen is None or chosen.pose is None else np.array(chosen.pose[:3, 3])

    def look(self, middle: FloatArray) -> None:
        """Look at a point (3,) [m]."""
        with self._client.atomic():
            self._client.camera.position, self._client.camera.look_at = middle + _START, middle

    def follow(self) -> None:
        """Move the camera as the robot has moved since the last call."""
        if self._camera.value == FREE:
            return
        pose = self._robot_place()
        before, self._followed = self._followed, pose
        if pose is None or before is None or np.allclose(pose, before, atol=1e-4):
            return
        camera = self._client.camera
        step = pose - before
        with self._client.atomic():
            camera.position, camera.look_at = camera.position + step, camera.look_at + step
