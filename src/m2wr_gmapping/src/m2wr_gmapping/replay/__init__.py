"""Mapping from a recorded bag, without a ROS master."""
