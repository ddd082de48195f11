"""Grid mapping with a Rao-Blackwellised particle filter; ROS-free except for the room ``ros``."""
