"""Talk of one to five people and the robot, known from beginning to end.

What each does has a beginning and an end. They are instants: the time, and the order in which what happens at one
time is observed. `Timeline.told` plays it to recognition; `coder.py` says what a coder of the whole makes of it.
"""

from collections.abc import Callable, Iterator

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action, TurnSignal
from engage_hri.schemas.perception import ActorLost
from engage_hri.schemas.recognition import SignalTurn
from engage_hri.schemas.world import World
from tests.recognition.heard_log import HeardLog
from tests.recognition.observations import PIECES, ROBOT, request_event, stamp, world

NAMES = ("ann", "bob", "cy", "dee", "eve")
CALLED = {"cy": "マリ", "dee": "Mary Ann"}
"""By what name people are called beside their ids."""
STRANGER = "zed"
SAID_BEFORE = -59.0, -58.0
"""What somebody says before all else, where words are told."""
LIMIT = 4.0
Instant = tuple[float, int]
"""A time, and a place in the order of what happens then."""
LISTENING = ("uh-huh", "yes, yes, okay", "genau")
OTHER = ("stop", "what about the red one", "nein warte")


class Span(Struct):
    """What somebody does. to: for whom it is; of a look, what it is at; "": nobody. words: "": none.

    known: when the words are told; None: never. told: for whom it is by perception; "": it does not say.
    """

    who: str
    action: Action
    since: Instant
    until: Instant
    to: str = ROBOT
    words: str = ""
    known: Instant | None = None
    told: str = ""
    heard: tuple[tuple[Instant, str], ...] = ()
    """Partial words, which change nothing."""
    is_alone: bool = False
    """True if nothing but the words tells of it; those of a typed line take no time."""

    @property
    def is_line(self) -> bool:
        return self.is_alone and self.since[0] == self.until[0]

    @property
    def seconds(self) -> float:
        return self.until[0] - self.since[0]


class Turn(Struct):
    """The robot's words to one person or several. kind: `asks` opens a pair with each, `replies` answers.

    speech: when it speaks; of a turn that asks `until` is its end, after the last word.
    """

    id: str
    kind: str
    to: tuple[str, ...]
    speech: list[tuple[Instant, Instant]]
    until: Instant
    is_aborted: bool = False

    @property
    def since(self) -> Instant:
        return self.speech[0][0]


class Absence(Struct):
    """Time in which somebody is not seen."""

    who: str
    since: Instant
    until: Instant


class Join(Struct):
    """Somebody is told of by another id until it becomes known who it is.

    is_known: the person is known by the own id, too, for as long. goes_on: the other id is told further on.
    changes: when the id changes; until then it is the own one. None: it does not.
    """

    who: str
    id: str
    at: Instant
    is_known: bool = False
    goes_on: bool = False
    changes: Instant | None = None


class Timeline(Struct):
    """All that happens. is_worded: recognizers tell words. tells: "": nobody tells to whom people speak."""

    people: tuple[str, ...]
    spans: list[Span] = field(default_factory=list)
    turns: list[Turn] = field(default_factory=list)
    away: list[Absence] = field(default_factory=list)
    is_worded: bool = False
    tells: str = ""
    joins: list[Join] = field(default_factory=list)
    is_first: bool = False
    """True if nobody has told words before the first of these."""
    unseen: frozenset[str] = frozenset()
    """People who are found, but stand in no world."""

    def id(self, person: str) -> str:
        """By which id recognition knows somebody from beginning to end: it decides between two at once."""
        named = (each.id for each in self.joins if each.who == person and not each.is_known and not each.changes)
        return next(named, person)

    def delay(self, seconds: float) -> None:
        """Let all happen later."""

        def later(at: Instant) -> Instant:
            return round(at[0] + seconds, 6), at[1]

        for one in self.spans:
            one.since, one.until, one.known = later(one.since), later(one.until), one.known and later(one.known)
            one.heard = tuple((later(at), text) for at, text in one.heard)
        for turn in self.turns:
            turn.speech = [(later(since), later(until)) for since, until in turn.speech]
            turn.until = later(turn.until)
        for each in self.away:
            each.since, each.until = later(each.since), later(each.until)

    def told(self) -> HeardLog:
        """All that recognition tells of it."""
        log = HeardLog(LIMIT)
        log.ids = {each.who: each.id for each in self.joins if each.changes is None}
        is_before = self.is_worded and not self.is_first
        log.owners = {each.id: each.who for each in self.joins}
        seen = [log.id(each) for each in self.people if each not in self.unseen]
        known = [each.who for each in self.joins if each.is_known]
        log.take(_room(*seen, *known, *((STRANGER,) if is_before else ())), -60.0)
        for one in self.unseen:
            log.found(one, -60.0)
        if is_before:
            self._has_spoken(log, [*seen, *known])
        for (at, _), _, step in sorted(self._steps(log), key=lambda each: each[:2]):
            log.until(at - 1e-6)
            step()
        log.until(10_000.0)
        return log

    def _has_spoken(self, log: HeardLog, people: list[str]) -> None:
        """Have somebody say something to the robot, and go: so it is known that words are told, and addressees."""
        to = frozenset((ROBOT,)) if self.tells else None
        steps: list[tuple[float, Callable[[float], None]]] = [
            (-60.0, lambda at: log.found(STRANGER, at)),
            (SAID_BEFORE[0], lambda at: log.begins(STRANGER, "speak", at)),
            (SAID_BEFORE[1], lambda at: log.ends(STRANGER, "speak", at)),
            (-57.9, lambda at: log.hears(STRANGER, *SAID_BEFORE, "so", at, to=to)),
            (-40.0, lambda at: log.take(_room(*people), at)),
            (-40.0, lambda at: log.take(ActorLost(actor=STRANGER, at=stamp(at), left=True), at)),
        ]  # fmt: skip
        for at, step in steps:
            log.until(at - 1e-6)
            step(at)
        log.until(0.0)
        log.told.clear()

    def _steps(self, log: HeardLog) -> Iterator[tuple[Instant, int, Callable[[], object]]]:
        for one in self.spans:
            yield from _of_span(log, one, self)
        for turn in self.turns:
            yield from _of_turn(log, turn)
        for each in self.away:
            yield each.since, 0, lambda each=each: log.lost(each.who, each.since[0])
            yield each.until, 0, lambda each=each: log.found(each.who, each.until[0])
        for join in self.joins:
            yield from _of_join(log, join)


def _of_join(log: HeardLog, join: Join) -> Iterator[tuple[Instant, int, Callable[[], object]]]:
    if (changes := join.changes) is not None:
        yield changes, 0, lambda: log.lost(join.who, changes[0])
        yield join.at, 0, lambda: log.ids.update({join.who: join.id})
    yield join.at, 1, lambda: log.join(join.who, join.at[0], goes_on=join.goes_on)


def _room(*people: str) -> World:
    """The world with these people and their names."""
    seen = world(*people)
    entities = (
        replace(each, name=CALLED.get(each.id, ""))
        for each in seen.entities
        if each.kind != "person" or each.id in people
    )
    return replace(seen, entities=tuple(entities))


def _of_span(log: HeardLog, one: Span, timeline: Timeline) -> Iterator[tuple[Instant, int, Callable[[], object]]]:
    target = one.to if one.action == "look" else PIECES[0] if one.action == "point" else ""
    since, until = one.since[0], one.until[0]
    if not one.is_alone:
        yield one.since, 1, lambda: log.begins(one.who, one.action, since, target)
        yield one.until, 0, lambda: log.ends(one.who, one.action, until, target)
    for at, text in one.heard:
        yield at, 3, lambda at=at, text=text: log.hears(one.who, since, at[0], text, at[0], final=False)
    if one.action == "speak" and (one.known is not None or one.told):
        known = one.known or one.until
        to = frozenset((one.told,)) if one.told else None
        if timeline.tells == "early" and one.told:
            yield one.since, 2, lambda: log.hears(one.who, since, until, "", since, to=to, final=False)
        if one.known is not None or timeline.tells == "late":
            yield known, 1, lambda: log.hears(one.who, since, until, one.words, known[0], to=to)


def _of_turn(log: HeardLog, turn: Turn) -> Iterator[tuple[Instant, int, Callable[[], object]]]:
    (at, _), (over, _) = turn.since, turn.until

    def signal(kind: str, when: float) -> None:
        to = log.id(turn.to[0]) if len(turn.to) == 1 else ""
        signaled = TurnSignal(id="e", turn=turn.id, signal=kind, actor=to)  # type: ignore[arg-type]
        log.take(SignalTurn(id=f"{turn.id}/{kind}", requester="realizer", signal=signaled, at=stamp(when),
                            block=turn.id), when)  # fmt: skip

    if turn.kind == "replies":
        yield turn.since, 0, lambda: signal("answered", at)
    else:
        kind = "adjacency_pair" if turn.kind == "asks" else "backchannel"
        name = turn.id if turn.kind == "asks" else ""
        for one in turn.to:
            yield (
                turn.since,
                0,
                lambda one=one: log.take(
                    request_event(
                        kind, at, request=f"{turn.id}/{one}", block=turn.id, turn=name, responder=log.id(one)
                    ),
                    at,
                ),
            )
    for since, until in turn.speech:
        yield since, 1, lambda since=since: log.begins(ROBOT, "speak", since[0], behavior=f"{turn.id}:s")
        yield until, 0, lambda until=until: log.ends(ROBOT, "speak", until[0], behavior=f"{turn.id}:s")
    if turn.kind == "asks":
        yield turn.until, 1, lambda: signal("aborted" if turn.is_aborted else "ended", over)
    yield turn.until, 2, lambda: log.block_ends(over, "interrupted" if turn.is_aborted else "done", turn.id)
