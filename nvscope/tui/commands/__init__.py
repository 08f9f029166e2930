"""What keys and the command line ask for that is of no view: a file for each group of actions."""
