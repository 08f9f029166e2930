"""Form columns: what the forms of HTTP messages say of them, by the place of each form."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.web_protocols import protocol_of_request
from nvscope.engine.runs import distinct
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.messages import Outcome


def spoken_of(http: HttpMessages) -> I64:
    """Return which other protocol forms of messages are of, -1 of those that are of none."""
    numbers = np.full(len(http.forms), -1)
    for number in distinct(http.form).tolist():
        form = http.forms[number]
        found = form.spoken
        if form.what is What.WHOLE and form.head is not None:
            found = protocol_of_request(form.head.method, form.head.target)
        if found is not None:
            numbers[number] = int(found)
    return numbers


def statuses_of(http: HttpMessages) -> I64:
    """Return the statuses of the forms of messages, 0 of what has none."""
    return np.array([0 if form.head is None else form.head.status for form in http.forms], np.int64)


def outcome_of_cut(form: Form) -> Outcome:
    """Return what is said of a message that is cut."""
    return Outcome.UNREAD if form.is_beyond else Outcome.MALFORMED if form.is_malformed else Outcome.NONE


def unread_of(http: HttpMessages) -> I64:
    """Tell of the forms of messages which of them are whole and cannot be read."""
    return np.array([one.is_unread for one in http.forms], np.int64)
