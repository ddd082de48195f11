# SPDX-License-Identifier: BSD-3-Clause
"""What pages may ask of a simulation."""
from __future__ import annotations

import abc
from typing import List, NamedTuple, Optional, Tuple

#: Kinds of obstacles that pages place: name in the page -> kind, size with a height of 1 m [m].
PLACEABLE = {"box": ("box", (0.5, 0.5, 0.5)), "cylinder": ("cylinder", (0.25, 0.5)), "sphere": ("sphere", (0.25,)),
             "wall": ("box", (2.0, 0.1, 0.5))}


class ModelPose(NamedTuple):
    """Where a model is: ``position`` (3,) [m] and ``quaternion`` x y z w, in the world."""

    position: Tuple[float, float, float]
    quaternion: Tuple[float, float, float, float]


class Actions(abc.ABC):
    """A simulation that can be controlled. Each method raises ViewError with a sentence for the user if it fails."""

    @abc.abstractmethod
    def pause(self) -> None:
        """Pause the simulation."""

    @abc.abstractmethod
    def resume(self) -> None:
        """Continue the simulation."""

    @abc.abstractmethod
    def step(self) -> None:
        """Make one step in a paused simulation."""

    @abc.abstractmethod
    def reset(self) -> None:
        """Put all models back to where they began."""

    @abc.abstractmethod
    def set_factor(self, factor: float) -> None:
        """Set the real-time factor; 0: as fast as possible."""

    @abc.abstractmethod
    def factor(self) -> Optional[float]:
        """Return the real-time factor that is set; 0: as fast as possible; None: not known."""

    @abc.abstractmethod
    def place(self, kind: str, position: Tuple[float, float, float], yaw: float, scale: float) -> str:
        """Add an obstacle and return its name.

        Parameters
        ----------
        kind : str
            A key of ``PLACEABLE``.
        position : (float, float, float)
            Of the middle of its underside [m].
        yaw : float
            [rad]
        scale : float
            Of its size.

        Returns
        -------
        str
        """

    @abc.abstractmethod
    def models(self) -> List[str]:
        """Return the names of the models that pages may place."""

    @abc.abstractmethod
    def place_model(self, model: str, position: Tuple[float, float, float], yaw: float) -> str:
        """Add a model and return its name in the world.

        Parameters
        ----------
        model : str
            One of ``models()``.
        position : (float, float, float)
            Of its frame [m].
        yaw : float
            [rad]

        Returns
        -------
        str
        """

    @abc.abstractmethod
    def model_pose(self, name: str) -> ModelPose:
        """Return where a model is."""

    @abc.abstractmethod
    def move(self, name: str, x: float, y: float, z: float, yaw: float) -> None:
        """Place a model upright, at rest.

        Parameters
        ----------
        name : str
        x, y, z : float
            [m]
        yaw : float
            [rad]
        """

    @abc.abstractmethod
    def delete(self, name: str) -> None:
        """Delete a model that is no robot."""

    @abc.abstractmethod
    def goal(self, x: float, y: float, frame: str) -> None:
        """Send a goal.

        Parameters
        ----------
        x, y : float
            [m]
        frame : str
            In which they are.
        """

    @abc.abstractmethod
    def worlds(self) -> List[str]:
        """Return the names of the worlds that pages may load."""

    @abc.abstractmethod
    def load_world(self, name: str) -> None:
        """Replace all models but robots by those of a world, and put the robots back to where they began."""

    @abc.abstractmethod
    def record(self) -> None:
        """Begin to record all topics."""

    @abc.abstractmethod
    def stop_recording(self) -> None:
        """End the recording."""

    @abc.abstractmethod
    def recording(self) -> Optional[float]:
        """Return for how long it has been recording [s of wall time], or None if it is not."""

    @abc.abstractmethod
    def bag(self) -> bytes:
        """Return the newest recording, a bag."""

    @abc.abstractmethod
    def film(self) -> bytes:
        """Return a film of the newest recording, a GIF."""

    @abc.abstractmethod
    def paused(self) -> Optional[bool]:
        """Return whether the simulation is paused; None if that is not known."""
