"""What causes are told from, as columns, one file for each kind of column, each with a stated limit.

What follows from events listens to them (``nvscope.engine.events.EventListener``): ``evidence``, ``reader_answers``.
What no event tells, since it takes frames of any kind, observes these (``nvscope.engine.run.Observer``): ``presence``,
``pauses``, ``throughput``. Who does not ask for causes pays for none of it.
"""
