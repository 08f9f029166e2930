"""What happened in a plant, as lines: the verdict, a row a list with its strip of time, the causes, the buses."""
