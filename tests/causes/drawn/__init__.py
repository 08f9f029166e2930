"""Plants drawn at random, with none to five faults, written from the description of causes and not from the program.

Telegrams, packets and CAN frames are put together as bytes here; what was put in is told beside the capture. A file
draws the plant, one plays it against a clock, one writes what was captured, and one for each family puts faults in.
"""
