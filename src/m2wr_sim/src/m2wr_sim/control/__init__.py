"""Drive laws, on plain numbers."""
