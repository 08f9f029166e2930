"""JSON Schemas of all documents that the program writes, in files of their names."""
