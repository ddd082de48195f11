"""Which class stands for which plugin library: one line each."""
import importlib

PLUGINS = {
    "libgazebo_ros_diff_drive.so": "m2wr_sim.plugins.diff_drive:DiffDrive",
    "libgazebo_ros_laser.so": "m2wr_sim.plugins.laser:Laser",
    "libgazebo_ros_gpu_laser.so": "m2wr_sim.plugins.laser:Laser",
    "libgazebo_ros_joint_state_publisher.so": "m2wr_sim.plugins.joint_state:JointStatePublisher",
}


def find_plugin(filename):
    """Return the plugin class for a library's file name (``lib`` and ``.so`` may be missing), or None."""
    name = filename.strip().rsplit("/", 1)[-1]
    if not name.endswith(".so"):
        name += ".so"
    if not name.startswith("lib"):
        name = "lib" + name
    target = PLUGINS.get(name)
    if target is None:
        return None
    module, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module), attribute)
