# SPDX-License-Identifier: BSD-3-Clause
"""Robots with transmissions, and a robot in a rig whose controllers are called as over ROS."""
from controller_manager_msgs.srv import LoadControllerRequest, SwitchControllerRequest
from geometry_msgs.msg import Twist

from m2wr_sim.model.urdf.loader import load_urdf

VELOCITY, EFFORT, POSITION = ("hardware_interface/%sJointInterface" % word
                              for word in ("Velocity", "Effort", "Position"))
LINK = """<link name="{0}"><inertial><mass value="{1}"/><inertia ixx="{2}" iyy="{2}" izz="{2}" ixy="0" ixz="0" iyz="0"/>
</inertial>{3}</link>"""
WHEEL = '<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/>
<axis xyz="0 1 0"/>{5}</joint>
<transmission name="{0}_t"><type>transmission_interface/SimpleTransmission</type><joint name="{0}">
<hardwareInterface>{6}</hardwareInterface></joint><actuator name="{0}_m"/></transmission>"""
PLUGIN = '<gazebo><plugin name="control" filename="libgazebo_ros_control.so">{}</plugin></gazebo>'
PLACES = {"front_left": "0.2 0.25 -0.05", "rear_left": "-0.2 0.25 -0.05",
          "front_right": "0.2 -0.25 -0.05", "rear_right": "-0.2 -0.25 -0.05"}
DRIVE = {"type": "diff_drive_controller/DiffDriveController", "left_wheel": ["front_left", "rear_left"],
         "right_wheel": ["front_right", "rear_right"], "pose_covariance_diagonal": [0.001] * 6,
         "twist_covariance_diagonal": [1] * 6}
STATES = {"type": "joint_state_controller/JointStateController", "publish_rate": 50}


def cart(tags="", interface=VELOCITY):
    """A box on four wheels."""
    text = LINK.format("base", 10, 0.3, '<collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision>')
    for name, place in PLACES.items():
        text += LINK.format(name + "_link", 0.5, 0.003, WHEEL)
        text += JOINT.format(name, "continuous", "base", name + "_link", place, "", interface)
    return "<robot name='cart'>%s%s</robot>" % (text, PLUGIN.format(tags))


def arm(interface, limit='<limit lower="-2" upper="2" effort="50" velocity="3"/>', kind="revolute"):
    """A lever of 0.5 m that hangs from the world, 1 kg at its end."""
    text = "<link name='world'/>" + LINK.format("mount", 5, 0.1, "") + LINK.format("lever", 1, 0.05, "").replace(
        "<mass", '<origin xyz="0.5 0 0"/><mass')
    text += "<joint name='fix' type='fixed'><parent link='world'/><child link='mount'/><origin xyz='0 0 2'/></joint>"
    text += JOINT.format("elbow", kind, "mount", "lever", "0 0 0", limit, interface)
    return "<robot name='arm'>%s%s</robot>" % (text, PLUGIN.format(""))


class Robot:
    """A robot in a rig, with its parameters set as a launch file does."""

    def __init__(self, rig, text, parameters, z=0.15):
        self.ports, self.simulator = rig.simulator.ports, rig.simulator
        self.ports.parameters["/robot_description"] = text
        for name, value in parameters.items():
            self.ports.parameters["/" + name] = value
        model = load_urdf(text, "test")
        self.simulator.spawn(model, ((0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)), namespace="/")

    def call(self, service, request):
        return self.ports.services["/controller_manager/" + service].callback(request)

    def load(self, name):
        return self.call("load_controller", LoadControllerRequest(name)).ok

    def switch(self, start=(), stop=(), strictness=SwitchControllerRequest.STRICT):
        request = SwitchControllerRequest(list(start), list(stop), strictness, False, 0.0)
        return self.call("switch_controller", request).ok

    def begin(self, *names):
        assert all([self.load(name) for name in names])
        assert self.switch(names)

    def states(self):
        return {entry.name: entry.state for entry in self.call("list_controllers", None).controller}

    def run(self, seconds):
        until = self.simulator.now_ns + int(seconds * 1e9)
        while self.simulator.now_ns < until:
            self.simulator.advance(until)

    def send(self, topic, message):
        self.ports.send(topic, message)

    def position(self):
        return next(iter(model for model in self.simulator.models.values() if model.plugins)).pose(
            self.simulator.engine)[0]

    def angle(self, joint):
        model = next(iter(model for model in self.simulator.models.values() if joint in model.handle.joints))
        return self.simulator.engine.joint_angle(model.handle.joints[joint])


def twist(linear, angular):
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    return message
