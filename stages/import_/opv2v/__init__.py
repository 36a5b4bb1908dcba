"""OPV2V: scenarios of several vehicles, simulated with CARLA."""
