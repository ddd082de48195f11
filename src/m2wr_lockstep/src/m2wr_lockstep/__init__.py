"""Controllers in lockstep with a simulation."""
