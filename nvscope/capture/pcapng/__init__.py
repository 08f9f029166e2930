"""pcapng files: their blocks and interfaces, a reader, a sink."""
