"""Recognition as its subscribers hear it: messages of perception and of the robot in, what is published out."""

from collections.abc import Iterator
from math import inf
from typing import TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, FloorSpeech, Interjection, RequestEvent, SignalTurn
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Intake, Output
from engage_hri.services.runtime.intake import Input, PublishMessage, StepClock
from tests.recognition.observations import ROBOT, stamp

KEYS: dict[type, str] = {
    World: keys.WORLD, Utterance: keys.UTTERANCE, RequestEvent: keys.EVENT, SignalTurn: keys.TURN,
    BlockProgress: keys.FEEDBACK,
}  # fmt: skip
"""Keys of what is no action."""
REMEMBERED = 64
"""Latest events that are told again when an id turns out to be another's."""
Told = TypeVar("Told", bound=Message)


class HeardLog:
    """Recognition of one robot, and all that it has told. Each call is one message."""

    def __init__(self, limit: float) -> None:
        config = RecognitionConfig(adjacency_pair_limit=limit)
        self._intake = Intake(ROBOT, config, StepClock("loop"), "session")
        self.told: list[Message] = []
        """All that was published."""
        self.ids: dict[str, str] = {}
        """The ids by which people are told of who are not told of by their own."""
        self.owners: dict[str, str] = {}
        """Whose each other id is."""
        self.joined: dict[str, int] = {}
        """Number of messages that had been published when an id was joined with the person's own, by this id."""
        self._numbers: dict[tuple[str, float], str] = {}
        self._now = -inf

    def until(self, end: float) -> None:
        """Let all happen that is due before `end`."""
        while (due := self._intake.deadline) is not None and due < end:
            self._now = max(self._now, due)  # what has waited may have been due before
            self._note(self._intake.advance(self._now))

    def take(self, message: Message, at: float) -> None:
        """Take a message that arrives at `at`."""
        actor = getattr(message, "actor", ROBOT)
        key = KEYS.get(type(message)) or (keys.ROBOT_ACTION if actor == ROBOT else keys.PERCEIVED_ACTION)
        source, self._now = "body" if actor == ROBOT else "camera", at
        self._note(self._intake.take(Input(key, message, source, at), at))

    def _note(self, outputs: list[Output]) -> None:
        self.told += [each.message for each in outputs if isinstance(each, PublishMessage)]

    def _of(self, kind: type[Told]) -> list[Told]:
        return [each for each in self.told if isinstance(each, kind)]

    @property
    def events(self) -> list[ConnectionEvent]:
        own = self._own
        return [
            replace(
                each, initiator=own(each.initiator), responder=own(each.responder), answered_by=own(each.answered_by)
            )
            for each in self._of(ConnectionEvent)
        ]

    @property
    def interjections(self) -> list[Interjection]:
        return [replace(each, actor=self._own(each.actor)) for each in self._of(Interjection)]

    @property
    def floors(self) -> list[Floor]:
        return [
            replace(each, speeches=self._owned(each.speeches), ended=self._owned(each.ended))
            for each in self._of(Floor)
        ]

    def _own(self, id: str) -> str:
        """The own id of a person who may be told of by another."""
        return self.owners.get(id, id)

    def _owned(self, speeches: tuple[FloorSpeech, ...]) -> tuple[FloorSpeech, ...]:
        return tuple(
            replace(each, actor=self._own(each.actor), to=tuple(sorted({*map(self._own, each.to)})))
            for each in speeches
        )

    def misnamed(self) -> Iterator[str]:
        """What is told by another id than the person's own, although it is known that they are one."""
        last: dict[str, ConnectionEvent] = {}
        remembered: dict[str, set[str]] = {}
        for number, each in enumerate(self.told):
            joined = {id for id, since in self.joined.items() if since <= number}
            for id in joined - remembered.keys():
                remembered[id] = {*list(last)[-REMEMBERED:]}
            match each:
                case ConnectionEvent(initiator=initiator, responder=responder, answered_by=by):
                    last.pop(each.id, None)  # the latest are those that were told last
                    named, last[each.id] = {initiator, responder, by}, each
                case Interjection(actor=actor):
                    named = {actor}
                case Floor(speeches=speeches, ended=ended):
                    named = {name for one in (*speeches, *ended) for name in (one.actor, *one.to)}
                case _:
                    continue
            if named & joined:
                yield f"told by the other id: {each}"
        for each in last.values():
            named = {each.initiator, each.responder, each.answered_by}
            if any(id in named and each.id in events for id, events in remembered.items()):
                yield f"not told again by the own id: {each}"

    def id(self, person: str) -> str:
        """By which id a person is told of now; of who else it is given: the same."""
        return self.ids.get(person, person)

    def join(self, person: str, at: float, *, goes_on: bool) -> None:
        """Tell that the id of a person is another of theirs. goes_on: it is the one that is told further on."""
        id = self.ids[person]
        self.joined[id] = len(self.told)
        self.take(ActorFound(actor=id, at=stamp(at), same_as=person), at)
        if not goes_on:
            del self.ids[person]

    # -- what happens -------------------------------------------------------------------------------------------

    def begins(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> None:
        targets = (self.id(target),) if target else ()
        self.take(
            ActionBegan(actor=self.id(actor), action=action, at=stamp(at), targets=targets, behavior=behavior), at
        )

    def ends(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> None:
        targets = (self.id(target),) if target else ()
        self.take(
            ActionEnded(actor=self.id(actor), action=action, at=stamp(at), targets=targets, behavior=behavior), at
        )

    def found(self, actor: str, at: float, same_as: str = "") -> None:
        self.take(ActorFound(actor=self.id(actor), at=stamp(at), same_as=same_as), at)

    def lost(self, actor: str, at: float) -> None:
        self.take(ActorLost(actor=self.id(actor), at=stamp(at)), at)

    def block_ends(self, at: float, status: str, block: str) -> None:
        self.take(BlockProgress(block=block, progress="end", at=stamp(at), status=status), at)  # type: ignore[arg-type]

    def hears(
        self, actor: str, since: float, until: float, text: str, at: float, *, to: frozenset[str] | None = None,
        final: bool = True,
    ) -> None:  # fmt: skip
        """Words of what was said from `since` to `until`. to: for whom, if perception knows."""
        id = self._numbers.setdefault((actor, since), f"{actor}-{len(self._numbers)}")
        said = Utterance(
            actor=self.id(actor), id=id, text=text, began=stamp(since), ended=stamp(until), at=stamp(at), final=final,
            to=tuple(sorted(map(self.id, to or ()))),
        )  # fmt: skip
        self.take(said, at)
