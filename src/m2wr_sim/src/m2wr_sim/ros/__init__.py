"""The edge to ROS: parameters, topics, services."""
