"""What is wrong with it: the catalogue of findings, and their judges."""
