"""The edge to ROS: nodes and commands."""
