# SPDX-License-Identifier: BSD-3-Clause
"""Running launch files of other packages on the master of the check, one after another."""
import os

import rosgraph
import rospy

from sim_probe import Running, Simulation, data_path, wait_until

QUIET = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}


def foreign_environment(**more):
    """Return the variables with which roslaunch finds the packages in data/foreign; no display."""
    path = data_path("foreign") + ":" + os.environ["ROS_PACKAGE_PATH"]
    return dict(QUIET, ROS_PACKAGE_PATH=path, **more)


def names_of_nodes():
    """Return the names of all nodes that publish, subscribe or serve something."""
    found = set()
    for part in rosgraph.Master(rospy.get_name()).getSystemState():
        for _, nodes in part:
            found.update(nodes)
    return found


class Launched(Running):
    """roslaunch with some arguments; ends it at exit and waits until its simulation has left the master."""

    def __init__(self, words, environment=None, simulation="/gazebo"):
        self._simulation = simulation
        wait_until(lambda: simulation not in names_of_nodes(), "the end of an earlier %s" % simulation)
        super().__init__(["roslaunch"] + words, dict(QUIET, **(environment or {})))

    def __enter__(self):
        super().__enter__()
        return self

    def wait_for_models(self, *names):
        """Wait until these models are in the world, in addition to the ground; returns all names in order."""
        simulation = Simulation()

        def there():
            if self.process.poll() is not None:
                raise AssertionError("%s ended; its output:\n%s" % (self.arguments, self.text))
            try:
                models = simulation.models()
            except rospy.ROSException as error:         # the program's output should give the reason
                raise AssertionError("%s: %s; its output:\n%s" % (self.arguments, error, self.text)) from error
            return models if set(names) <= set(models) else None

        return wait_until(there, "models %s from %s" % (", ".join(names), self.arguments))

    def __exit__(self, *arguments):
        if self.process.poll() is None:
            self.process.send_signal(2)
            try:
                self.wait()
            finally:
                super().__exit__(*arguments)
        else:
            super().__exit__(*arguments)
        wait_until(lambda: self._simulation not in names_of_nodes(), "the end of %s" % self._simulation)
