"""A live recording of requests that never become whole, over real TCP: its topics, and what a rule says of it."""

from __future__ import annotations

import json
import signal
from pathlib import Path

from tests.capture.live.network import cable, needs_namespaces
from tests.capture.live.test_ring import wait_for_ring
from tests.program import run_text
from tests.record.test_transaction_topics import messages_in

SPARE_S = 60
TALK = r"""
import socket, struct, time
BODY = b"|1|1|0|4|0|4|6|9.5|"
HEAD = b"POST /plc/webvisu.htm HTTP/1.1\r\n%b\r\n"
SIZED, OPEN = HEAD % b"Content-Length: 19\r\n", HEAD % b""
CHUNKED = HEAD % b"Transfer-Encoding: chunked\r\n" + b"13\r\n" + BODY + b"\r\n"
REFUSED = b"HTTP/1.1 413 x\r\nContent-Length: 2\r\n\r\nno"
DONE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|"
listener = socket.create_server(("127.0.0.1", 8080))

def say(one, other, data):
    one.sendall(data)
    while data:
        data = data[len(other.recv(len(data))):]

def end(one, other, is_reset):
    if is_reset:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        one.close()
    else:
        one.shutdown(socket.SHUT_WR)
    try:
        other.recv(1)
    except ConnectionError:
        pass

kept = []
for asked, answered, ends in (
    (SIZED + BODY, DONE, "cs"), (SIZED, b"", "C"), (SIZED + BODY[:9], b"", "C"), (SIZED, REFUSED, "sc"),
    (SIZED + BODY[:9], REFUSED, "sc"), (SIZED + BODY[:9], b"", "S"), (OPEN + BODY, b"", "C"), (OPEN + BODY, DONE, ""),
    (SIZED + BODY[:9], b"", ""), (OPEN + BODY, b"", ""), (CHUNKED, b"", ""),
):
    client = socket.create_connection(("127.0.0.1", 8080))
    server, _ = listener.accept()
    say(client, server, asked)
    say(server, client, answered)
    for who in ends:
        end(*((client, server) if who in "cC" else (server, client)), who.isupper())
    kept.append((client, server))
print("done", flush=True)
time.sleep(600)
"""
"""Small letters close one side in order, capital ones reset; the last three requests are open when it is done."""

TOLD = [
    ("write", "open", None), ("write", "confirmed", None), ("unknown", "status", "HTTP status 413"),
    ("write", "refused", "HTTP status 413"), ("write", "unanswered", None), ("write", "open", None),
    ("write", "unanswered", None), ("write", "open", None), ("write", "confirmed", None),
]  # fmt: skip


@needs_namespaces
def test_what_never_becomes_whole_is_recorded_as_what_it_is(tmp_path: Path) -> None:
    path, rules = tmp_path / "x.mcap", tmp_path / "rules.toml"
    with cable() as (host, _):
        recorder = host.nvscope("record", "-i", "lo", "-w", str(path))
        wait_for_ring(host)
        talk = host.python_program(TALK)
        try:
            assert talk.stdout is not None
            assert talk.stdout.readline() == "done\n"
        finally:
            recorder.send_signal(signal.SIGINT)
            _, told = recorder.communicate(timeout=SPARE_S)
            talk.kill()
            talk.communicate(timeout=SPARE_S)
    assert recorder.returncode == 0, told
    (topic,) = messages_in(path).items()
    assert topic[0] == "/visu/127.0.0.1/8080"
    assert [(one["operation"], one["outcome"], one.get("detail")) for _, one in topic[1]] == TOLD
    again = tmp_path / "y.mcap"
    assert run_text("record", path, "-w", again).returncode == 0
    assert messages_in(again) == messages_in(path)
    for limit, verdict in ((3, "fail"), (4, "pass")):
        rules.write_text(f'[[rule]]\nid = "r"\ncheck = "transaction"\nmax_errors = {limit}\n')
        (rule,) = json.loads(run_text("check", path, "--rules", rules, "--json").stdout)["rules"]
        (one,) = rule["subjects"]
        assert (rule["verdict"], one["reason"]) == (verdict, "2 refused, 2 unanswered of 6 requests")
