"""A second, slow implementation of the diagnosis rules, and random traffic to compare the two with.

It shares no code with the product: plain integers, one frame after the other, no numpy.

- ``frame``      what a frame is, and how its datagram is peeled out of it
- ``reference``  ``reference_report``: the rules, written for the reader
- ``traffic``    ``generate``, ``mutate``, ``write_pcap`` and the builders of single frames
- ``compare``    ``differences`` between a reference report and a report of the product
"""
