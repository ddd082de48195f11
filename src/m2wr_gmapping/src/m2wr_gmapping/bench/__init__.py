"""How accurate and how fast the mapping is on recorded logs: the command ``benchmark``."""
