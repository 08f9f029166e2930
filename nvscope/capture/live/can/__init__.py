"""CAN buses as sources, by the drivers of python-can."""
