"""What sensors measure, on plain arrays."""
