"""The bridge from Zenoh's threads to the loop: the only place where they meet.

Zenoh calls on threads of its own, and each call that waits halts the link that it came by. So a call appends and
wakes the loop, nothing else. What waits for the loop then is a queue that anybody on the bus can fill: who floods
would have all others wait behind it. So each has its turn (decision 0125).
"""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import zenoh
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.units import Seconds

BATCH = 256
CROWD = 262_144
"""Number of messages waiting for the loop from which on even ordered ones are dropped (and asked for again)."""
CROWD_OF_ONE = 16 * 1024 * 1024
"""Bytes of one process' messages waiting for the loop from which on more of them are dropped."""
EACH = 1024
"""Bytes that a message takes at least."""
QUESTIONS = 4096
"""Number of questions waiting for the loop from which on more get no answer."""
STREAM_CROWD = 1024
PLACES = 64
"""Places of one sender in the common line."""

T = TypeVar("T")


class Turns(Generic[T]):
    """Items of many senders, in the order in which they came, as long as each has few that wait.

    A sender with more than `PLACES` has the rest in a line of its own. When an item of it leaves the common line, its
    next one takes the last place there. So a flood delays the items of others by `PLACES` of its own at most, and the
    items of one sender never change their order.
    """

    def __init__(self) -> None:
        self._line: deque[tuple[str | None, T]] = deque()
        self._places: dict[str, int] = {}
        self._behind: dict[str, deque[T]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, sender: str | None, item: T) -> None:
        """Add an item. sender None: it has a place in any case."""
        self._count += 1
        if sender is not None:
            places = self._places.get(sender, 0)
            if places >= PLACES:
                self._behind.setdefault(sender, deque()).append(item)
                return
            self._places[sender] = places + 1
        self._line.append((sender, item))

    def popleft(self) -> T:
        """Take the first item. Raises IndexError if there is none."""
        sender, item = self._line.popleft()
        self._count -= 1
        if sender is not None:
            if (behind := self._behind.get(sender)) is not None:
                self._line.append((sender, behind.popleft()))
                if not behind:
                    del self._behind[sender]
            elif self._places[sender] > 1:
                self._places[sender] -= 1
            else:
                del self._places[sender]
        return item

    def clear(self) -> None:
        for each in (self._line, self._places, self._behind):
            each.clear()
        self._count = 0


class Traffic(Struct):
    """Figures of the bridge. depth: most items that ever waited. lag: longest wait of a batch for the loop."""

    passed: int = 0
    dropped: int = 0
    depth: int = 0
    lag: Seconds = 0.0


class Arrived(Struct, frozen=True):
    """A sample, copied out of Zenoh's buffers: each that waits would keep all of the one that it came in.

    sender: Zenoh id in its source info; empty: it has none. stamped_by: then the id in its timestamp, if it has one.
    """

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None
    sender: str
    stamped_by: str
    is_put: bool


def copied(sample: zenoh.Sample) -> Arrived:
    attachment, source = sample.attachment, sample.source_info
    # Each of these ids takes as long as all the rest, so the second is read only of who has no first.
    stamp = sample.timestamp if source is None else None
    return Arrived(
        str(sample.key_expr),
        sample.payload.to_bytes(),
        str(sample.encoding),
        None if attachment is None else attachment.to_bytes(),
        "" if source is None else str(source.source_id.zid),
        "" if stamp is None else str(stamp.get_id()),
        sample.kind == zenoh.SampleKind.PUT,
    )


class LoopBridge:
    """Queues from Zenoh's threads to the loop: one for all ordered keys; one for streams, the oldest dropped first.

    A callback appends an item and wakes the loop if need be, nothing else: any waiting there stalls the link. On the
    loop each sender has its turn (`Turns`): who floods is served with the others, and not before them. The token of a
    process takes its turn among the messages of that process, and overtakes none of them.
    Messages of a process of which too much waits are dropped, and questions if there are too many. Who comes and
    goes, and the answers to what was asked here, come in any case: nobody would ask for them again.
    """

    def __init__(self, failed: Callable[[Exception, str], None]) -> None:
        """failed: called with an error while one item is taken, and its text; the other items go on."""
        self.traffic = Traffic()
        self._failed = failed
        self._loop = asyncio.get_running_loop()
        self._ordered: deque[tuple[Callable[[Any], None], Any, str | None, int]] = deque()
        """What came since the loop last looked: who takes it, the item, its sender (None: it waits for no other), and
        its bytes."""
        self._turns: Turns[tuple[Callable[[Any], None], Any, str | None, int]] = Turns()
        self._streams: deque[tuple[Callable[[Any], None], Any]] = deque(maxlen=STREAM_CROWD)
        self._came: dict[str, int] = {}
        self._left: dict[str, int] = {}
        """Bytes by process: of what came since nothing waited, and of what of that waits no longer. Zenoh's threads
        write the one, the loop the other. Two threads may write at once, and then the limit is a little wider."""
        self._woken = False
        self._woken_at = 0.0
        self._open = True

    def on_loop(
        self,
        enter: Callable[[Any], None],
        end: Callable[[Any], None] | None = None,
        first: Callable[[Any], None] | None = None,
    ) -> Any:
        """Make a handler for tokens, or for replies: `enter` runs on the loop with each, `end` at last.

        first: called with each in Zenoh's thread. It must not wait.
        """

        def came(item: Any) -> None:
            if first is not None:
                first(item)
            self._let_in(enter, item)

        def ended() -> None:
            if end is not None:
                self._let_in(end, None)

        # indirect=False: else Zenoh starts a Python thread for each of these.
        return zenoh.handlers.Callback(came, ended, indirect=False)

    def questions(self, enter: Callable[[zenoh.Query], None]) -> Any:
        """Make a handler for a queryable. A question that is dropped ends without an answer."""

        def sort(query: zenoh.Query) -> None:
            asker = query.source_info
            sender = "?" if asker is None else f"{asker.source_id.zid} ?"
            self._let_in_of(sender, CROWD_OF_ONE // QUESTIONS, enter, query)

        return zenoh.handlers.Callback(sort, indirect=False)

    def samples(self, enter: Callable[[Arrived], None]) -> Any:
        """Make a handler for subscribers. Samples that may be dropped take the streams' queue."""

        def sort(sample: zenoh.Sample) -> None:
            arrived = copied(sample)
            if sample.congestion_control == zenoh.CongestionControl.DROP:
                if len(self._streams) == STREAM_CROWD:
                    self.traffic.dropped += 1
                self._streams.append((enter, arrived))
                self._wake()
                return
            # A router stamps for all who do not: of these, each who has a key of its own is a sender.
            sender = arrived.sender or f"{arrived.stamped_by} {keys.requester_of(arrived.key)}"
            self._let_in_of(sender, EACH + len(arrived.payload), enter, arrived)

        return zenoh.handlers.Callback(sort, indirect=False)

    def _let_in_of(self, sender: str, size: int, enter: Callable[[Any], None], item: Any) -> None:
        came = self._came.get(sender, 0)
        if came - self._left.get(sender, 0) > CROWD_OF_ONE or len(self._ordered) + len(self._turns) >= CROWD:
            self.traffic.dropped += 1
        else:
            self._came[sender] = came + size
            self._let_in(enter, item, sender, size)

    @property
    def waiting(self) -> int:
        return len(self._ordered) + len(self._turns) + len(self._streams)

    def close(self) -> None:
        """Drop all items, waiting or to come."""
        self._open = False
        for each in (self._ordered, self._turns, self._streams):
            each.clear()

    def _let_in(self, enter: Callable[[Any], None], item: Any, sender: str | None = None, size: int = 0) -> None:
        self._ordered.append((enter, item, sender, size))
        self._wake()

    def _wake(self) -> None:
        if not self._woken and self._open:
            self._woken = True
            self._woken_at = self._loop.time()
            try:
                self._loop.call_soon_threadsafe(self._drain)
            except RuntimeError:  # the loop is closed: the process is ending
                self._open = False

    def _drain(self) -> None:
        # The flag first: an item that is appended from here on wakes the loop again, so none is left behind.
        self._woken = False
        self.traffic.lag = max(self.traffic.lag, self._loop.time() - self._woken_at)
        waiting = self.waiting
        self.traffic.depth = max(self.traffic.depth, waiting)
        try:
            for _ in range(len(self._ordered)):
                one = self._ordered.popleft()
                self._turns.append(_process_of(one[1]) if one[2] is None else one[2], one)
            for _ in range(min(waiting, BATCH)):
                if not self._open:
                    return
                if self._turns:
                    enter, item, sender, size = self._turns.popleft()
                    if sender is not None:
                        self._left[sender] = self._left.get(sender, 0) + size
                else:
                    enter, item = self._streams.popleft()
                self.traffic.passed += 1
                try:
                    enter(item)
                except Exception as error:
                    self._failed(error, f"what came in: {str(item)[:80]}")
        finally:
            if self.waiting and not self._woken:
                self._woken = True
                self._woken_at = self._loop.time()
                self._loop.call_soon(self._drain)
            elif not self._ordered and not self._turns:
                self._came, self._left = {}, {}


def _process_of(item: object) -> str | None:
    """Process of a token, in `@bus/<run>/...`; None for all that is no token."""
    if not isinstance(item, zenoh.Sample):
        return None
    return str(item.key_expr).partition("/@bus/")[2].partition("/")[0] or None
