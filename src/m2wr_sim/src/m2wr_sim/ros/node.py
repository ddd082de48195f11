# SPDX-License-Identifier: BSD-3-Clause
"""The simulation node: reads parameters, loads the world, runs the loop until it is stopped."""
import gc
import logging
import os
import signal
import sys
import threading
from dataclasses import replace
from typing import Callable, List, Optional, Tuple

import rosgraph
import rospy
from visualization_msgs.msg import MarkerArray

from gazebo_msgs.msg import LinkStates, ModelStates
from m2wr_lockstep.errors import LockstepError
from m2wr_lockstep.server.ros.lockstep import Lockstep
from m2wr_node.internals.ros_time import make_own_clock
from m2wr_node.ros.is_there import alive
from m2wr_node.ros.starting import master_gone, register
from m2wr_sim.errors import ModelError, ParameterError, SimError, WorldError
from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.types import Physics, World
from m2wr_sim.physics.engine import settings_from_physics, whole_step
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.plugins.world_states import WorldStates
from m2wr_sim.ros.diagnostics import Diagnostics
from m2wr_sim.ros.gazebo_services.gazebo_api import GazeboApi
from m2wr_sim.ros.gazebo_services.performance import Performance
from m2wr_sim.ros.gazebo_services.spawning import Spawner
from m2wr_sim.ros.lockstep_ports import LockstepPorts, lockstep_settings
from m2wr_sim.ros.loop import Loop
from m2wr_sim.ros.params import NodeConfig, private_parameters, read_config
from m2wr_sim.ros.ports import RosPorts, RosSimulator
from m2wr_sim.ros.shared_files import find_world, model_folders, package_folder
from m2wr_sim.ros.visual_markers import VisualMarkers
from m2wr_sim.ros.world_markers import DescriptionTopic, GroundMarkers, LatchedPort, WorldMarkers, is_robot
from m2wr_sim.runtime.ports import LocalPort
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_sim.warm_up import warm_up

log = logging.getLogger("m2wr_sim")
_LOGGERS = ("m2wr_sim", "m2wr_lockstep", "m2wr_node")

_END_PATIENCE = 5.0             # s for the loop to end before ROS closes its topics
_TRUTH_RATE = 20.0              # Hz of simulated time
_SWITCH_INTERVAL = 0.0005       # s; with Python's default of 5 ms the loop would delay rospy's threads


def _log_through_rospy() -> None:
    """Send the log of the simulator's packages to the terminal and to /rosout."""
    rosout = logging.getLogger("rosout")
    for name in _LOGGERS:
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate, logger.parent = rosout.handlers, rosout.propagate, rosout.parent
        logger.setLevel(logging.INFO)


def _claim_time() -> None:
    """Make simulated time the default, as Gazebo does; this node sets its own clock."""
    if not rospy.has_param("/use_sim_time"):
        rospy.set_param("/use_sim_time", True)
    make_own_clock()


def _note_signals() -> List[str]:
    """Only record SIGINT and SIGTERM, as texts in the list returned; the loop checks it between two batches of steps.

    rospy's handler shuts down inside the signal handler. The interrupted thread may be publishing or registering, and
    would then wait forever for a lock that it holds. While the node registers, nothing checks the list, so another
    thread shuts down.
    """
    noted: List[str] = []

    def on_signal(number: int, _: object) -> None:
        noted.append("signal-%d" % number)
        if not rospy.core.is_initialized():
            threading.Thread(target=rospy.signal_shutdown, args=(noted[-1],), daemon=True).start()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    return noted


def _convention_set_for(model: str) -> Optional[str]:
    """Return the current value of the parameter ~wheel_conventions for a model, or None."""
    try:
        conventions = rospy.get_param("~wheel_conventions", {})
    except (rospy.ROSException, OSError) as error:      # no master: the value read at the start is used
        log.warning("parameter ~wheel_conventions cannot be read (%s); its previous value is used", error)
        return None
    return conventions.get(model) if isinstance(conventions, dict) else None


def _load_world(config: NodeConfig, worlds: str, folders: ModelFolders) -> Tuple[World, str]:
    """Return the record and name of the world, or of ``~fallback_world`` if the world cannot be read."""
    try:
        return load_world(find_world(config.world, worlds), resolve_model=folders), config.world
    except WorldError as error:
        if not config.fallback_world:
            raise
        log.error("%s; the world \"%s\" is used instead", error, config.fallback_world)
        return load_world(find_world(config.fallback_world, worlds), resolve_model=folders), config.fallback_world


def _step_of(config: NodeConfig, world: World, name: str) -> int:
    """Return the physics step [ns]: of the parameter, or of the world if it is valid, else the default."""
    if config.step:
        return whole_step(config.step, "parameter ~step")
    try:
        return whole_step(world.physics.max_step_size, "max_step_size of %s" % name)
    except WorldError as error:
        default = Physics().max_step_size
        log.error("%s; %g s is used", error, default)
        return whole_step(default, "the default")


def build(config: NodeConfig, folder: str) -> Tuple[RosSimulator, float, ModelFolders, str]:
    """Make the simulator of a :class:`~m2wr_sim.ros.params.NodeConfig`.

    Parameters
    ----------
    config : NodeConfig
    folder : str
        Folder of this package.

    Returns
    -------
    simulator : RosSimulator
    factor : float
        Requested real-time factor; 0: as fast as possible.
    folders : ModelFolders
    name : str
        The world that was loaded.

    Raises
    ------
    WorldError, ModelError
        If the world cannot be read or built.
    """
    folders = model_folders(folder)
    world, name = _load_world(config, os.path.join(folder, "worlds"), folders)
    step_ns = _step_of(config, world, name)
    engine = make_engine(config.engine, settings_from_physics(world.physics, step_ns, config.solver))
    engine.reseed(config.seed)
    ports = LockstepPorts(config.lockstep_tick) if config.lockstep else RosPorts()
    simulator = RosSimulator(engine, RayScene(), ports, SimConfig(
        seed=config.seed, clock_rate=config.pub_clock_frequency, wheel_convention=config.wheel_convention,
        wheel_conventions=config.wheel_conventions, command_timeout_ns=int(config.command_timeout * 1e9),
        joint_states=config.joint_states, joint_state_rate=config.joint_state_rate, loss_ends=config.loss_ends))
    simulator.paused = config.paused
    simulator.load_world(world)
    factor = config.real_time_factor
    if factor is None:
        factor = max(0.0, world.physics.real_time_update_rate * world.physics.max_step_size)
    simulator.physics = replace(simulator.physics, real_time_update_rate=factor * 1e9 / step_ns)
    return simulator, factor, folders, name


def run(config: NodeConfig, stopping: Callable[[], bool]) -> None:
    """Run the node until it is to stop.

    Parameters
    ----------
    config : NodeConfig
    stopping : callable
        Returns whether to stop.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL)
    simulator, factor, folders, name = build(config, package_folder())
    try:
        log.info("loading the compiled kernels (the first start after an installation compiles them, for some seconds)")
        warm_up(config.engine)
        lockstep = None
        if isinstance(simulator.ports, LockstepPorts):
            lockstep = Lockstep(lockstep_settings(config), simulator.ports.topics)
        loop, api = _network(config, simulator, factor, folders, stopping, lockstep)
        if lockstep is not None:
            lockstep.attach(loop, simulator)
        simulator.ports.answer_through(loop.call)
        simulator.engine.between = loop.end_if_asked
        log.info("world \"%s\" is ready%s: %d models, step %g ms, %s", name,
                 "" if name == config.world else " instead of \"%s\"" % config.world, len(simulator.models),
                 simulator.step_ns * 1e-6, "%g times real time" % factor if factor else "as fast as possible")
        gc.freeze()                             # thousands of permanent objects: later garbage collections skip them
        loop.run()
        if api is not None:
            api.close()
    finally:
        simulator.close()


def _network(config: NodeConfig, simulator: RosSimulator, factor: float, folders: ModelFolders,
             stopping: Callable[[], bool], lockstep: Optional[Lockstep]) -> Tuple[Loop, Optional[GazeboApi]]:
    """Return the loop, and the services and topics of the world or None if ``~enable_ros_network`` is false."""
    if not config.enable_ros_network:
        return Loop(simulator, factor, stopping, lambda: None, lockstep), None
    models = simulator.ports.advertise("~model_states", ModelStates, 10, "")
    links = simulator.ports.advertise("~link_states", LinkStates, 10, "")
    states = WorldStates(simulator, models, links, rate=config.pub_state_frequency)
    simulator.add_observer(states, "state topics")
    diagnostics, performance = Diagnostics(simulator, factor, lockstep), Performance(simulator)
    views = _view_topics(simulator, config)

    turned_ns = [-1]

    def on_turn() -> None:
        for part in (diagnostics, performance, *views):
            part.turn()
        if turned_ns[0] == simulator.now_ns:        # paused, or waiting: no further message comes soon
            states.rest()
            simulator.ports.flush()
        turned_ns[0] = simulator.now_ns

    loop = Loop(simulator, factor, stopping, on_turn, lockstep)

    def set_factor(new: float) -> None:
        loop.set_factor(new)
        diagnostics.set_factor(new)

    spawner = Spawner(simulator, folders, config.urdf_surface)
    spawner.convention_set_for = _convention_set_for
    return loop, GazeboApi(simulator, loop, spawner, config.gazebo_faults, set_factor)


def _view_topics(simulator: Simulator, config: NodeConfig
                 ) -> Tuple[WorldMarkers, GroundMarkers, VisualMarkers, DescriptionTopic]:
    """Add what viewers and recordings need: markers, true states of robots, description (docs/reference/topics.md)."""
    markers = WorldMarkers(simulator, LatchedPort(simulator.ports, "~world_markers", MarkerArray),
                           config.world_markers_frame, config.world_markers_rate)
    simulator.add_observer(markers, "world markers")
    ground = GroundMarkers(simulator, LatchedPort(simulator.ports, "~ground_markers", MarkerArray),
                           config.world_markers_frame)
    simulator.add_observer(ground, "ground markers")
    truth = simulator.ports.advertise("~robot_states", ModelStates, 10, "")
    simulator.add_observer(WorldStates(simulator, truth, LocalPort("", listening=False), _TRUTH_RATE, is_robot),
                           "true states of robots")
    looks = VisualMarkers(simulator, LatchedPort(simulator.ports, "~visual_markers", MarkerArray))
    simulator.add_observer(looks, "looks of models")
    return markers, ground, looks, DescriptionTopic(simulator)


def running_namesake(name: str) -> Optional[str]:
    """Return the address of a running node of this name, or None.

    ROS would silently stop that node when a new one registers.
    """
    try:
        address = rosgraph.Master("/m2wr_sim_start").lookupNode(name)
    except (rosgraph.MasterException, OSError):
        return None
    return address if alive(address, name) else None


def main() -> int:
    """Run the node; return the exit code."""
    mappings = rosgraph.names.load_mappings(sys.argv)
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(argv=sys.argv), mappings.get("__name", "gazebo"))
    address = running_namesake(name)
    if address is not None:
        sys.stderr.write("a simulation runs already: node %s at %s. Stop it first (rosnode kill %s), or start this one "
                         "with another name or master.\n" % (name, address, name))
        return 1
    signals = _note_signals()
    register("gazebo", lambda: bool(signals) or rospy.core.is_shutdown_requested(), disable_rostime=True)
    if signals or rospy.is_shutdown():
        return 1
    ended = threading.Event()

    def on_shutdown() -> None:
        signals.append("shutdown")
        ended.wait(_END_PATIENCE)

    rospy.on_shutdown(on_shutdown)              # called by rosnode kill
    _log_through_rospy()
    try:
        _claim_time()
        config, unknown = read_config(private_parameters())
        for name in unknown:
            log.warning("parameter ~%s is unknown and has no effect", name)
        log.info("parameters: %s", config)
        run(config, lambda: bool(signals) or rospy.is_shutdown())
    except (ParameterError, WorldError, ModelError, SimError, LockstepError) as error:
        rospy.logfatal("%s", error)
        return 1
    except Exception as error:
        gone = master_gone(error)
        if gone:
            rospy.logfatal("%s", gone)
        else:
            log.exception("internal error, the simulation stops: %s: %s", type(error).__name__, error)
        return 1
    finally:
        ended.set()
    return 0
