"""A person whose id changes is the same person: by the word of perception, or found where somebody was lost."""

import random
from collections.abc import Callable, Iterable

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action, TurnSignal
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    ANOTHER_ID,
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    OngoingActions,
)
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    EventOutcome,
    OpenEvents,
    SamePeople,
    SignalTurn,
    Statistics,
)
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Intake, Output
from engage_hri.services.recognition.perceive.identities import IDS_KEPT, Identities, Join
from engage_hri.services.reports.same_people import renamed
from engage_hri.services.runtime.intake import (
    AnswerRequest,
    Input,
    MachineClocks,
    PublishMessage,
    StepClock,
    WithdrawStates,
)
from tests.random_cases import share_of
from tests.recognition.heard_log import HeardLog
from tests.recognition.kept import kinds
from tests.recognition.observations import PIECES, ROBOT, request_event, stamp, world
from tests.simulation.party_play import Play

PLACES: dict[str, Vector] = {"ann": (1.2, 0.0, 1.2), "ben": (1.0, 0.8, 1.2), "cat": (1.0, -0.8, 1.2)}


def people_at(places: dict[str, Vector]) -> World:
    things = world(pieces=PIECES).objects
    people = (Entity(id=id, kind="person", position=place) for id, place in places.items())
    return World(entities=(*things, *people))


class Told:
    """Recognition, and what it tells."""

    def __init__(self) -> None:
        clock: MachineClocks = StepClock("loop")
        self.intake = Intake(ROBOT, RecognitionConfig(), clock, "session")
        self.outputs: list[Output] = []
        self.now = 0.0

    def take(self, at: float, *messages: Message, source: str = "camera") -> None:
        self.until(at)
        for message in messages:
            key = keys.PERCEIVED_ACTION
            match message:
                case World():
                    key = keys.WORLD
                case HeadPose(actor=actor):
                    key = keys.head_pose(actor)
                case ActionBegan(actor="robot") | ActionEnded(actor="robot"):
                    key = keys.ROBOT_ACTION
            self.outputs += self.intake.take(Input(key, message, source, at), at)

    def until(self, end: float) -> None:
        while (due := self.intake.deadline) is not None and due <= end:
            self.now = max(self.now, due)
            self.outputs += self.intake.advance(self.now)
        self.now = end

    def begins(self, actor: str, action: Action, at: float, *targets: str) -> None:
        self.take(at, ActionBegan(actor=actor, action=action, at=stamp(at), targets=targets))

    def ends(self, actor: str, action: Action, at: float, *targets: str) -> None:
        self.take(at, ActionEnded(actor=actor, action=action, at=stamp(at), targets=targets))

    def found(self, actor: str, at: float, same_as: str = "") -> None:
        self.take(at, ActorFound(actor=actor, at=stamp(at), same_as=same_as))

    def lost(self, actor: str, at: float) -> None:
        self.take(at, ActorLost(actor=actor, at=stamp(at)))

    def messages(self, kind: type) -> list[Message]:
        return [each.message for each in self.outputs if isinstance(each, PublishMessage)
                and isinstance(each.message, kind)]  # fmt: skip

    @property
    def events(self) -> list[ConnectionEvent]:
        return [each for each in self.messages(ConnectionEvent) if isinstance(each, ConnectionEvent)]

    def lives(self) -> list[tuple[str, str, str]]:
        """(state, initiator, responder) of each change that was told."""
        return [(each.state, each.initiator, each.responder) for each in self.events]

    def same(self) -> dict[str, str]:
        """The name of each person by each other id, as it was told last."""
        (*_, told) = (each for each in self.messages(SamePeople) if isinstance(each, SamePeople))
        return {each.actor: each.name for each in told.people}

    def counted(self, actor: str) -> int:
        self.until(self.now + 2.0)
        last = [each for each in self.messages(Statistics) if isinstance(each, Statistics) and each.actor == actor]
        return last[-1].session.events if last else 0


# -- the stories --------------------------------------------------------------------------------------------------


def test_an_open_event_goes_on_under_the_joined_id() -> None:
    told = Told()
    told.found("ann", 0.0)
    told.begins("ann", "look", 1.0, ROBOT)
    told.lost("ann", 1.3)
    told.found("face_3", 1.5, same_as="ann")
    told.take(2.0, ActionBegan(actor=ROBOT, action="look", at=stamp(2.0), targets=("ann",), behavior="b:look"))

    assert told.lives() == [("started", "ann", ROBOT), ("succeeded", "ann", ROBOT)]


def test_who_has_answered_by_another_id_has_answered() -> None:
    """A face without a name answers what the robot has asked Ann; that it is hers is known later."""
    log = HeardLog(4.0)
    log.take(people_at({"ann": PLACES["ann"], "face_3": PLACES["ben"]}), 0.0)
    for actor in ("ann", "face_3"):
        log.found(actor, 0.0)
    log.begins("face_3", "look", 0.5, ROBOT)
    log.take(request_event("adjacency_pair", 1.0, request="r", block="b", turn="t", responder="ann"), 1.0)
    log.begins(ROBOT, "speak", 1.0, behavior="b:s")
    log.ends(ROBOT, "speak", 2.0, behavior="b:s")
    signal = TurnSignal(id="e", turn="t", signal="ended", actor="ann")
    log.take(SignalTurn(id="t/ended", requester="realizer", signal=signal, at=stamp(2.0), block="b"), 2.0)
    log.begins("face_3", "speak", 2.5)
    log.ends("face_3", "speak", 3.2)
    log.until(5.0)
    log.take(ActorFound(actor="face_3", at=stamp(5.0), same_as="ann"), 5.0)
    log.until(6.0)

    pair = [each for each in log.events if each.kind == "adjacency_pair" and each.initiator == ROBOT]
    told = [(each.state, each.responder, each.answered_by, each.delay, each.retold) for each in pair]
    assert told == [
        ("started", "ann", "", None, False),
        ("preempted", "ann", "face_3", 0.5, False),
        ("completed", "ann", "", 0.5, True),
    ]


def test_who_is_named_late_is_told_of_again() -> None:
    told = Told()
    told.found("face_3", 0.0)
    told.begins("face_3", "look", 1.0, ROBOT)
    told.until(4.0)
    told.begins("face_3", "look", 5.0)
    told.begins("face_3", "look", 6.0, ROBOT)
    told.found("face_3", 6.5, same_as="ann")
    told.take(7.0, ActionBegan(actor=ROBOT, action="look", at=stamp(7.0), targets=("ann",), behavior="b:look"))

    assert [(each.id, each.state, each.initiator, each.retold) for each in told.events] == [
        ("session-mfg-1", "started", "face_3", False),
        ("session-mfg-1", "failed", "face_3", False),
        ("session-mfg-2", "started", "face_3", False),
        ("session-mfg-1", "failed", "ann", True),
        ("session-mfg-2", "started", "ann", True),
        ("session-mfg-2", "succeeded", "ann", False),
    ]
    assert told.counted("ann") == 2
    still_open = {each.actor: each.events for each in told.messages(OpenEvents) if isinstance(each, OpenEvents)}
    assert still_open["face_3"] == ()
    assert [each.initiator for each in still_open["ann"]] == ["ann"]
    withdrawn = [each.states for each in told.outputs if isinstance(each, WithdrawStates)]
    assert withdrawn == [(keys.open_events("face_3"), keys.statistics("face_3"))]


def test_who_had_gone_and_comes_back_as_another_is_counted_once() -> None:
    told = Told()
    told.found("ann", 0.0)
    told.begins("ann", "look", 1.0, ROBOT)
    told.lost("ann", 5.0)
    told.found("face_3", 20.0)
    told.begins("face_3", "look", 21.0, ROBOT)
    told.found("face_3", 22.0, same_as="ann")
    told.until(30.0)

    assert [(each.state, each.initiator, each.retold) for each in told.events] == [
        ("started", "ann", False), ("failed", "ann", False),
        ("started", "face_3", False), ("started", "ann", True), ("failed", "ann", False),
    ]  # fmt: skip
    assert told.counted("ann") == told.counted("") == 2


def test_of_two_with_open_events_who_was_known_first_goes_on() -> None:
    told = Told()
    told.found("ann", 0.0)
    told.until(1.0)
    asked = request_event("adjacency_pair", 1.0, responder="ann", turn="turn-1")
    told.outputs += told.intake.take(Input(keys.EVENT, asked, "realizer", 1.0), 1.0)
    told.begins(ROBOT, "speak", 1.0)
    told.ends(ROBOT, "speak", 2.0)
    ended = SignalTurn(
        id="e", requester="realizer", at=stamp(2.0), block="block-1",
        signal=TurnSignal(id="e", turn="turn-1", signal="ended", actor="ann"),
    )  # fmt: skip
    told.outputs += told.intake.take(Input(keys.TURN, ended, "realizer", 2.0), 2.0)
    told.found("face_3", 2.5)
    told.begins("face_3", "look", 2.6, ROBOT)
    told.found("face_3", 3.0, same_as="ann")
    told.begins("face_3", "speak", 3.5)

    states = [(each.kind, each.state, each.person(ROBOT)) for each in told.events if not each.retold]
    assert states == [
        ("adjacency_pair", "started", "ann"), ("mutual_facial_gaze", "started", "face_3"),
        ("mutual_facial_gaze", "lost", "ann"), ("adjacency_pair", "succeeded", "ann"),
    ]  # fmt: skip


def test_who_is_named_a_second_late_comes_once() -> None:
    told = Told()
    told.take(0.0, people_at({}))
    told.found("ann", 0.0)
    told.begins("ann", "look", 1.0, ROBOT)
    told.until(10.0)
    told.lost("ann", 10.0)
    told.found("face_3", 10.2)
    told.begins("face_3", "look", 10.3, ROBOT)
    told.until(11.2)
    told.found("face_3", 11.2, same_as="ann")
    told.until(20.0)

    levels = [
        each.level for each in told.messages(Statistics) if isinstance(each, Statistics) and each.actor == "ann"
    ]
    assert [each for each, before in zip(levels[1:], levels, strict=False) if each != before] == ["engaged"]


def test_the_robot_asks_who_it_has_been_told_of() -> None:
    """By either id: recognition knows the person by the first."""
    for responder in ("ann", "face_3"):
        told = Told()
        told.found("face_3", 0.0)
        told.found("face_3", 1.0, same_as="ann")
        asked = request_event("mutual_facial_gaze", 2.0, responder=responder)
        told.until(2.0)
        told.outputs += told.intake.take(Input(keys.EVENT, asked, "realizer", 2.0), 2.0)
        told.begins("face_3", "look", 2.5, ROBOT)
        told.take(2.6, ActionBegan(actor=ROBOT, action="look", at=stamp(2.6), targets=("ann",), behavior="b:look"))
        told.until(6.0)

        assert {(each.initiator, each.responder) for each in told.events} == {(ROBOT, "ann")}
        answers = [each.answer for each in told.outputs if isinstance(each, AnswerRequest)]
        assert [each.state for each in answers if isinstance(each, EventOutcome)] == ["succeeded"]


@pytest.mark.parametrize(
    ("place", "at", "same"),
    [((1.3, 0.1, 1.2), 2.0, True), ((1.6, 0.0, 1.2), 2.0, False), ((1.2, 0.0, 1.2), 3.6, False)],
)
@pytest.mark.parametrize("found_first", [True, False])
def test_who_is_found_where_somebody_was_lost_is_the_same(
    place: Vector, at: float, same: bool, found_first: bool
) -> None:
    told = Told()
    told.take(0.0, people_at(PLACES))
    told.found("ann", 0.0)
    told.begins("ann", "look", 1.0, ROBOT)
    told.lost("ann", 1.5)
    there = people_at({"ben": PLACES["ben"], "face_3": place})
    for step in (1, 2):
        if (step == 1) == found_first:
            told.found("face_3", at)
        else:
            told.take(at, there)
    told.take(
        at + 0.5, ActionBegan(actor=ROBOT, action="look", at=stamp(at + 0.5), targets=("face_3",), behavior="b:l")
    )
    told.until(10.0)

    assert ("succeeded", "ann", ROBOT) in told.lives() or not (same and at < 2.5)
    told.begins("face_3", "look", 11.0)
    told.begins("face_3", "look", 12.0, "ben")
    told.begins("face_3", "point", 12.0, "blue-square")
    assert {each.initiator for each in told.events if each.started.seconds > 11.0} == {"ann" if same else "face_3"}


def test_of_two_that_were_lost_there_nobody_knows_which_it_is() -> None:
    told = Told()
    told.take(0.0, people_at({"ann": (1.2, 0.0, 1.2), "ben": (1.2, 0.2, 1.2)}))
    told.take(1.0, people_at({}))
    told.take(1.5, people_at({"face_3": (1.2, 0.1, 1.2)}))
    told.begins("face_3", "look", 2.0, ROBOT)

    assert told.lives() == [("started", "face_3", ROBOT)]


def test_two_heads_side_by_side_are_two_people() -> None:
    """Heads that are seen in turn: the second is taken for the first until that is seen again."""
    told = Told()
    for number in range(100):
        at = 0.03 * number
        told.take(at, pose("ann", at, 0.0))
        if number > 30:
            told.take(at + 0.01, pose("face_3", at + 0.01, 0.25))
    told.begins("face_3", "nod", 4.0)
    told.begins("face_3", "look", 4.5, ROBOT)

    assert [each.initiator for each in told.events if each.started.seconds > 4.0] == ["face_3"]


def pose(actor: str, at: float, y: float) -> HeadPose:
    return HeadPose(actor=actor, position=(1.2, y, 1.2), direction=(0.0, 1.0, 0.0), at=stamp(at))


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("correction", ["bob", "face_3"])
def test_a_later_word_corrects_an_earlier_one(is_open: bool, correction: str) -> None:
    """is_open: recognition knows ann by the other id meanwhile, for an event with that is open."""
    told = Told()
    for who in ("ann", "bob", "face_3"):
        told.take(0.0, ActorFound(actor=who, at=stamp(0.0)), source=who)
    told.take(0.5, ActionBegan(actor="ann", action="look", at=stamp(0.5), targets=(ROBOT,)), source="ann")
    told.until(4.0)  # the event of this look has failed, and the look goes on
    if is_open:
        told.take(4.1, ActionBegan(actor="face_3", action="look", at=stamp(4.1), targets=(ROBOT,)), source="face_3")
    told.take(4.5, ActorFound(actor="face_3", at=stamp(4.5), same_as="ann"), source="face_3")
    assert told.same() == {"face_3": "ann"}
    told.take(4.6, ActorFound(actor="face_3", at=stamp(4.6), same_as=correction), source="face_3")

    assert told.same() == ({"face_3": "bob"} if correction == "bob" else {})
    session, inside = told.intake._recognizer.session, told.intake._identities.inside
    assert session.scene.present == {"ann", inside("face_3"), inside("bob")}
    assert session.persons["ann"].contact == 1.0, "ann looks, as was told before"
    assert session.persons[inside("face_3")].contact == (1.0 if is_open else None)
    assert [(each.initiator, each.state) for each in told.events][-1] == (
        (correction, "started") if is_open else ("ann", "failed")
    )

    told.take(7.0, ActionBegan(actor="face_3", action="look", at=stamp(7.0)), source="face_3")
    told.take(8.0, ActionBegan(actor="face_3", action="look", at=stamp(8.0), targets=(ROBOT,)), source="face_3")
    assert told.events[-1].initiator == correction
    told.take(9.0, ActorLost(actor="ann", at=stamp(9.0)), source="ann")
    told.until(15.0)
    assert "ann" not in session.scene.present


def test_who_was_joined_by_an_id_goes_with_it() -> None:
    told = Told()
    told.found("face_3", 0.0, same_as="ann")
    told.found("face_4", 0.1, same_as="face_3")
    told.found("face_5", 0.2, same_as="ann")
    told.found("face_3", 0.3, same_as="bob")
    assert told.same() == {"face_3": "bob", "face_4": "bob", "face_5": "ann"}
    told.found("face_4", 0.4, same_as="face_4")
    assert told.same() == {"face_3": "bob", "face_5": "ann"}
    told.found("ann", 0.5, same_as="face_5")
    assert told.same() == {"face_3": "bob", "ann": "face_5"}
    told.found("ann", 0.6, same_as="ann")
    assert told.same() == {"face_3": "bob"}


@pytest.mark.parametrize("thing", [ROBOT, PIECES[0], "nowhere"])
def test_nobody_is_a_thing(thing: str) -> None:
    told = Told()
    told.take(0.0, people_at(PLACES))
    told.found("face_3", 0.0, same_as=thing)
    told.found("face_3", 0.1, same_as=thing)

    faults = [each for each in told.messages(Fault) if isinstance(each, Fault)]
    assert [each.advice for each in faults] == ([] if thing == "nowhere" else [ANOTHER_ID])
    told.begins("face_3", "look", 1.0, ROBOT)
    assert told.lives() == [("started", "nowhere" if thing == "nowhere" else "face_3", ROBOT)]


@pytest.mark.parametrize("why", ["left", "its place is nobody's", "the other's is", "neither"])
def test_no_guess_by_a_place_that_nobody_measured_or_of_who_is_known_to_have_left(why: str) -> None:
    def there(who: str, *, placeless: bool) -> World:
        seen = people_at({who: PLACES["ann"]})
        return World(
            entities=tuple(replace(one, placeless=placeless and one.kind == "person") for one in seen.entities)
        )

    told = Told()
    told.found("ann", 0.0)
    told.take(0.0, there("ann", placeless=why == "the other's is"))
    told.take(1.0, people_at({}), ActorLost(actor="ann", at=stamp(1.0), left=why == "left"))
    told.take(2.0, there("ben", placeless=why == "its place is nobody's"))
    told.found("ben", 2.0)
    told.begins("ben", "look", 2.5, ROBOT)

    assert [each.initiator for each in told.events] == ["ann" if why == "neither" else "ben"]


def test_nobody_is_the_robot_or_has_an_id_that_cannot_be_in_a_key() -> None:
    told = Told()
    told.found("face_3", 0.0, same_as=ROBOT)
    told.found("face_3", 0.0, same_as="a/b")
    told.begins("face_3", "look", 1.0, ROBOT)

    assert told.lives() == [("started", "face_3", ROBOT)]


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("evidence", ["both in the world", "both found", "heads in turn", "somebody else"])
def test_a_guess_ends_when_something_contradicts_it(is_open: bool, evidence: str) -> None:
    """is_open: an event of the newer id is open by then."""
    told = Told()
    told.found("ann", 0.0)
    told.take(0.0, people_at({"ann": PLACES["ann"]}))
    told.lost("ann", 1.0)
    told.take(1.1, people_at({}))
    if is_open:
        told.begins("face_3", "look", 1.2, ROBOT)
    told.take(1.3, people_at({"face_3": PLACES["ann"]}))
    told.begins("face_3", "point", 1.4, "blue-square")
    assert told.same() == {"face_3": "ann"}

    match evidence:
        case "both in the world":
            told.take(2.0, people_at({"face_3": PLACES["ann"], "ann": PLACES["ben"]}))
        case "both found":
            told.found("ann", 2.0)
        case "heads in turn":
            told.take(2.0, pose("ann", 2.0, 0.8))
        case "somebody else":
            told.found("face_3", 2.0, same_as="bob")
    own = "bob" if evidence == "somebody else" else "face_3"
    assert told.same() == ({"face_3": "bob"} if evidence == "somebody else" else {})
    told.begins("face_3", "look", 6.0)
    told.begins("face_3", "look", 7.0, ROBOT)
    told.begins("ann", "look", 8.0, ROBOT)

    assert [each.initiator for each in told.events if each.started.seconds >= 7.0] == [own, "ann"]


def test_what_is_open_with_the_newer_id_is_told_again_when_the_guess_ends() -> None:
    told = Told()
    told.found("ann", 0.0)
    told.take(0.0, people_at({"ann": PLACES["ann"]}))
    told.lost("ann", 1.0)
    told.take(1.1, people_at({}))
    told.begins("face_3", "look", 1.2, ROBOT)
    told.take(1.3, people_at({"face_3": PLACES["ann"]}))
    told.take(2.0, people_at({"face_3": PLACES["ann"], "ann": PLACES["ben"]}))
    told.take(2.5, ActionBegan(actor=ROBOT, action="look", at=stamp(2.5), targets=("face_3",), behavior="b:look"))

    assert [(each.state, each.initiator, each.retold) for each in told.events] == [
        ("started", "face_3", False), ("started", "ann", True), ("started", "face_3", True),
        ("succeeded", "face_3", False),
    ]  # fmt: skip
    still_open = {each.actor: len(each.events) for each in told.messages(OpenEvents) if isinstance(each, OpenEvents)}
    assert still_open == {"ann": 0, "face_3": 1}


@pytest.mark.parametrize("by", ["word", "place"])
def test_a_next_life_knows_who_is_the_same(by: str) -> None:
    told = Told()
    told.take(0.0, people_at({"ann": PLACES["ann"]}))
    told.begins("ann", "look", 0.5, ROBOT)
    if by == "word":
        told.found("face_3", 1.0, same_as="ann")
    else:
        told.take(1.1, people_at({}))
        told.take(1.3, people_at({"face_3": PLACES["ann"]}))
    told.until(700.0)  # the names have not changed for long, but that life has told something of late
    told.begins("ann", "look", 699.0)
    told.begins("ann", "look", 700.0, ROBOT)
    told.until(703.0)
    states = [each for kind in (Statistics, SamePeople) for each in told.messages(kind)[-1:]]

    reborn = Told()
    reborn.now = 705.0
    for state in states:
        reborn.outputs += reborn.intake.take(Input("", state, "", 705.0), 705.0)
    reborn.outputs += reborn.intake.begin(705.0)
    assert reborn.same() == {"face_3": "ann"}
    reborn.begins("face_3", "look", 706.0, ROBOT)
    assert reborn.lives() == [("started", "ann", ROBOT)]
    if by == "place":
        reborn.take(707.0, people_at({"face_3": PLACES["ann"], "ann": PLACES["ben"]}))
        reborn.take(707.1, people_at({"face_3": PLACES["ann"], "ann": PLACES["ben"]}))
        assert reborn.same() == {}


# -- at random ----------------------------------------------------------------------------------------------------


class Renamed(Play):
    """A play in which perception gives a person other ids now and then.

    join: what it tells then, of the id before, the next one and the world. It is told in any case that the person
    is lost and found, so that nothing but the ids differs.
    """

    def __init__(
        self, people: int, seed: int, changes: Iterable[float], join: Callable[[str, str], list[Message]] | None
    ) -> None:
        self._id = self._who = "ann"
        self._changes = [*changes]
        self._join = join
        super().__init__(people, seed)
        self._who = self._id = self.party.people[0]

    def _perceive(self, *told: Message) -> None:
        if self._changes and self._changes[0] <= self.now:
            self._changes.pop(0)
            super()._perceive(ActorLost(actor=self._who, at=stamp(self.now)))
            if self._join is not None:
                before, self._id = self._id, f"face_{len(self._changes)}"
                for message in self._join(before, self._id):
                    self._take(keys.WORLD if isinstance(message, World) else keys.PERCEIVED_ACTION, message)
            super()._perceive(ActorFound(actor=self._who, at=stamp(self.now)))
        super()._perceive(*told)

    def _take(self, key: str, message: Message) -> None:
        if not isinstance(message, World) and self._id != self._who:
            message = renamed(message, lambda id: self._id if id == self._who else id)
            if isinstance(message, OngoingActions) and "perception" in key:
                key = keys.perceived_ongoing(keys.reporter_of(key), message.actor)
        super()._take(key, message)


def last(play: Play) -> dict[str, ConnectionEvent]:
    return {each.id: each for each in play.events}


@pytest.mark.parametrize("seed", range(share_of(10)))
@pytest.mark.parametrize("people", [1, 3])
@pytest.mark.parametrize("by", ["word", "place"])
def test_a_person_whose_id_changes_has_the_events_of_one_whose_id_does_not(people: int, seed: int, by: str) -> None:
    chance = random.Random(seed)
    changes = sorted(chance.uniform(1.0, 170.0) for _ in range(12))
    places = {id: (1.2, 0.8 * number, 1.2) for number, id in enumerate(Play(people, seed).party.people)}

    def word(before: str, now: str) -> list[Message]:
        return [ActorFound(actor=now, at=stamp(play.now), same_as=chance.choice((before, play.party.people[0])))]

    def place(before: str, now: str) -> list[Message]:
        first, *others = play.party.people
        there = {each: places[each] for each in others}
        x, y, z = places[first]
        return [people_at(there | {before: (x, y, z)}), ActorLost(actor=before, at=stamp(play.now)),
                people_at(there | {now: (x + chance.uniform(-0.1, 0.1), y, z)})]  # fmt: skip

    play = Renamed(people, seed, changes, word if by == "word" else place)
    same = Renamed(people, seed, changes, None)
    play.until(180.0)
    same.until(180.0)

    assert len(same.events) > 20
    assert play.events == same.events


@pytest.mark.parametrize("seed", range(share_of(10)))
def test_the_last_word_on_who_was_named_late_is_that_of_who_was_known_at_once(seed: int) -> None:
    play, same = Renamed(3, seed, (0.0,), lambda before, now: []), Renamed(3, seed, (0.0,), None)
    for each in (play, same):
        each.until(40.0)
    named = ActorFound(actor=play.party.people[0], at=stamp(play.now), same_as=play.party.people[0])
    play._take(keys.PERCEIVED_ACTION, replace(named, same_as=same.party.people[0]))
    for each in (play, same):
        each.until(80.0)

    assert {id: replace(each, retold=False, at=stamp(0.0)) for id, each in last(play).items()} == {
        id: replace(each, retold=False, at=stamp(0.0)) for id, each in last(same).items()
    }


def test_memory_stays_flat_however_often_an_id_changes() -> None:
    identities, sizes = Identities(ROBOT), []
    for number in range(4 * IDS_KEPT):
        found = ActorFound(actor=f"face_{number}", at=stamp(number), same_as="ann")
        for join in identities.take(found, float(number)):
            assert isinstance(join, Join)
            identities.join(join.former, join.newer)
        sizes.append(sum(kinds(identities).values()))

    assert max(sizes) <= 1.1 * sizes[2 * IDS_KEPT]
    assert identities.inside(f"face_{4 * IDS_KEPT - 1}") == "ann"
    identities.forget("ann")
    assert identities.inside(f"face_{4 * IDS_KEPT - 1}") == f"face_{4 * IDS_KEPT - 1}"
