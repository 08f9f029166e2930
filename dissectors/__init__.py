"""Wire formats of CODESYS network variables, as tables that numpy and Scapy read.

The ground floor: numpy only, nothing of ``nvscope`` is imported here, and it is usable alone.
"""
