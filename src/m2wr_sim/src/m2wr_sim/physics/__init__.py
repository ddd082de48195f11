"""The ODE world: bodies, joints, contacts."""
