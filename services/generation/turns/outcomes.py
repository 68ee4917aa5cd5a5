"""Outcomes of the robot's turns, once all of each is decided: connection events, and what people said. Pure."""

from collections.abc import Callable, Collection, Iterable
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.fragments import FragmentOutcome, HeardText, TurnClosed
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.interjections import Interjections
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.generation.turns.robot_turns import Aborted
from engage_hri.services.reports.same_people import renamed

LOOKS_BACK: Seconds = 60.0
"""Time before a turn of which the words still count, if there was no turn meanwhile."""
MOST = 64
"""Number of utterances that are remembered."""
PEOPLE = 256
"""Number of people of whom it is known that somebody tells their words."""


class _Said(Struct):
    """An utterance by its newest result. known: local time when it came."""

    utterance: Utterance
    known: Seconds


class HeardWords:
    """The words of all people, as far as they are known."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str, int], _Said] = {}
        """By person, id and number of those of one id that do not overlap, the last to become so at the end."""
        self._told_of: dict[str, None] = {}
        self._since: dict[str, Seconds] = {}
        """Of each turn: from when on words count for it."""
        self._last_end: Seconds = float("-inf")

    def feed(self, utterance: Utterance, now: Seconds) -> None:
        """Take a result. A final one counts before one that is not, and else the newer one."""
        self._told_of.pop(utterance.actor, None)
        self._told_of[utterance.actor] = None
        if len(self._told_of) > PEOPLE:
            del self._told_of[next(iter(self._told_of))]
        key = (utterance.actor, utterance.id, self._number(utterance))
        known = self._said.get(key)
        if known is not None and _place(utterance) <= _place(known.utterance):
            return
        self._said.pop(key, None)
        self._said[key] = _Said(utterance, now)
        if len(self._said) > MOST:
            del self._said[next(iter(self._said))]

    def _number(self, utterance: Utterance) -> int:
        """Number of an utterance among those of one id: some recognizers use one id for all that they understand.

        Results of one utterance overlap; what began after the last of this id had ended is another one.
        """
        numbers = [n for actor, id, n in self._said if (actor, id) == (utterance.actor, utterance.id)]
        if not numbers:
            return 0
        known = self._said[utterance.actor, utterance.id, max(numbers)].utterance
        ended = known.ended or known.at
        is_later = known.final and utterance.began.clock == ended.clock and utterance.began.seconds >= ended.seconds
        return max(numbers) + (1 if is_later and utterance.began != known.began else 0)

    def expects(self, person: str) -> bool:
        """Tell whether somebody tells the words of this person: then those of an answer will come."""
        return person in self._told_of

    def is_saying(self, person: str, since: Seconds) -> bool:
        """Tell whether an utterance of the person has begun, or grown, since then and is not known for good."""
        return any(
            each.utterance.actor == person and not each.utterance.final and each.known >= since
            for each in self._said.values()
        )

    def missed(self, person: str) -> None:
        """Note that the words of an answer have not come: nobody waits for those of this person until more come."""
        self._told_of.pop(person, None)

    def rename(self, name: Callable[[str], str]) -> None:
        """Know people by other ids from now on. name: the new one of each."""
        said, self._said = self._said, {}
        for (actor, id, number), each in said.items():
            while (name(actor), id, number) in self._said:
                number += 1  # of the other one, who has used the same id
            self._said[name(actor), id, number] = _Said(renamed(each.utterance, name), each.known)
        self._told_of = {name(actor): None for actor in self._told_of}

    # -- turns --------------------------------------------------------------------------------------------------

    def turn_begins(self, turn: str, now: Seconds) -> None:
        """Note a turn: what has become known since the one before it counts for it."""
        self._since.setdefault(turn, max(self._last_end, now - LOOKS_BACK))

    def turn_ends(self, now: Seconds) -> None:
        """Note that a fragment has ended; the last of a turn is its end."""
        self._last_end = now

    def forget(self, turns: Collection[str]) -> None:
        """Keep only these turns."""
        self._since = {turn: since for turn, since in self._since.items() if turn in turns}

    def of_turn(self, turn: str) -> tuple[HeardText, ...]:
        """Words of all people since the turn before, known for good, in the order in which they began to say them."""
        since = self._since.get(turn, float("inf"))
        heard = [each.utterance for each in self._said.values() if each.utterance.final and each.known >= since]
        heard.sort(key=lambda each: (each.began.seconds, each.actor, each.id))
        return tuple(
            HeardText(actor=each.actor, id=each.id, text=text, began=each.began, to=each.to)
            for each in heard
            if (text := " ".join(each.text.split()))
        )


def _place(utterance: Utterance) -> tuple[bool, Seconds]:
    return utterance.final, utterance.at.seconds


WORDS_PATIENCE: Seconds = 2.0
"""Time after the end of a spoken answer for which the outcome of the turn waits for its words, if somebody tells the
words of that person: recognizers know them 0.3 to 2 s after they were said. Decision 0065."""
LONGEST_ANSWER: Seconds = 15.0
"""Time after the beginning of such an answer for which the outcome waits for its end. Ours."""
RESUMED_WITHIN: Seconds = 1.0
"""Time after the return of recognition within which it tells again of the pairs that it goes on with. Ours."""


class TurnEvents:
    """The connection events of the robot's turns in their last known state."""

    def __init__(self) -> None:
        self._events: dict[str, ConnectionEvent] = {}
        self._turn_of: dict[str, str] = {}
        """The turn of each block."""
        self._changed: dict[str, Seconds] = {}
        """When each event came to its state."""
        self._resumed_until: dict[str, Seconds] = {}
        self.session = ""
        """Session of recognition's present life; empty: none is there, as far as is known."""

    def expect(self, block: str, turn: str) -> None:
        self._turn_of[block] = turn

    def feed(self, event: ConnectionEvent, now: Seconds) -> None:
        # An event that is first heard of in a later state belongs to an earlier performance under the same id,
        # unless a request of this one has adopted it (decision 0187).
        is_known = event.id in self._events
        is_adopted = event.state == "succeeded" and (event.cause == "human" or event.retold)
        if event.block in self._turn_of and (event.state == "started" or is_known or is_adopted):
            if not event.retold or not is_known:
                self._changed[event.id] = now
            self._events[event.id] = replace(event, retold=False)

    def changed(self, event: ConnectionEvent) -> Seconds:
        """Local time at which the event came to its state, as far as is known here."""
        return self._changed.get(event.id, float("-inf"))

    def lose(self, now: Seconds, session: str = "") -> None:
        """End undecided events of other sessions as lost: recognition is gone, or has come back as `session`.

        If it has come back, it may go on with a pair: it then tells of it again under another id.
        """
        self.session = session
        for id, event in self._events.items():
            if event.state == "started" and event.session != session:
                self._events[id] = replace(event, state="lost")
                if session:
                    self._resumed_until[id] = now + RESUMED_WITHIN

    def resumed_until(self, pair: ConnectionEvent) -> Seconds:
        """Time until which a pair that was lost may be gone on with; long ago: it may not."""
        return self._resumed_until.get(pair.id, float("-inf"))

    def of_turn(self, turn: str) -> tuple[ConnectionEvent, ...]:
        """The events of a turn, by their start."""
        events = [event for event in self._events.values() if self._turn_of[event.block] == turn]
        return tuple(sorted(events, key=lambda event: event.started.seconds))

    def last_begun_by(self, block: str, behavior: str) -> ConnectionEvent | None:
        """The last event that this behavior of the block has begun, if there is one."""
        mine = (event for event in reversed(self._events.values()) if event.block == block)
        return next((event for event in mine if event.behavior == behavior), None)

    def pairs(self, turn: str) -> tuple[ConnectionEvent, ...]:
        """The adjacency pairs of a turn: one with each addressee, unless it was performed before under this id."""
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
        self._resumed_until = {id: at for id, at in self._resumed_until.items() if id in self._events}


class _Record(Struct):
    """A turn that is not closed. spoken: by fragment, in order of arrival. ended: time of its end so far."""

    addressee: str
    others: tuple[str, ...]
    spoken: dict[str, tuple[SpokenText, ...]] = {}
    status: Literal["done", "aborted"] = "done"
    reason: str = ""
    ended: Seconds = 0.0


class TurnOutcomes:
    """Outcomes of the robot's turns; backchannels have none. `deadline`: when to call `close_due` again."""

    def __init__(
        self,
        events: TurnEvents,
        heard: HeardWords,
        interjections: Interjections,
        config: GenerationConfig,
        sight: Sight,
    ) -> None:
        self._events = events
        self._heard = heard
        self._interjections = interjections
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
            self._records.setdefault(turn.turn, _Record(turn.addressee, turn.others)).spoken[fragment] = ()
        return displaced

    def rename(self, name: Callable[[str], str]) -> None:
        """Tell of people by other ids from now on. name: the new one of each."""
        for record in self._records.values():
            record.addressee, record.others = name(record.addressee), tuple(map(name, record.others))

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

        After an answer in words it is once these are known, if somebody tells them, but no later than a while. A pair
        that recognition has lost may be told of again once it is back.
        """
        pair = self._events.open_pair(turn)
        ended = self._records[turn].ended
        if pair is not None:
            return ended + (pair.limit or 0.0) + self._config.decision_patience
        pairs = self._events.pairs(turn)
        return max((ended, *map(self._words_due_at, pairs), *map(self._events.resumed_until, pairs)))

    def _words_due_at(self, pair: ConnectionEvent) -> Seconds:
        """Time until which the words of an answer are waited for; long ago: they are not."""
        if pair.is_answered_by_another:
            return float("-inf")
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
            if pair.is_answered_by_another:
                continue
            if pair.state == "completed" and pair.response == "speak" and not pair.words:
                self._heard.missed(pair.responder)
        return TurnClosed(
            turn=turn,
            addressee=record.addressee,
            others=record.others,
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
            interjections=self._interjections.of_turn(turn),
        )
