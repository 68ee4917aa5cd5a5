"""Connection events of the robot's turns, and the outcome of each turn once all of it is decided."""

from collections.abc import Collection, Iterable
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.heard import HeardWords
from engage_hri.services.generation.turns.policy import Aborted, TurnPlan

WORDS_PATIENCE: Seconds = 2.0
"""Time after the end of a spoken answer for which the outcome of the turn waits for its words, if somebody tells the
words of that person: recognizers know them 0.3 to 2 s after they were said. Decision 0065."""
LONGEST_ANSWER: Seconds = 15.0
"""Time after the beginning of such an answer for which the outcome waits for its end. Ours."""


class TurnEvents:
    """The connection events of the robot's turns in their last known state."""

    def __init__(self) -> None:
        self._events: dict[str, ConnectionEvent] = {}
        self._turn_of: dict[str, str] = {}
        """The turn of each block."""
        self._changed: dict[str, Seconds] = {}
        """When each event came to its state."""

    def expect(self, block: str, turn: str) -> None:
        self._turn_of[block] = turn

    def feed(self, event: ConnectionEvent, now: Seconds) -> None:
        # An event that is first heard of in a later state belongs to an earlier performance under the same id.
        if event.block in self._turn_of and (event.state == "started" or event.id in self._events):
            if not event.retold:
                self._changed[event.id] = now
            self._events[event.id] = replace(event, retold=False)

    def changed(self, event: ConnectionEvent) -> Seconds:
        """Local time at which the event came to its state, as far as is known here."""
        return self._changed.get(event.id, float("-inf"))

    def lose(self, session: str = "") -> None:
        """End undecided events of other sessions as lost: recognition is gone, or has come back as `session`."""
        for id, event in self._events.items():
            if event.state == "started" and event.session != session:
                self._events[id] = replace(event, state="lost")

    def of_turn(self, turn: str) -> tuple[ConnectionEvent, ...]:
        """The events of a turn, by their start."""
        events = [event for event in self._events.values() if self._turn_of[event.block] == turn]
        return tuple(sorted(events, key=lambda event: event.started.seconds))

    def last_begun_by(self, block: str, behavior: str) -> ConnectionEvent | None:
        """The last event that this behavior of the block has begun, if there is one."""
        mine = (event for event in reversed(self._events.values()) if event.block == block)
        return next((event for event in mine if event.behavior == behavior), None)

    def pairs(self, turn: str) -> tuple[ConnectionEvent, ...]:
        """The adjacency pairs of a turn: one, unless it was performed before under the same id."""
        return tuple(event for event in self.of_turn(turn) if event.kind == "adjacency_pair")

    def open_pair(self, turn: str) -> ConnectionEvent | None:
        """The adjacency pair of a turn, while it is undecided."""
        return next((event for event in self.pairs(turn) if event.state == "started"), None)

    def forget(self, turns: Iterable[str]) -> None:
        """Keep only these turns."""
        kept = set(turns)
        self._turn_of = {block: turn for block, turn in self._turn_of.items() if turn in kept}
        self._events = {id: event for id, event in self._events.items() if event.block in self._turn_of}
        self._changed = {id: at for id, at in self._changed.items() if id in self._events}


class _Record(Struct):
    """A turn that is not closed. spoken: by fragment, in order of arrival. ended: time of its end so far."""

    addressee: str
    spoken: dict[str, tuple[SpokenText, ...]] = {}
    status: Literal["done", "aborted"] = "done"
    reason: str = ""
    ended: Seconds = 0.0


class TurnOutcomes:
    """Outcomes of the robot's turns; backchannels have none. `deadline`: when to call `close_due` again."""

    def __init__(self, events: TurnEvents, heard: HeardWords, config: GenerationConfig, sight: Sight) -> None:
        self._events = events
        self._heard = heard
        self._config = config
        self._records: dict[str, _Record] = {}
        self._given_up = Silences[str](sight)
        """Turns that are over, and when to stop waiting for the answer."""

    @property
    def turns(self) -> Collection[str]:
        """Ids of the turns that are not closed."""
        return self._records.keys()

    def expect(self, fragment: str, turn: TurnPlan) -> TurnClosed | None:
        """Take an accepted fragment. Returns the outcome of a turn of this name that still waited for its answer."""
        displaced = None
        if fragment == turn.turn and fragment in self._records:
            displaced = self._close(fragment)
            self._events.forget(self._records.keys())
        if not turn.backchannel:
            self._records.setdefault(turn.turn, _Record(turn.addressee)).spoken[fragment] = ()
        return displaced

    def refuse(self, fragment: str, turn: TurnPlan) -> None:
        """Take a fragment out of its turn again: the realizer has refused it."""
        if record := self._records.get(turn.turn):
            record.spoken.pop(fragment, None)

    def end(self, outcome: FragmentOutcome, turn: TurnPlan, now: Seconds) -> None:
        """Take the outcome of a fragment."""
        if record := self._records.get(turn.turn):
            record.spoken[outcome.fragment] = outcome.spoken
            record.ended = now

    def abort(self, aborted: Aborted, now: Seconds) -> None:
        """Note that a turn was aborted. It is not closed yet: recognition has still to withdraw its open events."""
        if record := self._records.get(aborted.turn):
            record.status, record.reason, record.ended = "aborted", aborted.why.reason, now

    @property
    def deadline(self) -> Seconds | None:
        return self._given_up.earliest

    def close_due(self, going: Collection[str], now: Seconds) -> tuple[TurnClosed, ...]:
        """Close the turns that are over by now. going: turns that are open, or have a fragment without an outcome."""
        for turn in self._records:
            self._given_up.keep(turn, None if turn in going else self._due_at(turn), now)
        over = iter(lambda: self._given_up.due(now), None)
        return tuple(closed for turn in over if (closed := self._close(turn)).fragments)

    def _due_at(self, turn: str) -> Seconds:
        """Time when the outcome of a turn is due: its end or, with an open pair, some time after the pair's limit.

        After an answer in words it is once these are known, if somebody tells them, but no later than a while.
        """
        pair = self._events.open_pair(turn)
        ended = self._records[turn].ended
        if pair is not None:
            return ended + (pair.limit or 0.0) + self._config.decision_patience
        return max((ended, *map(self._words_due_at, self._events.pairs(turn))))

    def _words_due_at(self, pair: ConnectionEvent) -> Seconds:
        """Time until which the words of an answer are waited for; long ago: they are not."""
        person = pair.responder
        if pair.response == "speak" and self._heard.expects(person):
            if pair.state == "succeeded":
                return self._events.changed(pair) + LONGEST_ANSWER
            ended = self._events.changed(pair)
            if pair.state == "completed" and (
                not pair.words or self._heard.is_saying(person, ended - LONGEST_ANSWER)
            ):
                return ended + WORDS_PATIENCE
        return float("-inf")

    def _close(self, turn: str) -> TurnClosed:
        record = self._records.pop(turn)
        self._given_up.clear(turn)
        for pair in self._events.pairs(turn):
            if pair.state == "completed" and pair.response == "speak" and not pair.words:
                self._heard.missed(pair.responder)
        return TurnClosed(
            turn=turn,
            addressee=record.addressee,
            status=record.status,
            reason=record.reason,
            fragments=tuple(record.spoken),
            spoken=tuple(
                replace(said, behavior=f"{fragment}:{said.behavior}")
                for fragment, all_said in record.spoken.items()
                for said in all_said
            ),
            events=self._events.of_turn(turn),
            heard=self._heard.of_turn(turn),
        )
