"""History: what was published before, asked for on the messages' own keys by our processes and by any program.

A `session.get` of all states (`keys.of_class`) brings them as they were published: encoding, attachment, Zenoh's
timestamp. Parameters of the selector, joined by `;` as Zenoh has it: `format=json`; `age=SECONDS`, how far back
commands and events go; `run=RUN`, to ask only that process.

Our own processes ask `@bus/<run>/past`, each process by itself, once for all their patterns. They get what is
missing of a key in one reply, under that key, and at the end one with the `Counts` of all these keys, when the last
key was dropped, and how many messages it handed out: so they know that all has come, and that there is nothing else.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from math import isnan
from typing import Any

import msgspec
import zenoh
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.access import MEDIUM, most
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.messages import decode, in_form
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.order import Counts, Envelope, Missing, Past, SentLog, Written, fitting
from engage_hri.services.bus.zenoh.session import QOS

BATCH = 32
"""Number of replies in one go: a question for everything must not hold up the loop."""
PATTERNS = 64
"""Number of patterns in a question for the past. Each key that there is gets compared with each."""
CATCH_UP: Seconds = 1.0
"""Time that a process has to hand out its past."""

BAD = (msgspec.DecodeError, UnicodeDecodeError)
"""Exceptions of decoding bytes from other programs."""
pack = msgspec.msgpack.encode
envelopes = msgspec.msgpack.Decoder(Envelope)
_parts = msgspec.msgpack.Decoder(list[Written])
_ends = msgspec.msgpack.Decoder(tuple[Counts, int, int])


class _Question(Struct, frozen=True, array_like=True):
    """Question of our own processes: what is missing on the keys of these patterns."""

    patterns: tuple[str, ...]
    missing: Missing


_questions = msgspec.msgpack.Decoder(_Question)


class History:
    """Answers questions for what this process has published, and asks other processes the same."""

    def __init__(self, session: zenoh.Session, bridge: LoopBridge, sent: SentLog) -> None:
        self._loop = asyncio.get_running_loop()
        self._session = session
        self._bridge = bridge
        self._sent = sent
        self._open = True
        self._begun: set[keys.Flow] = set()
        self._declared: list[Any] = []

    def begin(self, flow: keys.Flow) -> None:
        """Show that this process has a past of this flow from now on, and be asked for it: observers hardly do."""
        if flow in self._begun:
            return
        if not self._begun:
            self._serve(keys.own(self._sent.run, "past"), self._missing_asked)
        for kind in keys.FLOWS[flow]:
            self._serve(keys.of_class(kind), partial(self._asked, kind))
        self._begun.add(flow)
        self._declared.append(self._session.liveliness().declare_token(keys.own(self._sent.run, f"log/{flow}")))

    def _serve(self, key: str, asked: Callable[[zenoh.Query], None]) -> None:
        self._declared.append(self._session.declare_queryable(key, self._bridge.questions(asked)))

    def close(self) -> None:
        self._open = False
        for declared in reversed(self._declared):
            declared.undeclare()

    # -- asking -------------------------------------------------------------------------------------------------

    def ask(
        self,
        patterns: Sequence[str],
        run: str,
        missing: Missing,
        told: Callable[[Past], None],
        ended: Callable[[Past | None], None],
    ) -> None:
        """Ask a process for what is missing on these keys.

        Calls `told` with its answer, if that is complete, and then `ended`, with one of which parts are missing. Both
        on the loop.
        """
        parts: list[Written] = []
        incomplete: Past | None = None

        def replied(reply: zenoh.Reply) -> None:
            nonlocal incomplete
            # Zenoh says who answers: no process can answer for another.
            if reply.ok is None or reply.replier_id is None or str(reply.replier_id.zid) != run:
                return
            with suppress(*BAD):  # counts as no answer
                if (key := str(reply.ok.key_expr)) == keys.own(run, "counts"):
                    counts, dropped, number = _ends.decode(reply.ok.payload.to_bytes())
                    past = Past(counts, tuple(parts), dropped)
                    if len(parts) == number:
                        told(past)
                    else:  # a part was lost, or came under another key
                        incomplete = past
                else:
                    part = _parts.decode(reply.ok.payload.to_bytes())
                    parts.extend(one for one in part if one.key == key)

        question = pack(_Question(tuple(patterns), missing))
        if len(question) > MEDIUM:  # all that is kept comes then, and what was there before is known by its count
            question = pack(_Question(tuple(patterns), msgspec.structs.replace(missing, seen={})))
        self._session.get(
            keys.own(run, "past"),
            self._bridge.on_loop(replied, lambda _: ended(incomplete)),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            allowed_destination=zenoh.Locality.REMOTE,
            payload=question,
            timeout=CATCH_UP,
            **QOS,
        )

    # -- answering ----------------------------------------------------------------------------------------------

    def _missing_asked(self, query: zenoh.Query) -> None:
        try:
            payload = query.payload.to_bytes() if query.payload else b""
            asked = _questions.decode(payload)
            if len(asked.patterns) > PATTERNS:
                raise InputRefused(Fault(reason=f"{len(asked.patterns)} patterns; at most {PATTERNS} are answered"))
            expressions = [zenoh.KeyExpr(pattern) for pattern in asked.patterns]
        except (zenoh.ZError, EngageError, *BAD) as error:
            refuse(query, error.fault if isinstance(error, EngageError) else Fault(reason=str(error)), "json")
            finish(query)
            return
        oldest = self._loop.time() - keys.HISTORY_MAX_AGE - asked.missing.age
        past = self._sent.past(partial(_is_in, expressions), asked.missing, oldest)
        parts: dict[str, list[Written]] = {}
        for one in past.written:
            parts.setdefault(one.key, []).append(one)
        for key, whole in parts.items():
            for part in fitting(whole, most(key)):
                query.reply(key, pack([(key, one.encoding, one.payload, one.envelope) for one in part]))
        query.reply(keys.own(self._sent.run, "counts"), pack((past.counts, past.dropped, len(past.written))))
        finish(query)

    def _asked(self, kind: keys.KeyClass, query: zenoh.Query) -> None:
        if query.parameters.get("run") not in (None, self._sent.run):
            finish(query)
            return
        try:
            form, age = form_asked(query, ""), _age(query.parameters)
        except EngageError as error:
            refuse(query, error.fault, "json")
            finish(query)
            return

        def is_wanted(key: str) -> bool:
            return keys.key_class(key) == kind and _is_in((query.key_expr,), key)

        past = self._sent.past(is_wanted, Missing(), self._loop.time() - age)
        self._answer(query, deque(past.written), form)

    def _answer(self, query: zenoh.Query, waiting: deque[Written], form: str) -> None:
        for _ in range(min(BATCH, len(waiting)) if self._open else 0):
            one = waiting.popleft()
            payload, encoding = one.payload, one.encoding
            if form and not encoding.startswith(f"application/{form}"):
                try:
                    payload, encoding = in_form(one.key, decode(payload, encoding), form)
                except InputRefused as error:  # JSON is longer than MessagePack
                    refuse(query, error.fault, form)
                    continue
            attachment = pack(one.envelope)
            query.reply(one.key, payload, encoding=encoding, attachment=attachment, timestamp=one.stamp)  # type: ignore[arg-type]
        if waiting and self._open:
            self._loop.call_soon(self._answer, query, waiting, form)
        else:
            finish(query)


def _is_in(expressions: Sequence[zenoh.KeyExpr], key: str) -> bool:
    return any(each.intersects(zenoh.KeyExpr(key)) for each in expressions)


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


def refuse(query: zenoh.Query, fault: Fault, form: str) -> None:
    """Answer the query with an error, unless it asks all processes: such an error has the key that was asked.

    No router lets a process answer for all, so each would only be told of as a denial.
    """
    if "/@bus/" in (key := str(query.key_expr)) and "*" in key:
        return
    payload, encoding = in_form(key, fault, form)
    query.reply_err(payload, encoding=encoding)


def finish(query: zenoh.Query) -> None:
    """Tell Zenoh that there will be no more replies: the asking process waits for that."""
    query.drop()  # type: ignore[no-untyped-call]


def _age(parameters: zenoh.Parameters) -> Seconds:
    text = parameters.get("age")
    try:
        age = keys.HISTORY_MAX_AGE if text is None else float(text)
    except ValueError:
        age = float("nan")
    if isnan(age) or age < 0:
        raise InputRefused(Fault(reason=f"age {text!r}", where="selector", advice="seconds: age=10"))
    return age
