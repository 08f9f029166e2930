"""What is on CAN buses besides the data they carry: load, errors, nodes."""
