"""What should be on the wire: lists and variables, from the files that a PLC project exports."""
