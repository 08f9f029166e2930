"""Causes: what happened, from the events behind the findings; a file is a family of causes with its judge."""
