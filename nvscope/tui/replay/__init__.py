"""A capture that is played on the screen: where its scenes come from, and the line that shows where it is."""
