"""What a recording tells of a plant beside its packets: figures of lists each second, findings and causes as log."""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

from nvscope.analysis.news import News, is_over
from nvscope.analysis.watching import Scene
from nvscope.capture.mcap.sink import TopicSink
from nvscope.causes.cause import Cause
from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity
from nvscope.tracker.figures import LIST_COUNTERS
from nvscope.view.documents.verdicts import STATUSES
from nvscope.view.escape import json_ascii

FIGURES_TOPIC, LOG_TOPIC = "/nvscope/figures", "/nvscope/log"

Entry = tuple[str, bytes, int]
"""A topic, a message of it, and its time."""

_SECOND_NS = 1_000_000_000
_INFO = 2
_LEVELS = {Severity.NOTE: _INFO, Severity.WARNING: 3, Severity.ERROR: 4}
_WORDS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")


def declare(sink: TopicSink) -> None:
    """Have the topics of a diary in a file."""
    sink.topic(FIGURES_TOPIC, "nvscope.figures", json.dumps(_figures_schema()).encode())
    sink.topic(LOG_TOPIC, "foxglove.Log", json.dumps(_log_schema()).encode())


class Diary:
    """Tells from scene to scene what there is to write.

    As a plant is watched, causes and findings are written when they are told first. Where all that happens is ``known``
    already, as of a capture that was read before, they are told at the beginning (``known``), with the times at which
    they began and were over.
    """

    def __init__(self, known: Scene | None = None) -> None:
        self._news = News()
        self._known: set[Hashable] = set()
        self._is_known = known is not None
        self.known: Sequence[Entry] = () if known is None else list(self._of(known, as_seen=False))

    def entries(self, scene: Scene) -> Iterator[Entry]:
        """Yield what is new, and the figures of the moment."""
        at_ns = scene.at_ns
        if at_ns is None:
            return
        if not self._is_known:
            yield from self._of(scene, as_seen=True)
        yield FIGURES_TOPIC, _text(_figures(scene, scene.list_keys)), at_ns

    def _of(self, scene: Scene, *, as_seen: bool) -> Iterator[Entry]:
        """Yield what is new of causes and findings, as of now or of the times at which it was so."""
        at_ns, happened, keys = scene.at_ns, scene.snapshot.happened, scene.list_keys
        if at_ns is None or happened is None:
            return

        def time(time_ns: int | None) -> int:
            return at_ns if time_ns is None or as_seen else min(time_ns, at_ns)

        told = self._news.of(happened.causes)
        for cause in told.new:
            yield LOG_TOPIC, _of_cause(cause, at_ns), time(cause.since_ns)
        begun = {id(cause) for cause in told.new} if as_seen else ()
        for cause, heir in zip(told.ended, told.instead, strict=True):
            if id(cause) not in begun:
                yield LOG_TOPIC, _of_end(cause, heir, at_ns), time(cause.until_ns)
        for finding in scene.snapshot.findings:
            if finding.place not in self._known:
                self._known.add(finding.place)
                yield LOG_TOPIC, _of_finding(finding, keys, at_ns), time(finding.first_ns)


def _figures(scene: Scene, keys: Mapping[int, str]) -> Mapping[str, Any]:
    document, number = scene.document, {key: number for number, key in keys.items()}
    capture = document["capture"]
    return {
        "frames": capture["frames"],
        "telegrams": capture["telegrams"],
        "drops": capture["drops"],
        "lists": [
            {
                "key": entry["key"],
                "name": entry["name"] or "",
                "status": entry["status"],
                "telegrams": entry["diag"]["nSendCount"],
                "per_s": scene.pace.per_second(number[entry["key"]], 1),
                "jitter": entry["jitter"],
                **entry["counters"],
            }
            for entry in document["lists"]
        ],
    }


def _figures_schema() -> Mapping[str, Any]:
    counters = {
        one.name: {"type": "integer", "description": f"{one.help}; null: unknown"} for one in LIST_COUNTERS
    }  # fmt: skip
    entry = {
        "key": {"type": "string"},
        "name": {"type": "string"},
        "status": {
            "type": "string",
            "description": f"{', '.join(map(str, STATUSES))}: that of the worst finding on it",
        },
        "telegrams": {"type": "integer", "description": "data telegrams so far"},
        "per_s": {"type": "number", "description": "in the last whole second; null: unknown"},
        "jitter": {"type": "number", "description": "percent of the nominal interval, so far; null: unknown"},
        **counters,
    }
    return {
        "title": "nvscope.figures",
        "type": "object",
        "properties": {
            "frames": {"type": "integer", "description": "so far"},
            "telegrams": {"type": "integer", "description": "so far"},
            "drops": {"type": "integer", "description": "lost while capturing, so far; null: unknown"},
            "lists": {"type": "array", "items": {"type": "object", "properties": entry}},
        },
    }


def _log_schema() -> Mapping[str, Any]:
    time = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
    return {
        "title": "foxglove.Log",
        "type": "object",
        "properties": {
            "timestamp": {**time, "description": "when it began, as far as that is known"},
            "level": {
                "type": "integer",
                "oneOf": [{"title": word, "const": number} for number, word in enumerate(_WORDS)],
            },
            "message": {"type": "string"},
            "name": {"type": "string", "description": "kind of the cause, or code of the finding"},
            "file": {"type": "string", "description": "the list, or where else it is"},
            "line": {"type": "integer", "description": "its first frame, 0 where that is not known"},
        },
    }


def _entry(since_ns: int, level: int, message: str, name: str, where: str, frame: int) -> bytes:
    seconds, nanoseconds = divmod(max(since_ns, 0), _SECOND_NS)
    return _text(
        {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": level,
            "message": message,
            "name": name,
            "file": where,
            "line": frame,
        }
    )


def _of_cause(cause: Cause, at_ns: int) -> bytes:
    facts = "".join(f"; {fact}" for fact in cause.checked)
    told = f"{cause.title}{facts}. Next: {cause.next}"
    since_ns = at_ns if cause.since_ns is None else cause.since_ns
    return _entry(since_ns, _LEVELS[cause.severity], told, cause.kind.name, _where(cause), _first(cause.frames))


def _of_end(cause: Cause, heir: Cause | None, at_ns: int) -> bytes:
    what = "over" if is_over(cause, heir) else "no longer told" if heir is None else f"now told as: {heir.title}"
    since_ns = at_ns if cause.until_ns is None else cause.until_ns
    return _entry(since_ns, _INFO, f"{cause.title}: {what}", cause.kind.name, _where(cause), 0)


def _of_finding(finding: Finding, keys: Mapping[int, str], at_ns: int) -> bytes:
    since_ns = at_ns if finding.first_ns is None else finding.first_ns
    told = f"{finding.code} {finding.kind.name}: {finding.message}"
    numbers = finding.lists or ([] if finding.list_number is None else [finding.list_number])
    where = ", ".join(keys[number] for number in numbers if number in keys)
    where = where or (str(finding.key) if finding.key is not None else finding.channel or "")
    return _entry(since_ns, _LEVELS[finding.kind.severity], told, finding.code, where, _first(finding.frames))


def _where(cause: Cause) -> str:
    return ", ".join(map(str, cause.lists)) or cause.channel or ""


def _first(frames: tuple[int, ...]) -> int:
    return frames[0] if frames else 0


def _text(document: Mapping[str, Any]) -> bytes:
    return json_ascii(json.dumps(document, ensure_ascii=False)).encode()
