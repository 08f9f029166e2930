"""Expressions over the fields of telegrams: display filter, and later trigger, column and rule; Wireshark's syntax."""
