"""Frames, telegrams and values as rows of columns, for whoever shows or writes them one by one."""
