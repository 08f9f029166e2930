"""What faces show, as data: the documents that --json prints."""
