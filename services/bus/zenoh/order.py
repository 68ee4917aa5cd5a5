"""Order, history and repair of losses on a wire that keeps order only per link. Pure: no zenoh, no clock, no loop.

Every process numbers what it publishes on ordered keys (`Envelope`), keeps the last of it (`SentLog`) and hands it
out on request. Every subscription follows each publishing process (`Follower`): it starts by asking for the past,
holds what arrives meanwhile, and merges both by number; a gap in a key's count makes it ask again. So messages of
one process arrive in its order across keys, each once, whether they came live, from history, or after a cut.

What a message claims of itself anybody can write; what a process answers, only that process can. So its answer
decides: what was there before the question and is beyond the counts of the answer was never published.

A key lasts as long as something of it is kept, for there is no end of people and clients, whose names stand in keys.
One that comes later begins above all counts that were dropped. So a receiver that knew it is not misled; and any
receiver asks, and learns from the answer which keys are left.

Zenoh's own advanced subscribers do this per key: a replayed history and what is recovered after a cut come in no
order across keys. Sync points and outcomes live on different keys and must not overtake one another, hence this file
(measured in docs/decisions/0005).
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from zlib import crc32

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.access import LONGEST_KEY, SMALL
from engage_hri.schemas.units import Seconds

KEPT = 4096
"""Number of messages that a process keeps for subscribers that missed them."""
KEPT_BYTES = 16 * 1024 * 1024
"""Bytes of these messages, of all together; the last is kept whatever its size."""
STATES_KEPT = 1024
"""Number of states of which a subscription knows when the newest value was sent."""
ABOUT = LONGEST_KEY + 512
"""Bytes, or more than there are, that a message in such an answer has besides its payload."""
COUNT = 16
"""Bytes that a count takes at most beside its key. Those of a pulse, and what is around them, have to fit in it."""
PULSE_FOR: Seconds = 3.0
"""Time after a message for which its count is published, for receivers that lost the last one of a burst."""


class Envelope(Struct, frozen=True, array_like=True):
    """The attachment of a sample: its sender, the time by the sender's clock, and its place in the order.

    Which process sent it, Zenoh says: nothing here can name another.
    number: among all ordered messages of its process, from 1; 0 on a stream, and of a program without envelopes.
    nth: among the messages of its process on this key, from 1; from `base` + 1 on a key that may have been before.
    mark: of its key (`mark_of`); 0 of a program that gives none. Zenoh may bring a message under another key.
    """

    source: str
    clock: str
    sent: Seconds
    number: int = 0
    nth: int = 0
    base: int = 0
    mark: int = 0


def mark_of(key: str) -> int:
    """A short number of a key, the CRC-32 of its letters, by which one under which a message comes is checked.

    Zenoh writes a number for a key, and tells once on each link what it stands for. When a process calls again while
    the end of its old link is not known yet, the numbers of both links are mixed up until the new one is ended, too
    (docs/decisions/0137-a-message-says-its-key.md).
    """
    return crc32(key.encode())


class Written(Struct, frozen=True, array_like=True):
    """A message as it travels. stamp: Zenoh's timestamp, where it is kept."""

    key: str
    encoding: str
    payload: bytes
    envelope: Envelope
    stamp: object = None


Counts = dict[str, int]
"""Counts of a process, by key: a receiver with a lower one has missed something."""


class Missing(Struct, frozen=True):
    """A follower's question for the past. seen: its last count, by key. is_new: it has never caught up.

    age: time since it began to follow. A new one gets what is recent as of then: a late answer loses nothing.
    """

    seen: Counts = {}
    is_new: bool = True
    age: Seconds = 0.0


def together(questions: Sequence[Missing]) -> Missing:
    """One question for all that these ask for, who are new, or one alone. Each leaves out what it has seen itself."""
    known = set.intersection(*({*each.seen} for each in questions))
    seen = {key: min(each.seen[key] for each in questions) for key in known}
    return Missing(seen, questions[0].is_new, max(each.age for each in questions))


class Past(Struct, frozen=True):
    """The answer of a process: what was missing, in order, and its counts of all keys that were asked for.

    dropped: number of its last message before it last dropped a key.
    """

    counts: Counts
    written: tuple[Written, ...]
    dropped: int = 0

    def count(self, one: Written) -> int:
        """Count of the key of this message when the process answered; its own, if the key was dropped since."""
        was_dropped = one.key not in self.counts and one.envelope.number <= self.dropped
        return one.envelope.nth if was_dropped else self.counts.get(one.key, 0)

    def of(self, wanted: Callable[[str], bool]) -> "Past":
        """The part of it that is about these keys."""
        counts = {key: nth for key, nth in self.counts.items() if wanted(key)}
        return Past(counts, tuple(one for one in self.written if wanted(one.key)), self.dropped)


class SentLog:
    """The messages that one process has published: numbers them, keeps them, gives them out again."""

    def __init__(self, run: str, kept: int = KEPT) -> None:
        self.run = run
        self.number = 0
        self.counts: Counts = {}
        """Of each key of which something is kept."""
        self._written_at: dict[str, Seconds] = {}
        self._most = kept
        self._bytes = 0
        self._kept: deque[Written] = deque()
        self._kept_of: Counter[str] = Counter()
        """Number of messages in `_kept`, by key."""
        self._states: dict[str, Written] = {}
        self._bases: Counts = {}
        """Highest count that any dropped key had when this one began, by key."""
        self._base = 0
        self._dropped = 0

    def write(
        self, key: str, encoding: str, payload: bytes, source: str, clock: str, now: Seconds, stamp: object = None
    ) -> Written:
        """Number the next message and keep it."""
        self.number += 1
        base = self._bases.setdefault(key, self._base)
        nth = self.counts[key] = self.counts.get(key, base) + 1
        envelope = Envelope(source, clock, now, self.number, nth, base, mark_of(key))
        written = Written(key, encoding, payload, envelope, stamp)
        self._written_at.pop(key, None)
        self._written_at[key] = now  # the last in order
        if keys.key_class(key) == "state":
            self._states[key] = written
        else:
            self._keep(written)
        return written

    def _keep(self, written: Written) -> None:
        self._kept.append(written)
        self._kept_of[written.key] += 1
        self._bytes += len(written.payload)
        while len(self._kept) > self._most or (self._bytes > KEPT_BYTES and len(self._kept) > 1):
            oldest = self._kept.popleft()
            self._bytes -= len(oldest.payload)
            self._kept_of[oldest.key] -= 1
            if not self._kept_of[oldest.key]:
                del self._kept_of[oldest.key]
                self._drop(oldest.key)

    def withdraw(self, key: str) -> None:
        """Forget a state: nobody gets it any more. One that was never published is none."""
        if self._states.pop(key, None) is not None:
            self._drop(key)

    def _drop(self, key: str) -> None:
        self._base = max(self._base, self.counts.pop(key))
        self._dropped = self.number
        del self._written_at[key], self._bases[key]

    def past(self, wanted: Callable[[str], bool], missing: Missing, oldest: Seconds) -> Past:
        """Answer `missing`; a first joiner gets the last states, and the rest from the time `oldest` on."""
        counts = {key: nth for key, nth in self.counts.items() if wanted(key)}
        written = [
            one
            for one in chain(self._kept, self._states.values())
            if one.key in counts and self._is_missing(one, missing, oldest)
        ]
        written.sort(key=_number)
        return Past(counts, tuple(written), self._dropped)

    def _is_missing(self, one: Written, missing: Missing, oldest: Seconds) -> bool:
        is_state = one.key in self._states
        seen = missing.seen.get(one.key, 0)
        if missing.is_new and not seen:
            return is_state or one.envelope.sent >= oldest
        # Who has seen more than there was took a forged state for the last one.
        return one.envelope.nth > seen or (is_state and seen > self.counts[one.key])

    def recent(self, now: Seconds) -> dict[keys.Flow, Counts]:
        """Counts of the keys written in the last `PULSE_FOR`, by flow: the last ones, as many as a pulse can have."""
        found: dict[keys.Flow, Counts] = {}
        size = 0
        for key, at in reversed(self._written_at.items()):
            size += len(key.encode()) + COUNT
            if now - at > PULSE_FOR or size > SMALL - COUNT:
                break
            found.setdefault(keys.flow_of(key), {})[key] = self.counts[key]
        return found


class Follower:
    """One publishing process as one subscription sees it.

    known: whether it was ever seen to have a past; until then nobody can answer for it, so nothing of it is believed.
    behind: the past is needed; until `catch_up` nothing is delivered. gaps: how often a message was missed.
    lost: messages that were gone for good. forged: claims that the process' answers have disproved. asking, again:
    kept for `Readers`: the question is on its way, and is to be asked once more after it. since: when it began.
    """

    def __init__(self, patterns: Iterable[str], since: Seconds) -> None:
        self.patterns = tuple(patterns)
        self.since = since
        self.known = False
        self.behind = True
        self.asking = False
        self.again = False
        self.gaps = 0
        self.lost = 0
        self.forged = 0
        self._is_new = True
        self._seen: Counts = {}
        self._last: dict[str, Envelope] = {}
        """Envelope of the last message delivered, by key."""
        self._held: list[Written] = []
        self._held_before = 0
        """Number of those in `_held` that were there when the question was asked."""

    def take(self, written: Written) -> list[Written]:
        """Take a message that has arrived; returns the messages to deliver now."""
        key, envelope = written.key, written.envelope
        seen = self._seen.get(key, 0)
        if envelope.nth <= seen:
            if envelope.nth < seen or self._last.get(key, envelope) == envelope:
                return []
            # Two messages claim the same place. At most one of them was published.
            self._seen[key] = seen - 1
            self._fall_behind()
        elif envelope.nth > seen + 1:
            self._fall_behind()
        if self.behind:
            self._held.append(written)
            return []
        self._deliver(written)
        return [written]

    @property
    def has_answered(self) -> bool:
        """True once a question for the past has been answered."""
        return not self._is_new

    @property
    def held(self) -> int:
        """Number of messages that wait for the past."""
        return len(self._held)

    def drop(self) -> None:
        """Take what is held for forged."""
        self.forged += self.held
        self._held = []

    def _deliver(self, written: Written) -> None:
        self._seen[written.key] = written.envelope.nth
        self._last[written.key] = written.envelope

    def pulse(self, pulse: Counts) -> None:
        """Compare counts; sets `behind` if a message is missing, or if there was one too many."""
        for key, nth in pulse.items():
            if nth != self._seen.get(key, 0) and any(keys.matches(pattern, key) for pattern in self.patterns):
                self._fall_behind()

    def _fall_behind(self) -> None:
        self.gaps += not self.behind
        self.behind = True

    def missing(self, now: Seconds) -> Missing:
        """Make the question. Its answer decides on all that is held now."""
        self._held_before = len(self._held)
        return Missing(dict(self._seen), self._is_new, now - self.since)

    def catch_up(self, past: Past | None) -> list[tuple[Written, bool]]:
        """Take the past (None: there was no answer). Returns the messages to deliver, and whether each is history.

        Still `behind` after it: what has come since the question does not join up, and is to be asked for, too.
        """
        first = self._is_new
        held = self._held if past is None else self._disproved(past)
        live = {(one.key, one.envelope.nth) for one in held}
        merged = {(one.key, one.envelope.nth): one for one in chain(held, past.written if past else ())}
        deliver, unknown = [], []
        for one in sorted(merged.values(), key=_number):
            key, nth = one.key, one.envelope.nth
            seen = self._seen.get(key, 0)
            if nth <= seen or self._last.get(key) == one.envelope:
                self._seen[key] = max(nth, seen)
                continue
            if past is not None and nth > max(seen, past.count(one)) + 1:
                unknown.append(one)
                continue
            if not (first and key not in self._seen) and not may_skip(key):
                self.lost += nth - max(seen, one.envelope.base) - 1
            self._deliver(one)
            deliver.append((one, first and (key, nth) not in live))
        if past is not None:
            for key, nth in past.counts.items():
                seen = self._seen.get(key, 0)
                self.lost += 0 if first or may_skip(key) else max(0, nth - seen)
                self._seen[key] = max(nth, seen)
            self._is_new = False
        self._held = unknown
        self.behind = bool(unknown)
        return deliver

    def _disproved(self, past: Past) -> list[Written]:
        """Correct the counts by the answer; returns what is held, without what the answer should know and doesn't."""
        for key, seen in tuple(self._seen.items()):
            count = past.counts.get(key)
            if count is None:
                self._forget(key, past.dropped)
            elif seen > count:
                # The last true state comes again: it was overwritten.
                self._seen[key] = max(0, count - 1) if may_skip(key) else count
                self.forged += 1
        before, since = self._held[: self._held_before], self._held[self._held_before :]
        published = [one for one in before if one.envelope.nth <= past.count(one)]
        self.forged += len(before) - len(published)
        return published + since

    def _forget(self, key: str, dropped: int) -> None:
        """Forget a key of which its process knows nothing: it was dropped, or never there."""
        del self._seen[key]
        last = self._last.pop(key, None)
        self.forged += last is not None and last.number > dropped


class NewestStates:
    """The newest value of each state that a subscription has got, of whichever process, and when it was sent.

    Several processes may publish one state, as the world. Each has a link of its own, and hands out its last value at
    its own pace: the oldest of these may come last.
    """

    def __init__(self) -> None:
        self._newest: dict[str, tuple[str, Seconds]] = {}

    def take(self, written: Written, run: str, sent: Seconds) -> bool:
        """Take a state's value that has come. False: another process' newer one has been delivered before it.

        sent: local time at which it was sent.
        """
        by, newest = self._newest.pop(written.key, (run, sent))
        is_overtaken = by != run and sent < newest
        self._newest[written.key] = (by, newest) if is_overtaken else (run, sent)
        if len(self._newest) > STATES_KEPT:
            del self._newest[next(iter(self._newest))]
        return not is_overtaken


def fitting(written: Sequence[Written], limit: int) -> Iterator[list[Written]]:
    """Divide messages of one key into parts that can be sent: each has `limit` bytes, or one message."""
    part: list[Written] = []
    size = 0
    for one in written:
        weight = len(one.payload) + ABOUT
        if part and size + weight > limit:
            yield part
            part, size = [], 0
        part.append(one)
        size += weight
    yield part


def may_skip(key: str) -> bool:
    """True for a state: only its last value counts, so older ones may be missing."""
    return keys.key_class(key) == "state"


def _number(written: Written) -> int:
    return written.envelope.number
