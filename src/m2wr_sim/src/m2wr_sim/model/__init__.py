"""From robot and world descriptions (URDF, SDF) to plain records."""
