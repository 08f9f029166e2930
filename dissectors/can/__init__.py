"""CAN: frames, their bits on the wire, errors, and what their identifiers mean."""
