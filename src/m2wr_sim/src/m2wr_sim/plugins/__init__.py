"""Gazebo plugins, one file each."""
