"""The part of it that imports ROS."""
