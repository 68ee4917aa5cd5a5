"""The model of the window: messages in, sections out, without a browser and without a bus."""

import json
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.blocks import (
    BlockProgress,
    Fired,
    NetMarked,
    NetPlace,
    NetPlanned,
    NetPoint,
    NetTransition,
    NetWaiting,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
)
from engage_hri.schemas.body import BodyPose, Capabilities, JointAngle, Ray, RobotState
from engage_hri.schemas.body_faults import BodyFault, BodyFaults
from engage_hri.schemas.fragments import Claim, FragmentOutcome, HeadOwner, PairConsidered, ReferenceChoice
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import BusHealth, PeerAlive, PeerGone, Status
from engage_hri.schemas.perception import ActionBegan, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import (
    Floor,
    FloorSpeech,
    Interjection,
    InterjectionReading,
    Statistics,
    WindowStatistics,
)
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console import view
from engage_hri.services.console.web.lanes import KEPT
from engage_hri.services.console.web.picture import BLOCK, MEASURES, NET, Picture
from tests.console.scenes import SCENE, Timed, at, event

BEGAN = 10.0


def picture(*messages: Timed) -> Picture:
    made = Picture("robot", BEGAN)
    for message, time in messages:
        made.feed(message, time, time)
    return made


def section(made: Picture, name: str) -> Any:
    return json.loads(made.section(name))


def net(block: str, **fields: Any) -> NetPlanned:
    """A net in which a look and speech end at one instant."""
    values: dict[str, Any] = {
        "transitions": (
            NetTransition(points=(NetPoint(sync="start"),)),
            NetTransition(points=(NetPoint(behavior="look", sync="start"),)),
            NetTransition(
                points=(NetPoint(behavior="look", sync="stroke"), NetPoint(behavior="s", sync="start")), time=0.4
            ),
            NetTransition(points=(NetPoint(behavior="s", sync="end"),), time=1.4),
            NetTransition(points=(NetPoint(sync="end"),), time=1.4),
        ),
        "places": (
            NetPlace(kind="order", source=0, target=1, behavior="look"),
            NetPlace(kind="phase", source=1, target=2, behavior="look"),
            NetPlace(kind="phase", source=2, target=3, behavior="s"),
            NetPlace(kind="order", source=3, target=4, behavior="s"),
            NetPlace(kind="delay", source=1, target=3, lag=0.2),
        ),
        "marked": (0,),
        **fields,
    }  # fmt: skip
    return NetPlanned(block=block, at=at(BEGAN), **values)


# -- the scene -----------------------------------------------------------------------------------------------------


def test_the_scene_has_outlines_where_things_lie_and_people_who_do_something() -> None:
    square = Entity(
        id="blue", kind="object", position=(1.0, 2.0, 0.7), yaw=1.5707963, footprint=((0.1, 0.0), (0.0, 0.1)),
        color="blue", shape="square",
    )  # fmt: skip
    person = Entity(id="ann", kind="person", position=(1.3, 0.0, 1.2))
    made = picture(
        (World(entities=(square, person)), 10.0),
        (ActionBegan(actor="ann", action="look", targets=("blue",), at=at(10.1)), 10.1),
        (ActionBegan(actor="ann", action="speak", at=at(10.2)), 10.2),
    )

    scene = section(made, "scene")

    (thing,), (ann,) = scene["things"], scene["people"]
    assert thing["outline"] == [[1.0, 2.1], [0.9, 2.0]]  # turned by a quarter
    assert thing["label"] == "blue square"
    assert (ann["looks"], ann["speaks"], ann["at"]) == (["blue"], True, [1.3, 0.0, 1.2])


def test_the_body_is_drawn_from_its_rays_and_its_own_cone() -> None:
    state = RobotState(
        at=at(10.0), pose=BodyPose(joints=(JointAngle("jaw", 0.5),)),
        gaze=Ray(origin=(0.05, 0.0, 1.17), axis=(1.0, 0.0, 0.0), error=0.05),
        left_arm=Ray(origin=(0.0, 0.2, 0.8), axis=(1.0, 0.0, 0.0), tip=(0.25, 0.2, 0.8)), looking_at="blue",
    )  # fmt: skip
    body = Capabilities(body="torso", types=(), parts=(), gaze_half_angle=0.15)
    pointing = ActionBegan(actor="robot", action="point", targets=("blue",), at=at(10.0))
    made = picture((state, 10.0), (body, 10.0), (pointing, 10.0))

    shown = section(made, "scene")["body"]

    assert shown["spread"] == 0.2
    assert shown["arms"] == [{"side": "left", "elbow": [0.0, 0.2, 0.8], "hand": [0.25, 0.2, 0.8]}]
    assert (shown["looks_at"], shown["points"], shown["joints"]) == ("blue", ["blue"], {"jaw": 0.5})


def test_who_left_is_not_shown_any_more_unless_the_world_still_has_them() -> None:
    visits = [
        (kind(actor=f"visitor-{number}", at=at(number)), float(number))
        for number in range(50)
        for kind in (ActorFound, ActorLost)
    ]
    ann = Entity(id="visitor-49", kind="person", position=(1.3, 0.0, 1.2))
    made = picture(*visits)

    assert section(made, "scene")["people"] == []
    assert len(made._scene.actors) == view.LOST_KEPT

    made.feed(World(entities=(ann,)), 50.0, 50.0)
    assert [(each["id"], each["present"]) for each in section(made, "scene")["people"]] == [("visitor-49", False)]

    made.feed(ActorFound(actor="visitor-49", at=at(51.0)), 51.0, 51.0)
    assert section(made, "scene")["people"][0]["present"] is True


# -- words, head, events ---------------------------------------------------------------------------------------------


def test_words_come_as_they_are_said_with_those_of_people_at_their_speech() -> None:
    heard = Utterance(actor="human", id="u", text="yes, that", began=at(13.0), at=at(13.6), final=False)
    typed = Utterance(actor="bob", id="v", text="hello", began=at(14.0), at=at(14.0))
    speech = (ActionBegan(actor="human", action="speak", at=at(13.1)), 13.1)
    made = picture(*SCENE, speech, (heard, 13.6), (typed, 14.0))

    said = section(made, "words")

    assert [(each["actor"], each["words"]) for each in said] == [
        ("robot", "a rectangle"), ("human", "yes, that"), ("bob", "hello"),
    ]  # fmt: skip
    assert said[1]["open"] is True


def test_the_owner_of_the_head_has_its_reason_and_those_who_wait_have_theirs() -> None:
    owner = Claim(kind="fragment", priority=2, target="blue", reason="ref-2")
    waits = Claim(kind="face", priority=6, target="ann", reason="spoken with last")
    made = picture((HeadOwner(owner=owner, since=at(12.5), waiting=(waits,)), 12.5))

    head = section(made, "head")

    assert (head["since"], head["owner"]["reason"]) == (2.5, "ref-2")
    assert (head["owner"]["does"], head["owner"]["why"]) == ("look at blue", "this belongs to what it is saying")
    assert [(each["target"], each["why"]) for each in head["waiting"]] == [("ann", "it spoke with this person last")]


def test_speeches_overlap_and_say_for_whom_they_are_and_what_those_into_the_turn_were_taken_for() -> None:
    robot = FloorSpeech(actor="robot", since=at(11.0), to=("ann",))
    ann, ben = FloorSpeech(actor="ann", since=at(12.0)), FloorSpeech(actor="ben", since=at(12.5))

    over = replace(ann, to=("robot",), until=at(12.7))

    def taken(reading: InterjectionReading, time: Seconds, words: str = "") -> Timed:
        return Interjection(actor="ann", since=at(12.0), at=at(time), reading=reading, words=words), time

    made = picture(
        (Floor(at=at(11.0), speeches=(robot,)), 11.0),
        (Floor(at=at(12.1), speeches=(robot, ann)), 12.1),
        taken("open", 12.2),
        (Floor(at=at(12.6), speeches=(robot, ann, ben)), 12.6),
        (Floor(at=at(12.8), speeches=(robot, ben)), 12.8),
        taken("backchannel", 13.0, "uh-huh"),
        (Floor(at=at(13.5), speeches=(replace(ben, to=("ann",)),)), 13.5),
        (Floor(at=at(13.6), speeches=(replace(ben, to=("ann",)),), ended=(over,)), 13.6),
    )

    assert section(made, "floor") == [
        shown("robot", 1.0, 3.5, to=["ann"]),
        shown("ann", 2.0, 2.7, to=["robot"], taken="as a listener", words="uh-huh"),
        shown("ben", 2.5, None, to=["ann"]),
    ]
    made.feed(PeerGone(participant="recognition"), 15.0, 15.0)
    assert [each["until"] for each in section(made, "floor")] == [3.5, 2.7, 5.0]


def shown(actor: str, since: float, until: float | None, **fields: object) -> dict[str, object]:
    return {"actor": actor, "to": [], "since": since, "until": until, "taken": "", "words": "", **fields}


def test_a_typed_line_into_the_turn_is_shown_where_it_was_said_and_old_speeches_go() -> None:
    typed = Interjection(actor="ann", since=at(12.0), at=at(12.0), reading="interruption", words="stop")
    made = picture((typed, 12.0))
    assert section(made, "floor") == [shown("ann", 2.0, 2.0, taken="takes the floor", words="stop")]

    made.feed(Floor(at=at(12.0 + KEPT + 1.0)), 12.0 + KEPT + 1.0, 12.0 + KEPT + 1.0)
    assert section(made, "floor") == []


def test_an_event_keeps_its_decision_when_its_shared_phase_is_over() -> None:
    made = picture(
        event("e", "started", 11.0),
        event("e", "succeeded", 11.9, delay=0.9),
        event("e", "completed", 13.0, delay=0.9),
    )

    (shown,) = section(made, "events")

    assert (shown["state"], shown["delay"]) == ("succeeded", 0.9)
    assert (shown["since"], shown["decided"], shown["until"]) == (1.0, 1.9, 3.0)


def test_events_that_ended_long_ago_are_forgotten_and_open_ones_are_not() -> None:
    made = picture(event("old", "failed", 11.0), event("open", "started", 11.0), event("new", "started", 12.0 + KEPT))

    assert [each["id"] for each in section(made, "events")] == ["open", "new"]


# -- behaviors and nets ----------------------------------------------------------------------------------------------

RUN: tuple[Timed, ...] = (
    (BlockProgress(block="b", progress="start", at=at(20.0)), 20.0),
    (
        PredictionFeedback(
            block="b", at=at(20.0),
            points=(
                PlannedPoint(behavior="s", sync="start", time=0.5, type="speech"),
                PlannedPoint(behavior="s", sync="end", time=2.0, type="speech"),
            ),
        ),
        20.0,
    ),
    (PredictionFeedback(block="b", at=at(20.0), points=(PlannedPoint(behavior="s", sync="start", time=0.7),)), 20.0),
    (SyncPointProgress(block="b", behavior="s", sync="start", at=at(20.9), time=0.9, predicted=0.7), 20.9),
    (PredictionFeedback(block="b", at=at(20.0), points=(PlannedPoint(behavior="s", sync="start", time=9.0),)), 20.0),
)  # fmt: skip


def test_a_behavior_shows_what_was_planned_first_and_last_and_what_was_measured() -> None:
    made = picture(*RUN)

    lane = section(made, f"{BLOCK}b")

    (speech,) = lane["behaviors"]
    assert (lane["since"], lane["until"], speech["type"]) == (10.0, None, "speech")
    assert speech["points"] == [
        {"sync": "start", "first": 10.5, "planned": 10.7, "measured": 10.9},
        {"sync": "end", "first": 12.0, "planned": 12.0, "measured": None},
    ]


def test_a_block_of_a_known_name_begins_anew_and_one_that_is_long_over_goes() -> None:
    end: Timed = (BlockProgress(block="b", progress="end", status="done", at=at(23.0), time=3.0), 23.0)
    made = picture(*RUN, end, (BlockProgress(block="b", progress="start", at=at(30.0)), 30.0))
    assert section(made, f"{BLOCK}b")["behaviors"] == []

    made.feed(BlockProgress(block="b", progress="end", status="done", at=at(31.0), time=1.0), 31.0, 31.0)
    made.advance(31.0 + KEPT + 1)
    assert f"{BLOCK}b" not in made.versions


def test_instants_of_several_behaviors_are_sync_lines() -> None:
    made = picture(*RUN, (net("b"), BEGAN + 10))

    assert section(made, f"{BLOCK}b")["ties"] == [[["look", "stroke"], ["s", "start"]]]


def test_a_net_is_laid_out_in_columns_by_time_and_rows_by_behavior() -> None:
    made = picture((net("b"), BEGAN))

    shown = section(made, f"{NET}b")

    assert [row["name"] for row in shown["rows"]] == ["bml", "look", "s", "delay 0.2 s"]
    assert [instant["column"] for instant in shown["instants"]] == [0, 1, 2, 3, 4]
    assert shown["instants"][2]["rows"] == [1, 2]
    assert [(place["row"], place["source"], place["target"]) for place in shown["places"]] == [
        (1, 0, 1), (1, 1, 2), (2, 2, 3), (2, 3, 4), (3, 1, 3),
    ]  # fmt: skip
    assert shown["places"][1]["words"] == "look from start to stroke"


def test_tokens_move_and_the_layout_stays_as_it_is() -> None:
    made = picture((net("b"), BEGAN))
    laid_out = made.versions[f"{NET}b"]
    moved = NetMarked(block="b", fired=(Fired(transition=1, time=0.1),), put=(1, 4), taken=(0,))

    made.feed(moved, 10.1, 10.1)
    made.feed(net("b", marked=(1, 4), fired=(Fired(transition=1, time=0.1),)), BEGAN, 12.0)  # told again

    assert section(made, "tokens") == [{"block": "b", "marked": [1, 4], "fired": {"1": 0.1}, "over": False}]
    assert made.versions[f"{NET}b"] == laid_out


def test_a_block_that_waits_has_no_net_yet() -> None:
    made = picture((NetWaiting(block="b", since=at(11.0), waits_for=("a",)), 11.0))

    assert section(made, f"{NET}b")["waits_for"] == ["a"]
    assert section(made, f"{NET}b")["rows"] == []


def test_the_last_net_stays_until_the_next_and_mere_looks_do_not_push_it_out() -> None:
    made = picture((net("b"), 10.0), (NetMarked(block="b", is_over=True), 11.0), (net("maintenance-1"), 12.0))
    made.advance(18.0)
    assert section(made, "nets") == ["b", "maintenance-1"]

    made.feed(net("c"), 30.0, 30.0)
    made.advance(30.1)
    assert section(made, "nets") == ["c"]
    assert f"{NET}b" not in made.versions


# -- measures, references, health, notes -----------------------------------------------------------------------------


def test_courses_are_thinned_but_end_with_the_newest() -> None:
    messages = [
        (
            Statistics(
                actor="ann", at=at(time), session=WindowStatistics(mtbce=time), recent=WindowStatistics(),
                engagement=0.5, level="engaged",
            ),
            time,
        )
        for time in (10.0, 10.1, 10.2, 10.9, 11.0)
    ]  # fmt: skip
    made = picture(*messages)

    made.advance(12.0)
    ann = section(made, f"{MEASURES}ann")

    assert [time for time, _ in ann["mtbce"]] == [0.0, 0.2, 0.9, 1.0]
    assert ann["mtbce"][-1] == [1.0, 11.0]


def measured(person: str, time: float) -> Timed:
    none = WindowStatistics()
    return Statistics(actor=person, at=at(time), session=none, recent=none, engagement=0.5), time


def test_measures_are_told_once_a_second_at_most() -> None:
    made = picture(measured("", 10.0))
    made.advance(11.0)
    before = made.versions[MEASURES]

    for time in (11.0, 11.3, 11.6, 11.9):
        made.feed(*measured("", time), time)
        made.advance(time)
    assert made.versions[MEASURES] == before

    made.advance(12.0)
    assert made.versions[MEASURES] > before


def test_of_all_people_only_those_are_told_anew_whose_measures_have_changed() -> None:
    made = picture(*(measured(person, 10.0) for person in ("", "ann", "ben", "eve")))
    made.advance(11.0)
    before = dict(made.versions)

    made.feed(*measured("ben", 12.0), 12.0)
    made.advance(13.0)

    assert {name for name, version in made.versions.items() if before.get(name) != version} == {f"{MEASURES}ben"}


def test_a_reference_has_the_table_behind_it() -> None:
    pair = PairConsidered(
        gesture="gaze", phrase="it", distractors=("b",), channel=0.8, reliability=0.4, minimum=0.9, cost=1.0,
        feasible=False, reason="R 0.4 below 0.9",
    )  # fmt: skip
    choice = ReferenceChoice(
        reference="r", target="a", gesture="directed_gaze", phrase="the a", reliability=0.95, cost=2.0, pairs=(pair,)
    )
    made = picture((FragmentOutcome(id="x", fragment="f", status="done", choices=(choice,)), 11.0))

    (shown,) = section(made, "references")

    assert (shown["fragment"], shown["target"]) == ("f", "a")
    assert shown["pairs"][0]["distractors"] == ["b"]
    assert shown["pairs"][0]["reason"] == "R 0.4 below 0.9"


def status(**fields: Any) -> Status:
    return Status(participant="control", run="r", version="1", at=at(30.0), joined=at(10.0), **fields)


def health(made: Picture, name: str) -> Any:
    return next(each for each in section(made, "health") if each["name"] == name)


def test_health_says_who_is_not_there_who_is_silent_and_what_was_counted() -> None:
    made = picture((PeerAlive(participant="control", run="r"), 10.0))
    assert health(made, "realizer")["warnings"] == ["not on the bus"]

    made.feed(status(stands=at(11.0), bus=BusHealth(failures=1, lost=2)), 30.0, 30.0)
    assert health(made, "control")["warnings"] == ["1 bug", "2 messages lost"]
    assert "up 20 s" in health(made, "control")["facts"]

    made.silence(frozenset({"control"}), 31.0)
    assert health(made, "control")["warnings"][0] == "does not answer"

    made.feed(PeerGone(participant="control"), 32.0, 32.0)
    assert health(made, "control")["here"] is False
    assert section(made, "notes")[-1] == {"at": 22.0, "level": "news", "text": "control has left the bus"}


def test_faults_that_are_on_are_told_in_words_and_by_kind() -> None:
    made = picture((BodyFaults(at=at(11.0), faults=(BodyFault(kind="slow", part="right_arm", amount=3.0),)), 11.0))

    shown = section(made, "switched")

    assert (shown["faults"], shown["kinds"]) == (["slow right_arm 3"], ["slow"])


@pytest.mark.parametrize("order", [range(len(SCENE)), range(len(SCENE) - 1, -1, -1)])
def test_no_order_of_messages_breaks_the_picture(order: range) -> None:
    """As after a cut: what comes late is taken as it is."""
    messages: list[tuple[Message, Seconds]] = [SCENE[number] for number in order]
    made = picture(*messages)

    assert all(json.loads(made.section(name)) is not None for name in made.versions)


def test_a_block_whose_realizer_died_is_lost_and_leaves_unless_the_same_life_comes_back() -> None:
    begun: tuple[Timed, ...] = (
        (PeerAlive(participant="realizer", run="1"), 10.0),
        (BlockProgress(block="b", progress="start", at=at(10.0)), 10.0),
        (PeerGone(participant="realizer"), 12.0),
    )
    made = picture(*begun)
    lost = section(made, f"{BLOCK}b")
    assert (lost["status"], lost["until"]) == ("lost", 2.0)

    made.feed(PeerAlive(participant="realizer", run="1"), 13.0, 13.0)
    assert (section(made, f"{BLOCK}b")["status"], section(made, f"{BLOCK}b")["until"]) == ("", None)

    other = picture(*begun, (PeerAlive(participant="realizer", run="2"), 13.0))
    assert section(other, f"{BLOCK}b")["status"] == "lost"
    other.advance(12.0 + KEPT + 1.0)
    assert f"{BLOCK}b" not in other.versions


def test_faults_that_a_killed_window_left_on_are_told_with_who_did_it() -> None:
    slow = BodyFaults(at=at(11.0), faults=(BodyFault(kind="slow", amount=2.0),), by="console-1")
    made = picture((PeerAlive(participant="console-1", run="1"), 10.0), (slow, 11.0))
    assert section(made, "switched")["by"] == "console-1"

    made.feed(PeerGone(participant="console-1"), 12.0, 12.0)
    assert section(made, "switched")["by"] == "console-1, which has left the bus"

    made.feed(BodyFaults(at=at(13.0), by="console-2"), 13.0, 13.0)
    assert section(made, "switched")["by"] == ""


def test_two_references_of_one_name_are_two() -> None:
    choice = ReferenceChoice(
        reference="r", target="blue", gesture="gaze", phrase="it", reliability=0.9, cost=1.0, pairs=()
    )
    outcome = FragmentOutcome(id="1", fragment="f", status="done", choices=(choice,))
    made = picture((outcome, 10.0), (outcome, 11.0))

    assert [each["number"] for each in section(made, "references")] == [0, 1]


def test_what_is_over_goes_and_who_has_gone_is_forgotten_though_nobody_looks() -> None:
    made = Picture("robot", 0.0)
    none = WindowStatistics()
    for number in range(50):
        now = number * 20.0
        for message in (
            BlockProgress(block=f"b{number}", progress="start", time=0.0, at=at(now)),
            net(f"b{number}"),
            BlockProgress(block=f"b{number}", progress="end", time=1.0, status="done", at=at(now)),
            NetMarked(block=f"b{number}", is_over=True),
            Statistics(actor=f"track-{number}", at=at(now), session=none, recent=none),
        ):
            made.feed(message, now, now)

    assert len([each for each in made.versions if each.startswith((BLOCK, NET))]) < 10
    made.advance(49 * 20.0 + 1.0)
    people = {each for each in made.versions if each.startswith(MEASURES)}
    assert people == {f"{MEASURES}track-{number}" for number in range(20, 50)}
