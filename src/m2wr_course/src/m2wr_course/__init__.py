"""Checks of the exercises of the course in docs/."""
