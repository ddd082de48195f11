"""Velocity commands from keys."""
