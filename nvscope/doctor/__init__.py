"""Why do I see nothing: what of this machine, and of the traffic, keeps network variables from whoever looks for them.

Facts are read once (``machine``, ``traffic``); each check judges them by itself (``checks``). Nothing is ever sent.
"""
