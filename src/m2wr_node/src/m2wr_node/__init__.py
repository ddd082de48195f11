"""What every node of this workspace needs to start, to end, and to read its parameters; imports none of the others."""
