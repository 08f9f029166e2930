"""The only room that sends on a network: on an explicit command, and on loopback unless told otherwise."""
