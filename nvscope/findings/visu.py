"""NV8xx: the web visualization's requests and replies. Nothing judges them yet."""

from __future__ import annotations

from nvscope.findings.kind import FindingKind, Severity

VISU_WRITE = FindingKind(
    "NV801",
    "visu-write",
    Severity.NOTE,
    meaning=(
        "A web visualization client wrote a variable. The protocol knows no user and no password for that: whoever "
        "reaches the web server can write."
    ),
    causes=("an operator at a panel or browser", "a script or gateway", "somebody who should not be there"),
    next_steps=(
        "Check that the address of the client is one that may write.",
        "Keep the web server in a network of its own, or behind a gateway that asks for a password.",
    ),
    judged=False,
)
VISU_ERROR = FindingKind(
    "NV802",
    "visu-error",
    Severity.ERROR,
    meaning="The controller refused a web visualization request, or could not read a variable that was asked for.",
    causes=(
        "addresses of an older download: they change with every build",
        "a variable that does not exist, or cannot be written",
        "too many variables in one request, or a malformed one",
    ),
    next_steps=("Load the controller's current variable list (its XML files) and reload the page.",),
    judged=False,
)
VISU_PASSWORD_IN_CLEAR = FindingKind(
    "NV803",
    "visu-password-in-clear",
    Severity.WARNING,
    meaning=(
        "The web visualization transmits its passwords in clear: they are ordinary variables that clients poll. "
        "Anybody who sees the traffic knows them, and so does this capture."
    ),
    causes=("the way the V2.3 web visualization works; not a fault of the project",),
    next_steps=(
        "Treat the capture as confidential; passwords are masked in what is shown here.",
        "Do not rely on these passwords; separate the network, and use none of them elsewhere.",
    ),
    judged=False,
)
VISU_COUNT_MISMATCH = FindingKind(
    "NV804",
    "visu-count-mismatch",
    Severity.WARNING,
    meaning=(
        "The number of values differs from what was declared or asked for. Values are assigned by position, so all "
        "behind the first missing one may belong to another variable."
    ),
    causes=(
        "a client that declares another number of entries than it sends",
        "a STRING with the separator '|' in it, which looks like one more field",
        "a reply that was cut off",
    ),
    next_steps=("Look at request and reply; ask for STRINGs one at a time.",),
    judged=False,
)
VISU_SLOW = FindingKind(
    "NV805",
    "visu-slow",
    Severity.NOTE,
    meaning="The controller's web server took long to answer.",
    causes=(
        "a new connection for each request",
        "large requests, or many clients",
        "a controller whose cycle leaves little time for communication",
    ),
    next_steps=("Ask for fewer variables, less often, from fewer clients; look at the controller's load.",),
    judged=False,
)
