"""What Gazebo's ROS package offers, in front of m2wr_sim."""
