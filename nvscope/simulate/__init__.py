"""What sends: the simulator."""
