"""DataLogger: the variables of its databases, row by row."""
