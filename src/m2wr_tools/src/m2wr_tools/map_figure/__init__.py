"""Pictures of maps: the command ``plot_map``."""
