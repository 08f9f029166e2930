"""Headers of the link, network and transport layers: a table each, and the numbers that they tell the next one by."""

from __future__ import annotations

import numpy as np

from dissectors.layout import Bit, Field, Layout

ETHERNET = Layout(
    "eth",
    (
        Field("group", "u1", "First byte of the destination", "bit 0 set: broadcast or multicast", base="hex"),
        Field("destination_rest", "V5", "Rest of the destination", "the other five bytes"),
        Field("source", "V6", "Source", "hardware address of the sender"),
        Field("type", ">u2", "EtherType", "protocol inside", base="hex"),
    ),
    "Ethernet",
)
VLAN = Layout(
    "vlan",
    (
        Field("tci", ">u2", "Tag control", "priority and VLAN number", base="hex"),
        Field("type", ">u2", "EtherType", "protocol inside", base="hex"),
    ),
    "VLAN tag",
)
SLL = Layout(
    "sll",
    (
        Field("packet_type", ">u2", "Packet type", "1 broadcast, 2 multicast, 4 sent"),
        Field("address", "V12", "Address", "hardware type, length and address of the sender"),
        Field("type", ">u2", "Protocol", "protocol inside", base="hex"),
    ),
    "Linux cooked capture",
)
SLL2 = Layout(
    "sll2",
    (
        Field("type", ">u2", "Protocol", "protocol inside", base="hex"),
        Field("interface", "V8", "Interface", "reserved, interface index, hardware type"),
        Field("packet_type", "u1", "Packet type", "1 broadcast, 2 multicast, 4 sent"),
        Field("address", "V9", "Address", "length and hardware address of the sender"),
    ),
    "Linux cooked capture v2",
)
UPPER_PDU_TAG = Layout(
    "exported_pdu",
    (
        Field("tag", ">u2", "Tag", "0 the end, 12 the dissector's name"),
        Field("length", ">u2", "Length", "bytes of the tag's value that follow"),
    ),
    "Exported PDU",
)
PDU_TAG_END, PDU_TAG_DISSECTOR = 0, 12
"""Tags in front of a PDU that Wireshark exported (``wsutil/exported_pdu_tlvs.h``): the last one, the dissector."""

PACKET_OUTGOING = 4
"""The packet type of SLL and SLL2 where the capturing host sent it (``PACKET_OUTGOING`` of ``linux/if_packet.h``)."""

SLL2_INTERFACE = Layout(
    "sll2.interface",
    (
        Field("reserved", ">u2", "Reserved", "zero"),
        Field("index", ">u4", "Index", "number of the interface on the capturing host"),
        Field("hardware", ">u2", "Hardware type", "ARPHRD number of the interface"),
    ),
)
"""What is in the field ``interface`` of SLL2."""
NULL = Layout(
    "null",
    (Field("family", "<u4", "Family", "address family in the byte order of the capturing host"),),
    "Loopback",
)
IPV4 = Layout(
    "ip",
    (
        Field("version_ihl", "u1", "Version, header length", "header length in words of 4 bytes", base="hex"),
        Field("tos", "u1", "Type of service", "priority", base="hex"),
        Field("total_length", ">u2", "Total length", "header and data in bytes; 0 where hardware fills it in"),
        Field("id", ">u2", "Identification", "number shared by the fragments of a datagram", base="hex"),
        Field("fragment", ">u2", "Fragment", "flags and offset", base="hex"),
        Field("ttl", "u1", "Time to live", "remaining hops"),
        Field("protocol", "u1", "Protocol", "protocol inside"),
        Field("checksum", ">u2", "Header checksum", "of the IP header", base="hex"),
        Field("source", ">u4", "Source", "address of the sender"),
        Field("destination", ">u4", "Destination", "address of the receiver"),
    ),
    "IPv4",
)
IPV6 = Layout(
    "ipv6",
    (
        Field("version", "u1", "Version", "upper four bits: 6", base="hex"),
        Field("flow", "V3", "Flow label", "traffic class and flow label"),
        Field("payload_length", ">u2", "Payload length", "bytes after this header"),
        Field("next", "u1", "Next header", "protocol or extension inside"),
        Field("hop_limit", "u1", "Hop limit", "remaining hops"),
        Field("source_hi", ">u8", "Source", "upper half", base="hex"),
        Field("source_lo", ">u8", "Source", "lower half", base="hex"),
        Field("destination_hi", ">u8", "Destination", "upper half", base="hex"),
        Field("destination_lo", ">u8", "Destination", "lower half", base="hex"),
    ),
    "IPv6",
)
ARP = Layout(
    "arp",
    (
        Field("hardware_type", ">u2", "Hardware type", "1 Ethernet"),
        Field("protocol", ">u2", "Protocol", "EtherType of the addresses that are asked for", base="hex"),
        Field("hardware_bytes", "u1", "Hardware address length", "in bytes"),
        Field("protocol_bytes", "u1", "Protocol address length", "in bytes"),
        Field("operation", ">u2", "Operation", "1 request, 2 reply"),
        Field("sender_hardware", "V6", "Sender hardware address", "of who says this"),
        Field("sender", ">u4", "Sender address", "IPv4 address of who says this; 0 where it has none yet"),
        Field("target_hardware", "V6", "Target hardware address", "of who is asked, or answered"),
        Field("target", ">u4", "Target address", "IPv4 address that is asked for, or answered"),
    ),
    "ARP",
)
"""RFC 826, for IPv4 over Ethernet."""
UDP = Layout(
    "udp",
    (
        Field("source_port", ">u2", "Source port", "port of the sender"),
        Field("destination_port", ">u2", "Destination port", "port of the receiver"),
        Field("length", ">u2", "Length", "UDP header and payload in bytes"),
        Field("checksum", ">u2", "Checksum", "of the datagram; 0 none", base="hex"),
    ),
    "UDP",
)
TCP = Layout(
    "tcp",
    (
        Field("source_port", ">u2", "Source port", "port of the sender"),
        Field("destination_port", ">u2", "Destination port", "port of the receiver"),
        Field("sequence", ">u4", "Sequence number", "of the first byte of data; of SYN the one before"),
        Field("acknowledgement", ">u4", "Acknowledgement number", "of the next byte that the sender waits for"),
        Field("offset", "u1", "Data offset", "upper four bits: header length in words of 4 bytes", base="hex"),
        Field(
            "flags", "u1", "Flags", "control bits", base="hex",
            bits=(
                Bit(0, "fin", "no more data"), Bit(1, "syn", "begins a connection"), Bit(2, "rst", "breaks it off"),
                Bit(3, "psh", "push"), Bit(4, "ack", "the acknowledgement number holds"), Bit(5, "urg", "urgent"),
            ),
        ),
        Field("window", ">u2", "Window", "bytes that the sender takes"),
        Field("checksum", ">u2", "Checksum", "of the segment", base="hex"),
        Field("urgent", ">u2", "Urgent pointer", "end of urgent data"),
    ),
    "TCP",
)  # fmt: skip
"""RFC 9293, section 3.1, without options."""
FIN, SYN, RST, ACK = (1 << bit for bit in (0, 1, 2, 4))
"""Masks of its control bits."""
EXTENSION = Layout(
    "ipv6.extension",
    (
        Field("next", "u1", "Next header", "protocol or extension inside"),
        Field("length", "u1", "Length", "in units of 8 bytes less one (authentication: of 4 bytes less two)"),
        Field("fragment", ">u2", "Fragment", "offset and more-fragments bit of a fragment header", base="hex"),
    ),
)

TYPE_IPV4, TYPE_IPV6, TYPE_ARP = 0x0800, 0x86DD, 0x0806
TYPE_CAN, TYPE_CAN_FD, TYPE_CAN_XL = 0x000C, 0x000D, 0x000E
"""Protocols of cooked frames (SLL, SLL2) that hold a SocketCAN frame: LINUX_SLL_P_CAN, _CANFD and _CANXL of libpcap."""

TYPE_SERVICE_TAG = 0x88A8
VLAN_TYPES = (0x8100, TYPE_SERVICE_TAG, 0x9100)
FAMILIES_IPV6 = (24, 28, 30)  # NetBSD and OpenBSD, FreeBSD, Darwin
PROTOCOL_ICMP, PROTOCOL_TCP, PROTOCOL_UDP, PROTOCOL_ICMPV6 = 1, 6, 17, 58
HOP_BY_HOP, ROUTING, FRAGMENT, AUTHENTICATION, DESTINATION_OPTIONS = 0, 43, 44, 51, 60
UNREACHABLE_ICMP, UNREACHABLE_ICMPV6 = 3, 1
ICMP_HEADER_BYTES = 8
IPV4_HIGH, IPV4_LOW = np.uint64(0xFFFF_FFFF_FFFF_FFFF), np.uint64(0xFFFF_FFFF_0000_0000)
"""The halves of an address that holds an IPv4 one in its last 32 bits: a multicast range that IPv6 does not assign.

Not ::ffff:a.b.c.d, so that an IPv6 packet with such an address stays apart from the IPv4 node.
"""
