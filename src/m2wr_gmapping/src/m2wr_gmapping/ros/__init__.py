"""The edges to ROS: the live node and the map saver."""
