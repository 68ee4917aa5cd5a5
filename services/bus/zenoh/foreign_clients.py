"""Answers for programs that know only Zenoh: the last states, and the commands and events of the last seconds.

A `session.get` of all states (`keys.of_class`) brings them as they were published: encoding, attachment, Zenoh's
timestamp. Parameters of the selector, joined by `;` as Zenoh has it: `format=json`, and `age=SECONDS`, how far back
commands and events go.
"""

import asyncio
from collections import deque
from math import isnan

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message, decode, encode, encode_json, encoding_of
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.order import KEPT, Written
from engage_hri.services.bus.zenoh.peers import finish, pack
from engage_hri.services.bus.zenoh.session import LoopBridge

BATCH = 32
"""Number of replies in one go: a question for everything must not hold up the loop."""

Kept = tuple[Written, zenoh.Timestamp]


class ForeignClients:
    """The messages that this process has published, kept with Zenoh's timestamps and given out on request."""

    def __init__(self, session: zenoh.Session, bridge: LoopBridge) -> None:
        self._loop = asyncio.get_running_loop()
        self._states: dict[str, Kept] = {}
        self._recent: deque[Kept] = deque(maxlen=KEPT)
        self._open = True
        self._declared = tuple(
            session.declare_queryable(keys.of_class(kind), bridge.on_loop(self._asked))
            for kind in ("state", "evt", "cmd")
        )

    def note(self, written: Written, stamp: zenoh.Timestamp) -> None:
        """Keep a message that has just been published."""
        if keys.key_class(written.key) == "state":
            self._states[written.key] = (written, stamp)
        else:
            self._recent.append((written, stamp))

    def close(self) -> None:
        self._open = False
        for declared in self._declared:
            declared.undeclare()  # type: ignore[no-untyped-call]

    def _asked(self, query: zenoh.Query) -> None:
        try:
            form, oldest = form_asked(query, ""), self._loop.time() - _age(query.parameters)
        except InputRefused as error:
            refuse(query, error.fault, "json")
            finish(query)
            return
        wanted = [
            one
            for one in (*self._states.values(), *self._recent)
            if query.key_expr.intersects(one[0].key)
            and (one[0].envelope.sent >= oldest or one[0].key in self._states)
        ]
        wanted.sort(key=_number)
        self._answer(query, deque(wanted), form)

    def _answer(self, query: zenoh.Query, waiting: deque[Kept], form: str) -> None:
        for _ in range(min(BATCH, len(waiting)) if self._open else 0):
            written, stamp = waiting.popleft()
            payload, encoding = written.payload, written.encoding
            if form and not encoding.startswith(f"application/{form}"):
                payload, encoding = in_form(decode(payload, encoding), form)
            attachment = pack(written.envelope)
            query.reply(written.key, payload, encoding=encoding, attachment=attachment, timestamp=stamp)
        if waiting and self._open:
            self._loop.call_soon(self._answer, query, waiting, form)
        else:
            finish(query)


def form_asked(query: zenoh.Query, otherwise: str = "msgpack") -> str:
    """Form of the answer: the selector's, or else that of the question. Raises InputRefused.

    otherwise: for a question that is not in JSON.
    """
    form = query.parameters.get("format")
    if form is None:
        return "json" if str(query.encoding).startswith("application/json") else otherwise
    if form not in ("json", "msgpack"):
        raise InputRefused(Fault(reason=f"format {form!r}", where="selector", advice="json or msgpack"))
    return form


def in_form(message: Message, form: str) -> tuple[bytes, str]:
    """Encode the message in this form; returns payload and encoding."""
    return (encode_json if form == "json" else encode)(message), encoding_of(message, form)


def refuse(query: zenoh.Query, fault: Fault, form: str) -> None:
    """Answer the query with an error."""
    payload, encoding = in_form(fault, form)
    query.reply_err(payload, encoding=encoding)


def _age(parameters: zenoh.Parameters) -> Seconds:
    text = parameters.get("age")
    try:
        age = keys.HISTORY_MAX_AGE if text is None else float(text)
    except ValueError:
        age = float("nan")
    if isnan(age) or age < 0:
        raise InputRefused(Fault(reason=f"age {text!r}", where="selector", advice="seconds: age=10"))
    return age


def _number(kept: Kept) -> int:
    return kept[0].envelope.number
