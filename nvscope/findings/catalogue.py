"""Every finding there can be: code, name, severity, and what an engineer in front of the plant should know about it.

Codes are stable and never used again for something else: scripts, rules and baselines rely on them. The sentence with
the figures of one capture is made where the finding is made; here is what is true of all findings of a kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType


class Severity(IntEnum):
    """How bad a finding is; the worse one is the greater."""

    NOTE = 1
    WARNING = 2
    ERROR = 3

    @property
    def word(self) -> str:
        """The severity as written in reports: ``error``, ``warning``, ``note``."""
        return self.name.lower()

    @classmethod
    def of(cls, word: str) -> Severity:
        """Return the severity that a report's word stands for; ValueError if there is none."""
        try:
            return cls[word.upper()]
        except KeyError:
            raise ValueError(f"no severity is called {word!r}") from None


@dataclass(frozen=True, slots=True)
class FindingKind:
    """One kind of finding.

    ``causes`` are ordered from the most usual one, ``next_steps`` in the order in which to take them.
    """

    code: str
    name: str
    severity: Severity
    meaning: str
    causes: tuple[str, ...]
    next_steps: tuple[str, ...]


_ERROR, _WARNING, _NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE

_TELEGRAM = (
    FindingKind(
        "NV101", "short-telegram", _ERROR,
        "A datagram begins like a telegram but is shorter than the 20-byte header. Nobody can use it.",
        (
            "home-made sender code that builds the header incompletely, or sends before its buffer is filled",
            "a different protocol on the same port whose first four bytes happen to look the same",
        ),
        (
            "Look at the bytes with `nvscope packets -x` and find out which program runs at the sender's address.",
            "If it is a library for PCs, compare its header with that of a controller's telegram in this capture.",
        ),
    ),
    FindingKind(
        "NV102", "length-mismatch", _ERROR,
        "The Length field of the header is not the size of the UDP payload. The telegram counts as malformed: its "
        "values must not be expected to arrive, even though the datagram itself does.",
        (
            "home-made sender code that counts the data without the 20 header bytes",
            "a sender that transmits STRINGs at their actual length but keeps the Length of the declared one",
            "padding, or a second telegram, behind the first one in the same datagram",
        ),
        (
            "Compare Length and payload length: a difference of 20 is the header, one that varies is a STRING.",
            "Correct the sender; no setting of the readers helps.",
        ),
    ),
    FindingKind(
        "NV103", "unknown-service", _WARNING,
        "The ID field holds a number that is none of the documented services (0 to 6, 20 to 28, 100).",
        (
            "home-made sender code that writes ID big-endian, so that 5 becomes 83886080",
            "another protocol that uses the same identity, for example one of a safety library",
            "a header that is shifted by a byte or two",
        ),
        (
            "Look at the header with `nvscope packets -V -x`: do the fields behind ID make sense?",
            "If the other telegrams of this sender are good, ask its vendor what the service is.",
        ),
    ),
    FindingKind(
        "NV104", "reserved-flags", _NOTE,
        "Bits 3 to 7 of Flags are undocumented, and at least one of them is set. Everything else is judged as usual.",
        (
            "a sender that writes a 32-bit counter over the 16-bit Counter, Flags and Checksum",
            "memory that the sender does not clear before it builds a telegram",
            "a runtime newer than the public description",
        ),
        (
            "See whether Flags changes when Counter wraps (NV404 then says so): that is a 32-bit counter.",
            "If a controller sends it and the readers get their values, leave it as it is.",
        ),
    ),
    FindingKind(
        "NV105", "big-endian-header", _WARNING,
        "The Length field fits the payload only with its two bytes swapped, so perhaps the whole header is big-endian. "
        "The telegram stays malformed: no controller is known to send or to accept such a header.",
        (
            "a sender programmed for network byte order",
            "a header of another size whose bytes look so by chance: a public npm sender writes 18 bytes per header "
            "when its list is not packed",
        ),
        (
            "Look at Index and SubIndex: if they too make sense only when swapped, the sender is big-endian.",
            "Correct the sender: all fields are little-endian.",
        ),
    ),
    FindingKind(
        "NV106", "ascii-identity", _WARNING,
        "The identity begins with the character '0' (30 hex) where controllers send a binary zero (00). Here it is "
        "read all the same; a controller may ignore it.",
        ("home-made sender code that takes the printed '3S-0' of the protocol description literally",),
        ("Make the sender begin its telegrams with 00 2D 53 33.",),
    ),
    FindingKind(
        "NV107", "truncated-by-capture", _NOTE,
        "The recording kept only the first bytes of the telegram. Counters and findings are complete where the header "
        "was kept; values behind the cut cannot be shown.",
        ("a snap length (`-s`) in tcpdump, dumpcap, a switch or a probe", "a probe that cuts payloads on purpose"),
        ("Record again without a snap length (`-s 0`); telegrams seldom have more than 276 bytes of payload.",),
    ),
)  # fmt: skip

_COUNTER = (
    FindingKind(
        "NV201", "telegram-gap", _ERROR,
        "The sender's Counter skips values: it sent telegrams that this capture does not hold. Whether the readers "
        "got them depends on where they were lost: before the capture point, or only in the capture itself.",
        (
            "the capturing computer or the mirror port dropped frames",
            "the network dropped them: overload, storm control of broadcasts, wireless links, a bad cable or plug, "
            "a duplex mismatch",
            "the sender counts telegrams that it could not send",
            "home-made sender code with a counter of its own kind (see NV206 and NV207)",
        ),
        (
            "First rule out the capture: drops in the capture (NV901), gaps of all senders at the same moments, a "
            "mirror port slower than what it mirrors.",
            "Then read the error counters of the switch ports along the way (CRC, discards, storm control).",
            "Capture at the sender and at the reader at the same time: the hop between a good and a bad capture is it.",
        ),
    ),
    FindingKind(
        "NV202", "duplicate-telegram", _WARNING,
        "A telegram was seen that had been seen before: the same Counter with the same bytes, or one that is long "
        "past. Readers write the same values twice, which is harmless unless an old one comes late.",
        (
            "the mirror port shows frames twice: on their way in and out, or for both ports of a conversation",
            "a capture on several interfaces of the same computer",
            "a loop, or redundant paths (ring, PRP) whose duplicates are not removed",
            "a sender that repeats telegrams",
        ),
        (
            "If nearly all telegrams are doubled (NV905), correct the mirroring: one direction is enough.",
            "If only some are, and a few ms apart, look for a second path through the network.",
        ),
    ),
    FindingKind(
        "NV203", "overtaken-telegram", _WARNING,
        "A telegram came after one that was sent later. A reader that writes what comes shows the older values "
        "until the next telegram: values jump back for one interval.",
        (
            "two paths of different speed: link aggregation that spreads packets, rings, wireless repeats",
            "a network adapter with several receive queues, which hands packets over in a slightly wrong order",
            "captures of several computers merged although their clocks differ",
        ),
        (
            "Check whether the time stamps go back as well (NV902): then it is the capture, not the network.",
            "Otherwise find the second path: link aggregation should keep one sender's telegrams on one link.",
        ),
    ),
    FindingKind(
        "NV204", "sender-restart", _WARNING,
        "The sender's Counter began anew or jumped back: its program was started again, or it was a different sender.",
        (
            "power cycle, reset or download of the controller",
            "an exception or a watchdog that stopped the program, which was then started again",
            "a PC program that starts counting with each run, or with each connection",
            "two devices with the same IP address, or a spare controller that took over",
        ),
        (
            "Compare the time with the controller's log; if restarts repeat, look for watchdogs and the power supply.",
            "If the Counter jumps to and fro, compare the MAC addresses of these telegrams: two means two devices.",
        ),
    ),
    FindingKind(
        "NV205", "counter-unused", _NOTE,
        "All telegrams of this stream carry the same Counter, so nothing can be said about their loss from it.",
        ("a PC library or a gateway that does not count; controllers do not check it when they receive",),
        ("Judge loss by the intervals: NV501 shows where a telegram of a cyclic list was missing.",),
    ),
    FindingKind(
        "NV206", "counter-scope", _NOTE,
        "This sender counts all its telegrams, or all its sends, with one Counter, where a controller counts each "
        "SubIndex of each list. That is understood, and its loss is exact in sum; but a loss is booked on the "
        "stream of the next telegram seen, so single streams may show a little more or less, even less than none.",
        ("a PC library or a gateway; controllers do not check the Counter when they receive",),
        ("Nothing has to be done. Judge the loss of this sender over all its lists together.",),
    ),
    FindingKind(
        "NV207", "counter-erratic", _WARNING,
        "The Counter jumps far more than the missing time allows: telegrams arrive as often as ever while it claims "
        "that many were lost. This sender does not count telegrams, so its loss figures mean nothing.",
        (
            "a sender that writes its Counter byte-swapped, so that it jumps by 256 from some value on",
            "a Counter that is random, a time, or shared with telegrams that do not pass the capture point",
        ),
        (
            "Print the counters with `nvscope packets -T fields -e ip.src -e nv.index -e nv.counter`: how do they run?",
            "Judge the loss of this sender by its intervals (NV501), or have its counter corrected.",
        ),
    ),
)  # fmt: skip

_ACKNOWLEDGEMENT = (
    FindingKind(
        "NV301", "no-acknowledgement", _ERROR,
        "The sender asked for an acknowledgement, and none was seen before its next telegram or within the timeout. A "
        "controller then counts NOACKNOWLEDGEMENT. One reader's answer would have been enough: none of them answered.",
        (
            "no reader is running, or none reads this list from this port",
            "the capture point does not see the answers: they are unicast to the sender, so a switch shows them only "
            "where the sender's or the reader's port is mirrored",
            "a firewall on the way back: answers go to the port of the list, not to the port a telegram came from",
            "the sender sends more often than the reader's task runs, so the answer comes after the next telegram",
            "a partner that cannot acknowledge, as most PC libraries",
        ),
        (
            "Read nErrorCount and nAcknowledges on the sender: if they are fine, only the capture point is wrong.",
            "Check that a reader is in RUN, and has the list with the same identifier, port and acknowledgement.",
            "Lengthen the sending interval beyond the readers' task cycles, or mirror the sender's port.",
            "If no reader can acknowledge, switch acknowledgement off in the sender's list.",
        ),
    ),
    FindingKind(
        "NV302", "negative-acknowledgement", _ERROR,
        "A reader rejected a telegram: it answered with the flag for an invalid checksum. It did not take the values.",
        (
            "the definition of the list differs between sender and reader: a variable added, removed, moved, of "
            "another type or STRING length",
            "only one of the projects was built and downloaded after a change",
            "two senders with different definitions of one list (NV401, NV403)",
        ),
        (
            "Export the list on the sender's side (link to file), import it in the reader, build both, download both.",
            "Compare the checksum signatures of the senders in this report.",
        ),
    ),
    FindingKind(
        "NV303", "unexpected-acknowledgement", _NOTE,
        "An acknowledgement was seen to which no telegram belongs that asked for one within the timeout before it.",
        (
            "the telegram itself is missing in the capture, while its answer is there",
            "a reader so slow that it answers after the timeout",
            "a reader that acknowledges whether it is asked or not",
        ),
        (
            "Check that the capture holds both directions of the conversation, and for gaps of the sender (NV201).",
            "If answers are always late, compare the reader's task cycle with the timeout.",
        ),
    ),
    FindingKind(
        "NV304", "boot-up-unanswered", _ERROR,
        "A reader that had just started asked for the current values, and no writer of the list sent them in time. It "
        "works with its initial values until the next regular telegram, for a list sent on change perhaps for long.",
        (
            "the writer's list does not have the option to answer boot-up requests",
            "the writer is off, stopped, or starts later than the reader",
            "the request does not reach the writer: other port, router, VLAN, firewall",
        ),
        (
            "Switch on the answer to boot-up requests in the writing list (V2.3: properties of the list).",
            "If the writer starts after the reader, add a slow cyclic transmission to a list sent on change.",
        ),
    ),
    FindingKind(
        "NV305", "send-rejected", _ERROR,
        "A device answered a telegram with ICMP 'destination unreachable'. This happens to unicast only: nobody "
        "answers a broadcast like that, so lost broadcasts stay silent.",
        (
            "port unreachable: the host is there, but nothing listens on that port; its program is stopped, or "
            "configured for another port",
            "host or network unreachable: a router knows no way, or the device is off",
            "administratively prohibited: a firewall",
        ),
        (
            "Read the ICMP code in the frame: it says which of these it is, and its source says who noticed.",
            "Start the reader, or correct the address or port in the sender's list.",
        ),
    ),
)  # fmt: skip

_CONSISTENCY = (
    FindingKind(
        "NV401", "several-senders", _ERROR,
        "More than one node sends this list. Readers take whatever comes, so the values alternate between the senders.",
        (
            "one list identifier used for two lists",
            "a copied project, a spare controller, or a test program on a PC that still runs",
            "a list with both 'read' and 'write' switched on (V2.3)",
            "a redundant pair of controllers, where it may be intended",
        ),
        (
            "Find each sender by its address; give one of the lists another identifier, or stop one sender.",
            "If both shall send, let them use two lists and choose in the reader's program.",
        ),
    ),
    FindingKind(
        "NV402", "shape-changed", _ERROR,
        "Items or Length of a telegram differ from the telegram before it with the same list and SubIndex. At least "
        "one of the two does not fit the readers' definition; what they make of it is undefined.",
        (
            "two senders with different definitions of the list",
            "a download in between that changed the list",
            "a PC library that sends STRINGs at their actual length",
        ),
        (
            "See whether the shape changes with the sender (NV401), once (a download) or all the time (STRINGs).",
            "Give all sides the same definition; fill up STRINGs to their declared length + 1.",
        ),
    ),
    FindingKind(
        "NV403", "checksum-changed", _ERROR,
        "The Checksum of a telegram differs from the one known for this list and SubIndex. It is a signature of the "
        "definition, not of the values: readers that check it reject the telegram.",
        (
            "two senders with different definitions of the list",
            "the sender was downloaded with a changed definition during the capture",
            "home-made sender code that computes a checksum of the data",
        ),
        (
            "Find who differs, and since when: the frames say so.",
            "Export the definition from the writing project, import it everywhere, build and download all.",
        ),
    ),
    FindingKind(
        "NV404", "checksum-flag", _WARNING,
        "Checksum is not 0 although Flags says that there is none, or Flags changes just as Counter wraps: the "
        "last header bytes do not hold what their names say.",
        (
            "a sender that writes a 32-bit counter over bytes 16 to 19: its carry lands in Flags and Checksum",
            "header bytes that the sender does not clear",
        ),
        (
            "If Flags changed at the wrap of Counter, have the sender write a 16-bit counter: as it is, it will "
            "ask for acknowledgements and checksums by accident.",
            "Otherwise clear both bytes in the sender.",
        ),
    ),
    FindingKind(
        "NV405", "definition-mismatch", _ERROR,
        "The telegrams do not fit the definition file: the first variable that does not fit is named, with the shift. "
        "Or several files define the list, and do not agree: it is said which of them fit, since when, and where they "
        "differ.",
        (
            "the file is not the one of the running project: another version, or not exported after the last change",
            "types (structures, enumerations) that differ between the projects, or a STRING of another length",
            "packing switched on on one side only",
            "a download while the capture ran: one file fits the telegrams before it, another those behind it",
            "a safety protocol that uses an ordinary list identifier: its payload is not a list of variables",
        ),
        (
            "Export the definition again from the project that runs in the sender, types included.",
            "A shift by the size of one variable shows which one is missing or new.",
        ),
    ),
    FindingKind(
        "NV406", "unknown-list", _NOTE,
        "Definitions were given, and none of them is for this list. Its telegrams are counted, its values not shown.",
        (
            "a list of another project on the same network",
            "an identifier or port that differs from the definition",
        ),
        ("Add the file that defines it: `--gvl`, or definitions in nvscope.toml.",),
    ),
    FindingKind(
        "NV407", "silent-list", _WARNING,
        "A list is defined, but not one telegram of it was seen.",
        (
            "the sender is stopped, or the task to which its list belongs does not run",
            "a list sent on change or on an event, of which nothing changed",
            "identifier or port differ from the definition",
            "the capture point: other VLAN, behind a router, or unicast that is not mirrored",
        ),
        (
            "Look for a list under another identifier or port in this report.",
            "Check in the sender that the task of the list runs; change a variable by hand and look again.",
        ),
    ),
)  # fmt: skip

_TIMING = (
    FindingKind(
        "NV501", "late", _WARNING,
        "A telegram came much later than the interval promises (by default more than 2.5 times the nominal "
        "interval), and the Counter shows no loss in between: it was sent late, or held up.",
        (
            "where all of them are late: another interval in the sender than in the definition, or a slower task cycle",
            "the task that sends was late: overload, a task of higher priority, a download, file access",
            "a PC sender whose operating system let it wait",
            "a burst of other traffic, or a wireless link",
        ),
        (
            "Compare with the maximum cycle time and jitter of the task in the controller's task monitor.",
            "See whether other senders were late at the same moment: then it is the network, or the capture.",
        ),
    ),
    FindingKind(
        "NV502", "jitter", _WARNING,
        "The intervals scatter widely: the slowest percent is later than usual by more than half an interval "
        "(by default).",
        (
            "an interval that is no multiple of the task cycle: 50 ms in a task of 20 ms is sent after 40 or 60 ms",
            "task load, or a PC as the sender",
            "a capture with coarse time stamps, such as a USB adapter's or a virtual machine's",
        ),
        (
            "Choose the interval as a multiple of the task cycle.",
            "If all senders jitter alike, suspect the time stamps of the capture.",
        ),
    ),
    FindingKind(
        "NV503", "burst", _NOTE,
        "Telegrams of one stream followed each other far too quickly: below a tenth of the interval, or below the "
        "minimum gap. Receivers that take a limited number of telegrams per task cycle then lose some.",
        (
            "transmission on change without a minimum gap, on a value that changes in every cycle",
            "an event variable that stays TRUE",
            "a sender or switch that catches up after a pause",
        ),
        (
            "Set a minimum gap, or reset the event variable after one cycle.",
            "Check how many telegrams the receiver takes per cycle (one vendor states 20).",
        ),
    ),
    FindingKind(
        "NV504", "stopped", _ERROR,
        "The sender of a cyclic list fell silent while the capture went on (by default for more than 10 intervals). "
        "Readers keep the last values and do not notice by themselves.",
        (
            "the controller was stopped, or its program by an exception",
            "power, cable, or switch port lost",
            "a download or a debugger that holds the program at a breakpoint",
        ),
        (
            "See whether all lists of this node stopped together (controller, cable) or only this one (task).",
            "Put a counter into the list that the reader checks, so that the plant notices the next time.",
        ),
    ),
    FindingKind(
        "NV505", "torn-cycle", _WARNING,
        "The list takes several telegrams, and in some cycles not all of them were there. A reader then works with "
        "variables, or parts of an array or structure, of different cycles.",
        (
            "loss of single telegrams (NV201)",
            "more telegrams at once than the receiver or a switch takes (one vendor states 20 per task cycle)",
            "transmission on change, which sends only the part that changed",
        ),
        (
            "Where values must belong together, put them into one telegram: at most 256 bytes, in one list.",
            "Or send a sequence number in each part, and use the values only when all of them agree.",
        ),
    ),
)  # fmt: skip

_CAN = (
    FindingKind(
        "NV601", "cob-id-overlap", _ERROR,
        "Two lists use the same COB-ID: a list takes one COB-ID per 8 bytes (not packed: per variable), counted up "
        "from its identifier, and it grew into the next list. This follows from the definitions; a report adds how "
        "many frames of these COB-IDs were sent, by channel.",
        ("list identifiers chosen without room for the COB-IDs that are assigned automatically",),
        ("Choose identifiers at least as far apart as each list has telegrams; leave some room to grow.",),
    ),
    FindingKind(
        "NV602", "canopen-collision", _ERROR,
        "A COB-ID of the list belongs to the predefined connection set of CANopen: NMT, SYNC, EMCY, PDO, SDO, "
        "heartbeat or LSS. CANopen devices may take the telegrams for theirs, with any effect up to a stop. This "
        "follows from the definitions; a report adds whether such frames were sent, and which CANopen devices were "
        "there. On a bus without any, a list in the range of a PDO does no harm until one is added.",
        (
            "a list identifier within a range of CANopen on a bus with CANopen devices",
            "a list that grew into such a range",
        ),
        (
            "Choose an identifier that no device of this bus uses, and check the whole range of the list.",
            "A PDO of the node that is named may be switched off, or have another COB-ID: look at its configuration.",
        ),
    ),
    FindingKind(
        "NV603", "dlc-mismatch", _ERROR,
        "A frame has fewer or more data bytes than the list's definition puts into this COB-ID, or, where nothing is "
        "defined, than the frame before it.",
        (
            "the definition differs between the sides",
            "a different device sends with the same COB-ID",
            "a protocol whose frames have no fixed length, where nothing is defined for the COB-ID",
            "packing that differs from what is assumed here: the rule on CAN is an inference",
        ),
        ("Compare the bytes with the definition; look for a second sender of the COB-ID.",),
    ),
    FindingKind(
        "NV604", "incomplete-cycle", _WARNING,
        "Not all COB-IDs of the list came in a cycle, within half of its interval of each other: readers hold "
        "variables of different cycles. How many COB-IDs the list has follows from its definition; those that never "
        "came are named.",
        (
            "frames with a lower COB-ID kept the bus busy",
            "a full transmit queue in the sender, or frames that the capture missed",
            "transmission on change",
            "a definition with more variables than the sender has, where a COB-ID never came",
        ),
        (
            "Look at the bus load (NV605) and at error frames (NV606); send less often, or with a lower COB-ID.",
            "Where a COB-ID never came, compare the definition with that of the sender's project.",
        ),
    ),
    FindingKind(
        "NV605", "bus-load", _WARNING,
        "The bus was busy for more than 70 % of a second (bus_load_percent in the table [limits] of nvscope.toml): "
        "frames of low priority come late or not at all. The bits of each second, with the stuff bits that the frames "
        "have, are held against the bit rate: that of --bitrate, or of the table [buses] of nvscope.toml, or one "
        "found from frames that follow each other at once. Where none is known, nothing is said.",
        (
            "too many lists with too short intervals for the bit rate",
            "transmission on change of values that change in every cycle",
            "a node that repeats a frame nobody acknowledges",
        ),
        ("Lengthen the intervals of the busiest lists first; pack variables; raise the bit rate if the cable allows.",),
    ),
    FindingKind(
        "NV606", "error-frames", _WARNING,
        "Error frames were seen on the bus: nodes reject what others send, and frames are repeated. A controller "
        "whose transmit errors go on leaves the bus (bus-off), and neither sends nor receives until it is restarted: "
        "what is missing in the capture then may have been sent all the same.",
        (
            "missing or surplus terminating resistors (two of 120 ohms, one at each end)",
            "a node with another bit rate or sample point",
            "a cable that is too long, a bad plug, missing ground reference",
        ),
        (
            "Measure the resistance between CAN_H and CAN_L with the power off: about 60 ohms.",
            "Unplug the nodes one by one until the error frames stop.",
            "Bus-off of the recording computer itself: check its bit rate and its plug first. Frames that nobody "
            "acknowledges mean that no other node is awake.",
        ),
    ),
)  # fmt: skip

_PARAMETER = (
    FindingKind(
        "NV701", "sdo-timeout", _ERROR,
        "A Parameter Manager request was not answered within the timeout (500 ms unless the caller chose another).",
        (
            "the partner is off, stopped, or has no network variables support in its target settings",
            "a wrong partner address or port in the call",
            "a firewall, or a capture point that sees only one direction",
        ),
        (
            "Check whether the partner sends anything at all in this capture.",
            "Check the address given to the function block, and that both sides use the same port.",
        ),
    ),
    FindingKind(
        "NV702", "sdo-error-reply", _ERROR,
        "The partner answered a Parameter Manager request with an error; the service of the reply says which.",
        (
            "ODErrorReplyIdx: the partner has no such index",
            "ODErrorReplyLen or ODErrorReplyItems: size or number of elements differ from the partner's entry",
            "ODErrorReplyAccess: the entry cannot be read, or not be written",
            "ODErrorReplyCPUStopped: the partner's program does not run",
        ),
        ("Compare index, subindex, length and items of the request with the partner's parameter list.",),
    ),
    FindingKind(
        "NV703", "sdo-unexpected-reply", _WARNING,
        "A Parameter Manager reply was seen that belongs to no open request.",
        (
            "the request is missing in the capture",
            "a reply that came after the timeout: the caller has given up, and may have asked again",
            "two callers that use the same address",
        ),
        ("Look for late replies (NV704), and check that the capture holds both directions.",),
    ),
    FindingKind(
        "NV704", "sdo-slow", _NOTE,
        "Parameter Manager replies took a large part of the timeout.",
        (
            "a long task cycle in the partner: requests are answered once per cycle",
            "many requests at the same time",
        ),
        ("Compare with the partner's task cycle; lengthen the timeout, or ask less often.",),
    ),
)  # fmt: skip

_VISU = (
    FindingKind(
        "NV801", "visu-write", _NOTE,
        "A web visualization client wrote a variable. The protocol knows no user and no password for that: whoever "
        "reaches the web server can write.",
        ("an operator at a panel or browser", "a script or gateway", "somebody who should not be there"),
        (
            "Check that the address of the client is one that may write.",
            "Keep the web server in a network of its own, or behind a gateway that asks for a password.",
        ),
    ),
    FindingKind(
        "NV802", "visu-error", _ERROR,
        "The controller refused a web visualization request, or could not read a variable that was asked for.",
        (
            "addresses of an older download: they change with every build",
            "a variable that does not exist, or cannot be written",
            "too many variables in one request, or a malformed one",
        ),
        ("Load the controller's current variable list (its XML files) and reload the page.",),
    ),
    FindingKind(
        "NV803", "visu-password-in-clear", _WARNING,
        "The web visualization transmits its passwords in clear: they are ordinary variables that clients poll. "
        "Anybody who sees the traffic knows them, and so does this capture.",
        ("the way the V2.3 web visualization works; not a fault of the project",),
        (
            "Treat the capture as confidential; passwords are masked in what is shown here.",
            "Do not rely on these passwords; separate the network, and use none of them elsewhere.",
        ),
    ),
    FindingKind(
        "NV804", "visu-count-mismatch", _WARNING,
        "The number of values differs from what was declared or asked for. Values are assigned by position, so all "
        "behind the first missing one may belong to another variable.",
        (
            "a client that declares another number of entries than it sends",
            "a STRING with the separator '|' in it, which looks like one more field",
            "a reply that was cut off",
        ),
        ("Look at request and reply; ask for STRINGs one at a time.",),
    ),
    FindingKind(
        "NV805", "visu-slow", _NOTE,
        "The controller's web server took long to answer.",
        (
            "a new connection for each request",
            "large requests, or many clients",
            "a controller whose cycle leaves little time for communication",
        ),
        ("Ask for fewer variables, less often, from fewer clients; look at the controller's load.",),
    ),
)  # fmt: skip

_CAPTURE = (
    FindingKind(
        "NV901", "capture-drops", _WARNING,
        "The recording says that frames were dropped while capturing. Gaps and missing acknowledgements in this report "
        "may be gaps of the capture, not of the plant.",
        (
            "a computer or disk too slow for the traffic",
            "a mirror port that carries more than its own speed: drops in the switch are counted nowhere in the file",
        ),
        (
            "Record again with a capture filter (for instance `udp port 1202 or icmp`) and a larger buffer (`-B`).",
            "Mirror fewer ports, or use a faster one.",
        ),
    ),
    FindingKind(
        "NV902", "clock-step", _WARNING,
        "The time stamps go back. Intervals, timeouts and the order of events around that moment are not reliable.",
        (
            "the clock of the capturing computer was set (NTP, PTP, by hand) during the recording",
            "files merged from computers whose clocks differ",
            "several receive queues or interfaces, whose frames were written in a slightly wrong order",
        ),
        (
            "Steps of microseconds are queues and do no harm; larger ones are the clock.",
            "Synchronize the clock before recording; sort or merge files by time (`reordercap`, `mergecap`).",
        ),
    ),
    FindingKind(
        "NV903", "truncated-file", _WARNING,
        "The file ends in the middle of a record, or holds some that cannot be read. What could be read was.",
        (
            "a line of a text log that was edited, or torn by a full disk",
            "the recording program was killed, or the disk was full",
            "the file was copied while it was being written, or a transfer broke off",
        ),
        ("Copy the file again from where it was recorded; stop the recording first.",),
    ),
    FindingKind(
        "NV904", "unsupported-link-type", _WARNING,
        "Frames of a link layer were met that is not understood here. They are counted among the other frames.",
        (
            "a capture on a special interface: USB, WLAN in monitor mode, a vendor's bus or probe",
            "an encapsulated mirror, which wraps the frames",
        ),
        ("Record on an Ethernet interface, or convert the file to Ethernet frames (`editcap -T`, if they are).",),
    ),
    FindingKind(
        "NV905", "mirrored-twice", _WARNING,
        "Nearly every telegram (more than 80 %) is there twice. The mirror port shows each frame two times; figures "
        "for loss are right, counts of telegrams are double.",
        (
            "both directions, or both ports of a conversation, are mirrored: a frame is copied going in and going out",
            "a capture on 'any', on a bridge and its members, or on a VLAN and its parent interface",
        ),
        (
            "Mirror one direction only (receive), or capture on one interface.",
            "Or remove the copies from this file: `editcap -d` or `editcap -w 0.001`.",
        ),
    ),
)  # fmt: skip

CATALOGUE: Mapping[str, FindingKind] = MappingProxyType(
    {
        kind.code: kind
        for kinds in (
            _TELEGRAM, _COUNTER, _ACKNOWLEDGEMENT, _CONSISTENCY, _TIMING, _CAN, _PARAMETER, _VISU, _CAPTURE,
        )
        for kind in kinds
    }
)  # fmt: skip
