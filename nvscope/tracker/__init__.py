"""What is on the wire, as a state that is independent of how the input was cut."""
