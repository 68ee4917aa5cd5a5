"""Order, history and repair of losses on a wire that keeps order only per link. Pure: no zenoh, no clock, no loop.

Every process numbers what it publishes on ordered keys (`Envelope`), keeps the last of it (`SentLog`) and hands it
out on request. Every subscription follows each publishing process (`Follower`): it starts by asking for the past,
holds what arrives meanwhile, and merges both by number; a gap in a key's count makes it ask again. So messages of
one process arrive in its order across keys, each once, whether they came live, from history, or after a cut.

Zenoh's own advanced subscribers do this per key: a replayed history and what is recovered after a cut come in no
order across keys. Sync points and outcomes live on different keys and must not overtake one another, hence this file
(measured in docs/decisions/0005).
"""

from collections import deque
from collections.abc import Iterable
from itertools import chain

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.units import Seconds

KEPT = 4096
"""Number of messages that a process keeps for subscribers that missed them."""
PULSE_FOR: Seconds = 3.0
"""Time after a message for which its count is published, for receivers that lost the last one of a burst."""


class Envelope(Struct, frozen=True, array_like=True):
    """The attachment of a sample: its sender, the time by the sender's clock, and its place in the order.

    run: the publishing process' life; of a program that sends no envelope, the life that its connection tells.
    number: among all its ordered messages, from 1; 0 on a stream, and from a program that sends no envelope.
    nth: among its messages on this key, from 1.
    """

    source: str
    clock: str
    sent: Seconds
    run: str = ""
    number: int = 0
    nth: int = 0


class Written(Struct, frozen=True, array_like=True):
    """A message as it travels, live or in a `Past`."""

    key: str
    encoding: str
    payload: bytes
    envelope: Envelope


class Missing(Struct, frozen=True):
    """A follower's question for the past. seen: its last count, by key. since: -1 if it has never caught up."""

    patterns: tuple[str, ...]
    seen: dict[str, int]
    since: int = -1


class Past(Struct, frozen=True):
    """The answer: messages in order, and the counts of all matching keys at this moment."""

    number: int
    counts: dict[str, int]
    written: tuple[Written, ...]


class Pulse(Struct, frozen=True):
    """Recent counts by key: a receiver with a lower count has lost a message."""

    counts: dict[str, int]


class SentLog:
    """The messages that one process has published: numbers them, keeps them, gives them out again."""

    def __init__(self, run: str, kept: int = KEPT) -> None:
        self.run = run
        self.number = 0
        self.counts: dict[str, int] = {}
        self._written_at: dict[str, Seconds] = {}
        self._kept: deque[Written] = deque(maxlen=kept)
        self._states: dict[str, Written] = {}

    def write(self, key: str, encoding: str, payload: bytes, source: str, clock: str, now: Seconds) -> Written:
        """Number the next message and keep it."""
        self.number += 1
        nth = self.counts[key] = self.counts.get(key, 0) + 1
        written = Written(key, encoding, payload, Envelope(source, clock, now, self.run, self.number, nth))
        self._written_at[key] = now
        if keys.key_class(key) == "state":
            self._states[key] = written
        else:
            self._kept.append(written)
        return written

    def past(self, missing: Missing, now: Seconds) -> Past:
        """Answer `missing`; a first joiner gets the last states and `HISTORY_MAX_AGE` of the rest."""
        counts = {key: nth for key, nth in self.counts.items() if _wanted(missing.patterns, key)}
        written = [
            one
            for one in chain(self._kept, self._states.values())
            if one.key in counts and self._is_missing(one, missing, now)
        ]
        written.sort(key=_number)
        return Past(self.number, counts, tuple(written))

    def _is_missing(self, one: Written, missing: Missing, now: Seconds) -> bool:
        if one.key in missing.seen:
            return one.envelope.nth > missing.seen[one.key]
        if missing.since >= 0:
            return one.envelope.number > missing.since
        return one.key in self._states or now - one.envelope.sent <= keys.HISTORY_MAX_AGE

    def recent(self, now: Seconds) -> dict[str, int]:
        """Counts of the keys written in the last `PULSE_FOR`."""
        return {key: self.counts[key] for key, at in self._written_at.items() if now - at <= PULSE_FOR}


class Follower:
    """One publishing process as one subscription sees it.

    behind: the past is needed; until `catch_up` nothing is delivered. gaps: how often a message was missed.
    lost: messages that were gone for good. asking, again: kept for `Readers`: the question is on its way, and is to
    be asked once more after it.
    """

    def __init__(self, patterns: Iterable[str]) -> None:
        self.patterns = tuple(patterns)
        self.behind = True
        self.asking = False
        self.again = False
        self.gaps = 0
        self.lost = 0
        self._since = -1
        self._seen: dict[str, int] = {}
        self._held: list[Written] = []

    def take(self, written: Written) -> list[Written]:
        """Take a message that has arrived; returns the messages to deliver now."""
        envelope = written.envelope
        expected = self._seen.get(written.key, 0) + 1
        if envelope.nth < expected:
            return []
        if envelope.nth > expected and not self._may_skip(written.key):
            self._fall_behind()
        if self.behind:
            self._held.append(written)
            return []
        self._seen[written.key] = envelope.nth
        return [written]

    def pulse(self, pulse: Pulse) -> None:
        """Compare counts; sets `behind` if a message is missing."""
        for key, nth in pulse.counts.items():
            if nth > self._seen.get(key, 0) and _wanted(self.patterns, key):
                self._fall_behind()

    def _fall_behind(self) -> None:
        self.gaps += not self.behind
        self.behind = True

    def missing(self) -> Missing:
        return Missing(self.patterns, dict(self._seen), self._since)

    def catch_up(self, past: Past | None) -> list[tuple[Written, bool]]:
        """Take the past (None: there was no answer). Returns the messages to deliver, and whether each is history."""
        first = self._since < 0
        live = {one.envelope.number for one in self._held}
        merged = {one.envelope.number: one for one in chain(past.written if past else (), self._held)}
        deliver = []
        for number in sorted(merged):
            one = merged[number]
            seen = self._seen.get(one.key, 0)
            if one.envelope.nth <= seen:
                continue
            if not (first and one.key not in self._seen) and not self._may_skip(one.key):
                self.lost += one.envelope.nth - seen - 1
            self._seen[one.key] = one.envelope.nth
            deliver.append((one, first and number not in live))
        for key, nth in past.counts.items() if past else ():
            seen = self._seen.get(key, 0)
            if nth > seen:
                self.lost += 0 if first or self._may_skip(key) else nth - seen
                self._seen[key] = nth
        if past is not None:
            self._since = past.number
        self._held = []
        self.behind = False
        return deliver

    def _may_skip(self, key: str) -> bool:
        """True for a state: only its last value counts, so older ones may be missing."""
        return keys.key_class(key) == "state"


def _number(written: Written) -> int:
    return written.envelope.number


def _wanted(patterns: tuple[str, ...], key: str) -> bool:
    return any(keys.matches(pattern, key) for pattern in patterns)
