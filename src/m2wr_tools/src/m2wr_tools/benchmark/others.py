# SPDX-License-Identifier: BSD-3-Clause
"""The reference case in other simulators: the same obstacles, robot, command and scans, with their fastest calls.

``mujoco`` and ``pybullet`` are not dependencies of this package; install them from PyPI to compare.  The scene comes
from the records that this simulator loads, so that all have the same obstacles.  MuJoCo is measured twice: with its
default settings, and with an implicit integrator and fewer iterations.  All cast the rays of a scan in one call and add
the same noise.  The motion of the robot is reported too, to show whether it follows the command.
"""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, Protocol, Tuple, Union

import numpy as np

from m2wr_sim.errors import SimError
from m2wr_sim.model.types import Box, Cylinder
from m2wr_tools.benchmark import in_process, reference

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray
    from m2wr_sim.geometry import Vector
    from m2wr_sim.model.types import World

_NOISE = 0.01               # m
_SENSOR = (0.27, 0.0, 0.02)     # in the chassis frame
_RANGE_MIN = 0.1
_SETTLING = 0.5             # s
_BOX_MASS, _WHEEL_MASS = 5.0, 0.2
_BOX_INERTIA, _WHEEL_INERTIA = (0.0395, 0.1062, 0.1417), (0.000527, 0.000527, 0.001)
_GAIN = 10.0                # N m s: holds a wheel's rate as a motor with a torque limit does


def _import(name: str) -> Any:
    try:
        return __import__(name)
    except ImportError:
        raise SimError("the comparison needs the Python module %s: pip install %s" % (name, name)) from None


def _shapes(world: World) -> Iterator[Tuple[Union[Box, Cylinder], Vector, float]]:
    """Yield ``(shape, position, yaw)`` of the obstacles of a world of upright boxes and cylinders."""
    for model in world.models:
        for link in model.links:
            for collision in link.collisions:
                if isinstance(collision.geometry, (Box, Cylinder)):
                    position, (_, _, z, w) = model.pose
                    yield collision.geometry, position, 2.0 * math.atan2(z, w)


class _Rays:
    """The rays of a laser, as unit vectors in the chassis frame, with noise on hits."""

    def __init__(self, beams: int, seed: int) -> None:
        angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, beams)
        self.directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(beams)], axis=1)
        self._rng = np.random.default_rng(seed)

    def finish(self, ranges: FloatArray, hit: BoolArray) -> FloatArray:
        """Return the scan [m]: noise on hits, infinity for other rays.

        Parameters
        ----------
        ranges : (beams,) float64
            Distances [m].
        hit : (beams,) bool
            Whether the ray hits something.
        """
        return np.where(hit, ranges + _NOISE * self._rng.standard_normal(len(ranges)), np.inf)


class OtherCase(Protocol):
    """The reference case in another simulator."""

    def run(self, steps: int) -> None:
        """Advance by some steps."""

    def scan(self, index: int) -> FloatArray:
        """Return one robot's ranges (beams,) [m]."""

    def pose(self) -> Tuple[float, float, float]:
        """Return x, y [m] and heading [rad] of the first robot."""

    def close(self) -> None:
        """Free the simulation."""


class MujocoCase:
    """MuJoCo; ``tuned``: with settings for this case instead of its defaults."""

    def __init__(self, case: in_process.Case, tuned: bool) -> None:
        self._mujoco = _import("mujoco")
        self.model = self._mujoco.MjModel.from_xml_string(self._mjcf(case, tuned))
        self.data = self._mujoco.MjData(self.model)
        self._mujoco.mj_forward(self.model, self.data)          # calculates the poses before the first step
        rates = in_process.motor_rates()
        self.data.ctrl[:] = [rates["left"], rates["right"]] * case.robots
        self._bodies = [self.model.body("robot%d" % index).id for index in range(case.robots)]
        self._fans = [_Rays(case.beams, index) for index in range(case.robots)]
        self._distances = np.zeros(case.beams)
        self._ids = np.zeros(case.beams, dtype=np.int32)

    @staticmethod
    def _mjcf(case: in_process.Case, tuned: bool) -> str:
        option = '<option timestep="%r" gravity="0 0 -9.8"%s/>' % (
            case.step, ' integrator="implicitfast" iterations="10" ls_iterations="6"' if tuned else "")
        rows = ['<mujoco>%s<worldbody><geom type="plane" size="0 0 1" contype="1" conaffinity="1"/>' % option]
        for shape, (x, y, z), yaw in _shapes(case.world):
            if isinstance(shape, Box):
                kind, size = "box", "%r %r %r" % tuple(0.5 * value for value in shape.size)
            else:
                kind, size = "cylinder", "%r %r" % (shape.radius, 0.5 * shape.length)
            rows.append('<geom type="%s" size="%s" pos="%r %r %r" quat="%r 0 0 %r" contype="1" conaffinity="1"/>'
                        % (kind, size, x, y, z, math.cos(0.5 * yaw), math.sin(0.5 * yaw)))
        motors = []
        for index, (x, y, z) in enumerate(reference.robot_places(case.robots)):
            rows.append('<body name="robot%d" pos="%r %r %r"><freejoint/><inertial pos="0 0 0" mass="%r" '
                        'diaginertia="%r %r %r"/><geom type="box" size=".25 .15 .035"/>'
                        % ((index, x, y, z, _BOX_MASS) + _BOX_INERTIA))
            rows += ['<geom type="sphere" size=".05" pos="%g 0 -.05" condim="1" friction="0 0 0"%s/>'
                     % (place, ' priority="1"') for place in (0.2, -0.2)]
            for side, y_wheel in (("left", 0.5 * reference.TRACK), ("right", -0.5 * reference.TRACK)):
                joint = "%s%d" % (side, index)
                rows.append('<body pos="0 %r 0" euler="-90 0 0">'
                            '<inertial pos="0 0 0" mass="%r" diaginertia="%r %r %r"/>'
                            '<joint name="%s" type="hinge" axis="0 0 1"/><geom type="cylinder" size="%r .02"/></body>'
                            % ((y_wheel, _WHEEL_MASS) + _WHEEL_INERTIA + (joint, reference.WHEEL_RADIUS)))
                motors.append('<velocity joint="%s" kv="%r" forcerange="%r %r"/>'
                              % (joint, _GAIN, -in_process.FORCE, in_process.FORCE))
            rows.append("</body>")
        return "".join(rows) + "</worldbody><actuator>%s</actuator></mujoco>" % "".join(motors)

    def run(self, steps: int) -> None:
        """Advance."""
        self._mujoco.mj_step(self.model, self.data, nstep=steps)

    def scan(self, index: int) -> FloatArray:
        """Return one robot's ranges [m]."""
        body, fan = self._bodies[index], self._fans[index]
        turn = self.data.xmat[body].reshape(3, 3)
        origin = self.data.xpos[body] + turn @ np.array(_SENSOR)
        directions = fan.directions @ turn.T
        self._mujoco.mj_multiRay(self.model, self.data, origin, directions.ravel(), None, 1, body, self._ids,
                                 self._distances, len(directions), reference.RANGE_MAX)
        return fan.finish(self._distances, (self._ids >= 0) & (self._distances < reference.RANGE_MAX))

    def pose(self) -> Tuple[float, float, float]:
        """Return x, y [m] and heading [rad] of the first robot."""
        body = self._bodies[0]
        turn = self.data.xmat[body].reshape(3, 3)
        return float(self.data.xpos[body][0]), float(self.data.xpos[body][1]), math.atan2(turn[1, 0], turn[0, 0])

    def close(self) -> None:
        """Do nothing: there is nothing to free."""


class BulletCase:
    """PyBullet, without a window."""

    def __init__(self, case: in_process.Case) -> None:
        self._b = b = _import("pybullet")
        self._client = b.connect(b.DIRECT)
        b.setGravity(0, 0, -9.8)
        b.setTimeStep(case.step)
        b.createMultiBody(0, b.createCollisionShape(b.GEOM_PLANE))
        for shape, position, yaw in _shapes(case.world):
            geometry = (b.createCollisionShape(b.GEOM_BOX, halfExtents=[0.5 * value for value in shape.size])
                        if isinstance(shape, Box) else
                        b.createCollisionShape(b.GEOM_CYLINDER, radius=shape.radius, height=shape.length))
            b.createMultiBody(0, geometry, basePosition=position,
                              baseOrientation=b.getQuaternionFromEuler([0, 0, yaw]))
        self._robots = [self._robot(place) for place in reference.robot_places(case.robots)]
        self._fans = [_Rays(case.beams, index) for index in range(case.robots)]

    def _robot(self, place: Vector) -> int:
        b = self._b
        box = b.createCollisionShape(b.GEOM_BOX, halfExtents=[0.25, 0.15, 0.035])
        wheel = b.createCollisionShape(b.GEOM_CYLINDER, radius=reference.WHEEL_RADIUS, height=0.04)
        ball = b.createCollisionShape(b.GEOM_SPHERE, radius=0.05)
        flat, quarter = [0, 0, 0, 1], b.getQuaternionFromEuler([-0.5 * math.pi, 0, 0])
        half = 0.5 * reference.TRACK
        robot = b.createMultiBody(
            _BOX_MASS, box, basePosition=place, linkMasses=[_WHEEL_MASS] * 2 + [1e-3] * 2,
            linkCollisionShapeIndices=[wheel, wheel, ball, ball], linkVisualShapeIndices=[-1] * 4,
            linkPositions=[[0, half, 0], [0, -half, 0], [0.2, 0, -0.05], [-0.2, 0, -0.05]],
            linkOrientations=[quarter, quarter, flat, flat], linkInertialFramePositions=[[0, 0, 0]] * 4,
            linkInertialFrameOrientations=[flat] * 4, linkParentIndices=[0] * 4,
            linkJointTypes=[b.JOINT_REVOLUTE] * 2 + [b.JOINT_FIXED] * 2, linkJointAxis=[[0, 0, 1]] * 4)
        rates = in_process.motor_rates()
        for link, name in enumerate(("left", "right")):
            b.changeDynamics(robot, link, lateralFriction=1.0)
            b.setJointMotorControl2(robot, link, b.VELOCITY_CONTROL, targetVelocity=rates[name], force=in_process.FORCE)
        for link in (2, 3):
            b.changeDynamics(robot, link, lateralFriction=0.0)
        return robot

    def run(self, steps: int) -> None:
        """Advance."""
        step = self._b.stepSimulation
        for _ in range(steps):
            step()

    def scan(self, index: int) -> FloatArray:
        """Return one robot's ranges [m]."""
        b, fan = self._b, self._fans[index]
        position, orientation = b.getBasePositionAndOrientation(self._robots[index])
        turn = np.array(b.getMatrixFromQuaternion(orientation)).reshape(3, 3)
        origin, directions = np.array(position) + turn @ np.array(_SENSOR), fan.directions @ turn.T
        found = b.rayTestBatch(origin + _RANGE_MIN * directions, origin + reference.RANGE_MAX * directions,
                               numThreads=1)
        shares = np.array([row[2] for row in found])
        return fan.finish(_RANGE_MIN + shares * (reference.RANGE_MAX - _RANGE_MIN), shares < 1.0)

    def pose(self) -> Tuple[float, float, float]:
        """Return x, y [m] and heading [rad] of the first robot."""
        position, orientation = self._b.getBasePositionAndOrientation(self._robots[0])
        return position[0], position[1], self._b.getEulerFromQuaternion(orientation)[2]

    def close(self) -> None:
        """Free the world."""
        self._b.disconnect(self._client)


MAKERS: Dict[str, Callable[[in_process.Case], OtherCase]] = {
    "mujoco": lambda case: MujocoCase(case, False),
    "mujoco-tuned": lambda case: MujocoCase(case, True),
    "pybullet": BulletCase,
}


def measure(name: str, case: in_process.Case,
            progress: Callable[[float], object] = lambda share: None) -> Dict[str, Any]:
    """Run the reference case in another simulator.

    Parameters
    ----------
    name : str
        One of :data:`MAKERS`.
    case : m2wr_tools.benchmark.in_process.Case
    progress : callable
        Called with the completed share, 0 to 1.

    Returns
    -------
    dict
        ``factor``: simulated seconds per second of processor time; ``speed``, ``turn_rate``: motion of the first robot
        [m/s, rad/s], from its poses at the scans.

    Raises
    ------
    SimError
        If the simulator is not installed.
    """
    other = MAKERS[name](case)
    try:
        per_scan = max(1, int(round(1.0 / (reference.SCAN_RATE * case.step))))
        other.run(int(_SETTLING / case.step))
        poses, scans = [other.pose()], max(2, int(case.duration / (per_scan * case.step)))
        start = time.process_time()
        for count in range(scans):
            other.run(per_scan)
            for robot in range(case.robots):
                other.scan(robot)
            poses.append(other.pose())
            progress((count + 1) / scans)
        seconds = time.process_time() - start
        simulated, track = scans * per_scan * case.step, np.array(poses)
        turned = np.abs(np.diff(np.unwrap(track[:, 2]))).sum()
        path = np.hypot(*np.diff(track[:, :2], axis=0).T).sum()
        return {"factor": simulated / seconds, "speed": float(path / simulated),
                "turn_rate": float(turned / simulated)}
    finally:
        other.close()
