"""A second, slow implementation of the diagnosis rules, and random traffic to compare the two with.

It shares no code with the product: plain integers, one frame after the other, no numpy.

- ``frame``          what a frame is, and how its datagram is peeled out of it
- ``rules``          the rules, written for the reader, a file for each part of them
- ``reference``      ``reference_report``: what the rules make of a capture
- ``builders``       telegrams, packets and frames, one at a time
- ``traffic``        ``generate`` and ``mutate``: many of them, drawn from a seed, with what is in ``plant``
- ``tcp``            the TCP segment of a frame; ``tcp_line`` writes those of a connection down
- ``visu_traffic``   ``conversations``: random WebVisus, with ``visu_exchanges`` and ``capture_faults``
- ``pcap``           ``write_pcap``
- ``compare``        ``differences`` between a reference report and a report of the product
- ``can_reference``  the rules on CAN
"""
