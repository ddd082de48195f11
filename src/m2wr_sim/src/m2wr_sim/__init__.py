"""Simulation of ROS 1 robots on ODE, with the ROS interface of Gazebo classic."""
