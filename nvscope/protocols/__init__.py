"""The protocols: one file each says what it has on every floor."""
