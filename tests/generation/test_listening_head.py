"""The head of a robot among people: whom it looks at while they speak and it is silent."""

import asyncio

import pytest

from engage_hri import perceive
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import Floor, FloorSpeech
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from tests.generation.heads import AT, Stage, event, inhibition

PEOPLE = tuple(
    Entity(id=id, kind="person", position=(1.2, y, 1.2)) for id, y in (("ann", 0.0), ("ben", 0.6), ("cem", -0.6))
)


def company(**config: object) -> Stage:
    """A robot that has looked at ann for long."""
    stage = Stage(**{"policies_off": ("aversion",), **config})
    stage.feed(World(entities=PEOPLE))
    stage.do(lambda arbiter: arbiter.speak_to("ann"))
    stage.until(10.0)
    stage.owners.clear()
    stage.rule()
    stage.owners.clear()
    return stage


def speak(stage: Stage, at: float, *actors: str) -> None:
    """At this time these speak, the first first."""
    stage.until(at)
    stage.feed(Floor(at=AT, speeches=tuple(FloorSpeech(actor=each, since=AT) for each in actors)))


def asked(stage: Stage, state: str, responder: str = "ann") -> None:
    stage.feed(event("pair", state, kind="adjacency_pair", initiator="robot", responder=responder, objects=()))


def looks(stage: Stage) -> list[tuple[float, str]]:
    """Where the head was sent, and when."""
    return [(at, target) for at, _, target in stage.shifts if at >= 10.0]


def look_at(stage: Stage, actor: str, target: str) -> None:
    stage.feed(ActionBegan(actor=actor, action="look", targets=(target,), at=AT))


@pytest.mark.parametrize(("at", "looked_at"), [("robot", "cem"), ("ben", "ben"), ("", "ben")])
def test_of_two_who_speak_it_looks_at_the_one_who_looks_at_it(at: str, looked_at: str) -> None:
    stage = company()
    look_at(stage, "ben", "cem")
    if at:
        look_at(stage, "cem", at)
    speak(stage, 11.0, "ben")
    speak(stage, 13.0, "ben", "cem")
    stage.until(15.0)

    assert stage.owners[-1][2] == looked_at


@pytest.mark.parametrize("news", [ActionEnded(actor="ben", action="look", targets=("robot",), at=AT),
                                  ActorLost(actor="ben", at=AT)])  # fmt: skip
def test_who_looks_at_it_no_longer_has_no_more_claim_than_others(news: object) -> None:
    stage = company()
    look_at(stage, "ben", "robot")
    stage.feed(news, ActorFound(actor="ben", at=AT))
    speak(stage, 11.0, "ben")
    look_at(stage, "cem", "robot")
    speak(stage, 13.0, "ben", "cem")
    stage.until(15.0)

    assert stage.owners[-1][2] == "cem"


def test_who_speaks_gets_the_eyes_at_once_from_who_has_only_looked_or_has_finished() -> None:
    stage = company()
    stage.until(12.0)
    stage.feed(event("gaze", "started", kind="mutual_facial_gaze", initiator="ben", objects=()))
    speak(stage, 12.1, "cem")
    stage.feed(event("gaze", "failed", kind="mutual_facial_gaze", initiator="ben", objects=()))
    speak(stage, 14.0)
    speak(stage, 14.1, "ben")
    stage.until(15.0)
    assert stage.owners == [(12.0, "response", "ben"), (12.3, "response", "cem"), (14.3, "response", "ben")]


@pytest.mark.parametrize("looks_back", [13.5, 12.7])
def test_of_two_who_speak_the_eyes_are_on_who_looks_at_it_and_stay_where_both_do(looks_back: float) -> None:
    stage = company()
    speak(stage, 12.0, "ben")
    look_at(stage, "cem", "robot")
    speak(stage, 12.3, "ben", "cem")
    stage.until(looks_back)
    look_at(stage, "ben", "robot")
    stage.until(15.0)

    assert stage.owners[-2:] == [(12.2, "response", "ben"), (12.5, "response", "cem")]


def test_it_looks_at_the_speaker_soon_and_comes_back_after_the_speech() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    speak(stage, 13.0)
    stage.until(20.0)

    assert looks(stage) == [(10.2, "ben"), (14.3, "ann")]
    assert stage.owners[1:] == [(10.2, "response", "ben"), (14.3, "face", "ann")]
    assert "speech of ben" in {ruling.owner.reason for ruling in stage.rulings}


def test_an_uh_huh_into_the_speech_of_another_draws_nobodys_head() -> None:
    stage = company()
    speak(stage, 8.0, "ann")
    speak(stage, 10.0, "ann", "ben")
    speak(stage, 10.5, "ann")
    speak(stage, 11.0)
    speak(stage, 14.0, "ben")
    speak(stage, 14.15)
    stage.until(15.0)

    assert looks(stage) == []


def test_of_two_who_speak_at_once_it_stays_with_the_first_and_then_turns_to_the_other() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    speak(stage, 11.0, "ben", "cem")
    speak(stage, 12.0, "cem")
    stage.until(12.5)

    assert looks(stage) == [(10.2, "ben"), (12.0, "cem")]


def test_it_goes_from_speaker_to_speaker_without_a_look_elsewhere_in_the_gap() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    speak(stage, 11.0)
    speak(stage, 11.3, "cem")
    speak(stage, 13.0)
    stage.until(20.0)

    assert looks(stage) == [(10.2, "ben"), (11.5, "cem"), (14.3, "ann")]


def test_a_pause_within_a_speech_does_not_send_it_away() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    speak(stage, 11.0)
    speak(stage, 11.5, "ben")
    stage.until(13.0)

    assert looks(stage) == [(10.2, "ben")]


def test_while_it_waits_for_an_answer_the_talk_of_others_does_not_draw_it() -> None:
    stage = company()
    asked(stage, "started")
    speak(stage, 10.0, "ben")
    stage.until(14.0)
    assert looks(stage) == []

    asked(stage, "succeeded")
    assert looks(stage) == [(14.0, "ben")]


def test_who_speaks_to_the_robot_has_its_eyes_and_not_who_talks_on_or_looks_at_it() -> None:
    stage = company()
    stage.feed(Floor(at=AT, speeches=(FloorSpeech(actor="ben", since=AT, to=("cem",)),)))
    stage.until(12.0)
    answers = FloorSpeech(actor="ann", since=AT, to=("robot",))
    stage.feed(Floor(at=AT, speeches=(FloorSpeech(actor="ben", since=AT, to=("cem",)), answers)))
    stage.until(13.0)
    facial = {"kind": "mutual_facial_gaze", "initiator": "cem", "objects": ()}
    stage.feed(event("look", "started", **facial))
    stage.until(15.0)
    assert looks(stage) == [(10.2, "ben"), (12.2, "ann")]

    stage.feed(event("point", "started", initiator="cem", objects=("cup",)))
    assert looks(stage)[2:] == [(15.0, "cup")], "what somebody points at may be what is spoken of"
    stage.feed(event("point", "failed", initiator="cem", objects=("cup",)))
    stage.feed(Floor(at=AT, speeches=()))
    stage.until(16.0)
    assert looks(stage)[3:] == [(15.3, "cem")], "what it has looked at it has seen"


def asked_all(stage: Stage, state: str, **fields: object) -> None:
    for who in ("ann", "ben", "cem"):
        told = event(who, state, kind="adjacency_pair", initiator="robot", responder=who, objects=(), **fields)
        stage.arbiter.feed(told, stage.now)
    stage.rule()


def test_while_several_are_to_answer_it_looks_from_one_to_the_next_until_one_speaks_and_stays_with_that_one() -> None:
    stage = company()
    asked_all(stage, "started")
    stage.until(14.0)
    assert looks(stage) == [], "the robot still speaks"

    stage.do(lambda arbiter: arbiter.wait_for_answers())
    stage.until(18.0)
    assert looks(stage) == [(14.0, "ben"), (15.2, "cem"), (16.4, "ann"), (17.6, "ben")]

    speak(stage, 18.5, "cem")
    asked_all(stage, "succeeded", answered_by="cem")
    speak(stage, 20.0)
    stage.until(30.0)
    assert looks(stage)[4:] == [(18.5, "cem")]


def test_who_has_left_is_not_looked_for_in_the_round_and_one_who_is_left_is_looked_at() -> None:
    stage = company()
    asked_all(stage, "started")
    stage.do(lambda arbiter: arbiter.wait_for_answers())
    stage.until(11.0)
    stage.feed(World(entities=PEOPLE[:2]))
    stage.until(15.0)
    assert looks(stage) == [(10.0, "ben"), (12.4, "ann"), (13.6, "ben"), (14.8, "ann")]

    asked_all(stage, "failed")
    stage.until(20.0)
    assert looks(stage)[5:] == []


@pytest.mark.parametrize("speakers", [("robot", "ben"), ("ben", "robot")])
def test_who_speaks_itself_does_not_listen(speakers: tuple[str, ...]) -> None:
    stage = company()
    speak(stage, 10.0, *speakers)
    stage.until(14.0)

    assert looks(stage) == []


def test_a_voice_without_a_face_and_one_whose_recognition_has_gone_draw_nobody() -> None:
    stage = company()
    speak(stage, 10.0, "dan")
    stage.until(12.0)
    assert looks(stage) == []

    speak(stage, 12.0, "ben")
    stage.until(14.0)
    stage.do(lambda arbiter: arbiter.recognition_lost())
    stage.until(20.0)
    assert looks(stage) == [(12.2, "ben"), (14.3, "ann")]


def test_who_leaves_while_speaking_holds_the_head_no_longer() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    stage.until(11.0)
    stage.feed(World(entities=PEOPLE[:1]))
    stage.until(20.0)

    assert stage.owners[-1][1:] == ("face", "ann")


def test_an_answer_to_a_look_goes_before_and_an_inhibition_holds_the_head() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    stage.until(11.0)
    stage.feed(event("e", "started", initiator="ben", objects=("cup",)))
    assert looks(stage) == [(10.2, "ben"), (11.0, "cup")]
    stage.feed(event("e", "failed", initiator="ben", objects=("cup",)))
    stage.until(12.0)
    stage.do(lambda arbiter: arbiter.inhibit(inhibition()))
    stage.until(13.0)

    assert stage.owners[-1][1:] == ("inhibition", "")
    assert looks(stage) == [(10.2, "ben"), (11.0, "cup"), (11.3, "ben")]


def seek_eyes(stage: Stage, who: str, state: str) -> None:
    stage.feed(event(f"look-{who}", state, kind="mutual_facial_gaze", initiator=who, objects=()))


def test_a_look_at_a_face_lasts_though_others_speak_and_look_in_turns() -> None:
    stage = company()
    stage.feed(Floor(at=AT, speeches=(FloorSpeech(actor="ben", since=AT, to=("ann",)),)))
    stage.until(10.7)
    for state in ("started", "failed", "started"):
        seek_eyes(stage, "cem", state)
        stage.until(stage.now + 0.1)
    stage.until(12.0)
    assert looks(stage) == [(10.2, "ben"), (11.0, "cem")]

    seek_eyes(stage, "cem", "failed")
    stage.until(12.1)
    seek_eyes(stage, "ann", "started")
    seek_eyes(stage, "ann", "failed")
    stage.until(16.0)
    assert looks(stage)[2:] == [(12.0, "ben")], "ann's look was over before the head was free"


def test_a_brief_look_is_left_for_a_place_and_for_a_fragment() -> None:
    def brief() -> Stage:
        stage = company()
        speak(stage, 10.0, "ben")
        stage.until(10.7)
        return stage

    points, gazes = brief(), brief()
    points.feed(event("e", "started", initiator="cem", objects=("cup",)))
    assert points.shifts[-1][::2] == (10.7, "cup")
    gazes.do(lambda arbiter: arbiter.fragment_gazes("cem"))
    assert gazes.owners[-1] == (10.7, "fragment", "cem")


def test_who_may_be_speaking_to_it_keeps_its_eyes_whoever_else_seeks_them() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    stage.until(12.0)
    seek_eyes(stage, "cem", "started")
    stage.until(14.0)
    assert looks(stage) == [(10.2, "ben")]

    speak(stage, 14.0)
    stage.until(16.0)
    assert looks(stage)[1:] == [(14.0, "cem")]


def test_who_answers_is_looked_at_at_once_though_the_head_has_just_gone_on_to_another() -> None:
    stage = company()
    for each in ("ann", "ben"):
        pair = event(f"ask-{each}", "started", kind="adjacency_pair", initiator="robot", responder=each, objects=())
        stage.feed(pair)
    stage.do(lambda arbiter: arbiter.wait_for_answers())
    stage.until(12.0)
    at, other = looks(stage)[-1]
    assert at > 10.0
    stage.until(at + 1.2)
    at, other = looks(stage)[-1]
    answers = "ann" if other == "ben" else "ben"
    speak(stage, at + 0.1, answers)
    stage.until(at + 1.0)

    assert looks(stage)[-1] == (pytest.approx(at + 0.3), answers)


def test_after_a_fragments_brief_look_at_a_face_the_head_stays_there_too() -> None:
    stage = company()
    speak(stage, 10.0, "ben")
    stage.until(12.0)
    stage.do(lambda arbiter: arbiter.fragment_gazes("cem"))
    stage.until(12.1)
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.until(14.0)

    assert stage.owners[-2:] == [(12.0, "fragment", "cem"), (12.8, "response", "ben")]


def test_it_can_be_switched_off() -> None:
    stage = company(policies_off=("listening",))
    speak(stage, 10.0, "ben")
    stage.until(14.0)

    assert looks(stage) == []


# -- whole robots --------------------------------------------------------------------------------------------------


async def owners_from(robot: Robot, seconds: float) -> list[tuple[float, str]]:
    """Targets of the head in the next seconds, each with the time from now."""
    began, found = robot.now(), list[tuple[float, str]]()
    with robot.head_owners() as owners:
        while (left := began + seconds - robot.now()) > 0 and (told := await owners.next(left)) is not None:
            assert isinstance(told, HeadOwner)
            if not found or found[-1][1] != told.owner.target:
                found.append((robot.now() - began, told.owner.target))
    return found


async def test_a_whole_robot_turns_to_who_speaks_but_not_while_it_waits_for_another_ones_answer(
    hub: MemoryHub,
) -> None:
    config = load(settings=["simulation.human=none", 'generation.policies_off=["aversion"]'])
    async with (
        running(hub, services(config, *roster.ROBOT, "simulation")),
        connect(hub=hub) as robot,
        perceive("ann", hub=hub, position=(1.3, 0.4, 1.2)) as ann,
        perceive("ben", hub=hub, position=(1.3, -0.4, 1.2)) as ben,
    ):
        await ann.look_at(ann.robot)
        asked = {"turn_status": "full", "addressee": "ann", "parts": [{"say": "Ann, which piece is yours?"}]}
        await robot.perform(asked)
        talking = asyncio.create_task(ben.say("so I told her that we would be late", to=["ann"], seconds=2.5))
        assert {target for _, target in await owners_from(robot, 2.5)} == {"ann"}  # she has 4 s
        await talking
        await asyncio.sleep(6.0)

        talking = asyncio.create_task(ben.say("and then we missed the train", to=["ann"], seconds=2.5))
        (_, first), (turned, second), (back, third) = await owners_from(robot, 6.0)
        await talking
        assert (first, second, third) == ("ann", "ben", "ann")
        assert 0.199 <= turned <= 0.7
        assert 3.0 <= back <= 4.5


def test_what_the_eyes_have_come_to_is_to_be_seen_before_a_fragment_takes_them_away() -> None:
    stage = company()
    seen = []
    for at in (10.0, 10.2, 10.3, 10.5, 10.6):
        speak(stage, at, "ben")
        told = stage.arbiter.rest(at)
        seen.append((at, told.eyes_on, round(told.seen_after, 6)))

    assert seen == [
        (10.0, "ann", 0.0), (10.2, "ben", 0.3), (10.3, "ben", 0.2), (10.5, "ben", 0.0), (10.6, "ben", 0.0)
    ]  # fmt: skip
