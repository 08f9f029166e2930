"""What causes are told from: events as columns, one file for each kind of column, each with a stated limit.

What follows from events listens to them (``nvscope.engine.events.EventListener``). What is no event but holds for a
time, such as who is present, is an ``nvscope.tracker.accumulator.Accumulator``.
"""
