"""The panes of the view of packets: the list, the fields of a frame, its bytes."""
