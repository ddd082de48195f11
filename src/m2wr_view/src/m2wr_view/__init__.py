"""Pictures of robots and runs without a display."""
