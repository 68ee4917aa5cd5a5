"""A fragment for several people: who they are, how the robot looks at each, who answers, and who has to stay."""

import asyncio
import random
from collections.abc import Iterable

import pytest

from engage_hri import perceive
from engage_hri.schemas.behaviors import Event, Gaze, Reference, Speech, TurnSignal
from engage_hri.schemas.check import check
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.generation.fragment_check import checked, performable
from engage_hri.services.runtime.service import running
from tests.generation.emitted import POINT, block, by_id, emission, lines, reference
from tests.generation.test_talked_into import call, robot
from tests.generation.test_turn_policy import fragment
from tests.generation.turns import robot_turns, seen
from tests.random_cases import share_of

PEOPLE = ("ann", "bob", "cy", "dan")
WORLD = World(entities=tuple(Entity(id=id, kind="person", position=(1.0, 0.0, 1.2)) for id in ("ann", "bob", "cy")))

# -- who they are --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("named", "addressee"),
    [
        ("bob", "bob"),
        (("bob",), "bob"),
        (("bob", "ann"), ("bob", "ann")),
        (("bob", "ann", "bob"), ("bob", "ann")),
        (("BOB", "ann"), ("bob", "ann")),
        ("*", ("ann", "bob", "cy")),
        (("bob", "*"), ("ann", "bob", "cy")),
    ],
)
def test_one_several_or_all(named: str | tuple[str, ...], addressee: str | tuple[str, ...]) -> None:
    assert performable(TurnFragment(id="f", addressee=named), WORLD, "robot")[0].addressee == addressee


def test_of_one_person_all_is_that_person() -> None:
    alone = World(entities=WORLD.entities[:1])

    assert checked(TurnFragment(id="f", addressee="*"), alone, "robot").addressee == "ann"


@pytest.mark.parametrize("field", ["addressee", "interruptible"])
def test_who_is_unknown_is_named(field: str) -> None:
    given = {"addressee": "ann", field: ("ann", "eve", "bob")}
    with pytest.raises(InputRefused) as refused:
        checked(TurnFragment(id="f", **given), WORLD, "robot")  # type: ignore[arg-type]

    fault = refused.value.fault
    assert (fault.where, fault.reason) == (f"f: $.{field}[1]", "the world does not know the person 'eve'")
    assert "people: ann, bob, cy" in fault.advice


def test_nobody_is_not_all() -> None:
    with pytest.raises(InputRefused, match="no people"):
        checked(TurnFragment(id="f", addressee="*"), World(entities=()), "robot")


@pytest.mark.parametrize("encode", [encode_json, encode_xml])
@pytest.mark.parametrize("named", ["ann", ("ann", "bob"), "*"])
@pytest.mark.parametrize("interruptible", [None, True, False, "*", "ann", ("ann", "bob")])
def test_documents_say_it(encode: object, named: str | tuple[str, ...], interruptible: object) -> None:
    made = TurnFragment(id="f", addressee=named, interruptible=interruptible)  # type: ignore[arg-type]

    [again] = read(encode(made))  # type: ignore[operator]
    assert isinstance(again, TurnFragment)
    assert (again.addressee, again.interruptible) == (named, interruptible)


def test_the_rest_of_a_turn_is_for_the_same_people() -> None:
    turns = robot_turns()
    turns.accept(fragment("a", "beginning"), ("ann", "bob"))

    assert turns.accept(fragment("b", "middle"), "").addressees == ("ann", "bob")
    assert turns.accept(fragment("c", "middle"), ("bob", "ann")).turn == "a"
    with pytest.raises(InputRefused, match="turn a speaks to ann, bob, not to ann "):
        turns.accept(fragment("d", "end"), "ann")


def test_a_turn_ends_when_all_have_left() -> None:
    turns = robot_turns()
    turns.accept(fragment("a", "full"), ("ann", "bob"))
    turns.fragment_begins("a")
    turns.feed(seen("bob"), 1.0)

    assert turns.tick(60.0) is None
    turns.feed(seen(), 60.0)
    assert turns.tick(60.0) is None
    aborted = turns.tick(turns.deadline or 0.0)
    assert aborted is not None
    assert "bob has left" in aborted.why.reason
    assert not aborted.is_to_one


# -- looks -----------------------------------------------------------------------------------------------------


def looks(behaviors: Iterable[object]) -> list[str]:
    return [each.target for each in behaviors if isinstance(each, Gaze)]


@pytest.mark.parametrize("seed", range(share_of(200)))
def test_each_is_looked_at_once_and_the_first_at_last(seed: int) -> None:
    chance = random.Random(seed)
    people = PEOPLE[: chance.randint(2, 4)]
    status = chance.choice(("full", "beginning", "middle", "end"))
    speeches = [
        Speech(
            id=f"s{number}",
            text=" ".join("word" + chance.choice(("", "", "", ",", ".", "!")) for _ in range(chance.randint(1, 25))),
        )
        for number in range(chance.randint(1, 4))
    ]
    made = emission(TurnFragment(id="f", turn_status=status, addressee=people, behaviors=tuple(speeches)))  # type: ignore[arg-type]

    check(made.block)
    around = [each for each in made.block.behaviors if isinstance(each, Gaze) and each.id.startswith("turn-look")]
    assert looks(around) == [*people[1:], people[0]][: len(around)]
    closes = status in ("full", "end")
    assert looks(made.block.behaviors)[len(around) :] == ([people[0]] if closes else [])
    said = [each for each in made.block.behaviors if isinstance(each, Speech)]
    assert [each.text for each in said] == [each.text for each in speeches]
    places = []
    for look in around:
        [timing] = look.timing
        behavior, _, sync = timing.ref.partition(":")
        [speech] = [each for each in said if each.id == behavior]
        place = 0 if sync == "start" else next(mark.position for mark in speech.marks if mark.id == sync)
        before = sum(len(each.text.split()) for each in said[: said.index(speech)])
        places.append(before + len(speech.text[:place].split()))
        assert place == 0 or speech.text[place - 1] in ",.!"
    words = sum(len(each.text.split()) for each in said)
    assert all(0 < place < words for place in places), "never before the first word, nor after the last"
    assert all(later - earlier >= 2 for earlier, later in zip([0, *places], places, strict=False))


def test_looks_follow_each_other_to_the_end_of_the_turn() -> None:
    text = "One two three, four five six. Seven eight nine ten."
    made = block(TurnFragment(id="f", addressee=("ann", "bob"), behaviors=(Speech(id="s", text=text),)))

    assert lines(made, "turn-looks") == ["turn-look-2:start = turn-look:relax"]
    assert "turn-gaze:start = turn-look-2:relax" in lines(made, "turn-timing")
    speech = by_id(made)["s"]
    assert isinstance(speech, Speech)
    assert [each.position for each in speech.marks] == [14, 29]


def test_nobody_is_looked_at_so_late_that_the_eyes_are_not_back_when_the_last_word_ends() -> None:
    text = "It was nice to listen to you. Goodbye."
    made = block(TurnFragment(id="f", addressee=("ann", "bob"), behaviors=(Speech(id="s", text=text),)))

    assert lines(made, "turn-timing") == ["turn-gaze:stroke = s:end"]


def test_the_look_after_each_point_goes_around() -> None:
    refers: tuple[Reference | Speech, ...] = tuple(reference(id) for id in ("a", "b", "c", "d"))
    made = block(TurnFragment(id="f", addressee=("ann", "bob"), behaviors=refers), [(POINT, "this one")] * 4)

    glances = [each.target for each in made.behaviors if isinstance(each, Gaze) and each.target != "piece"]
    assert glances == ["bob", "ann", "bob", "ann"]


def test_each_is_asked_to_look_and_the_point_is_held_for_all() -> None:
    made = block(TurnFragment(id="f", addressee=("ann", "bob"), behaviors=(reference("a"),)), [(POINT, "this one")])

    asked = {each.id: each.responder for each in made.behaviors if isinstance(each, Event) if each.objects}
    assert list(asked.values()) == ["ann", "bob"]
    assert {f"a-point:stroke_end after {id}:end" for id in asked} <= {*lines(made, "a-timing")}


def test_who_is_spoken_to_alone_is_not_looked_around() -> None:
    text = "One two three, four five six. Seven eight nine ten."
    made = block(TurnFragment(id="f", addressee="ann", behaviors=(Speech(id="s", text=text),)))

    assert looks(made.behaviors) == ["ann"]


# -- events ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [1, 2, 3])
def test_each_has_an_event_or_signal_and_the_end_is_for_all(index: int) -> None:
    spoken = TurnFragment(
        id="f", turn_index=index, addressee=("ann", "bob"), behaviors=(Speech(id="s", text="Well now."),)  # type: ignore[arg-type]
    )  # fmt: skip
    behaviors = block(spoken).behaviors

    pairs = [each.responder for each in behaviors if isinstance(each, Event) and each.kind == "adjacency_pair"]
    signals = [(each.signal, each.actor) for each in behaviors if isinstance(each, TurnSignal)]
    assert pairs == (["ann", "bob"] if index == 1 else [])
    replies = [("answered" if index == 2 else "repaired", who) for who in ("ann", "bob")] if index > 1 else []
    assert signals == [*replies, ("ended", "")]


@pytest.mark.parametrize("answers", ["ann", "bob", "nobody"])
async def test_a_whole_robot_asks_two_and_hears_who_answers_first(hub: MemoryHub, answers: str) -> None:
    owners: list[str] = []
    last: dict[str, tuple[str, str]] = {}
    text = "Hello you two, it is nice to see you. Which one of you is hungry?"
    async with robot(hub) as client, perceive("ann", hub=hub) as ann, perceive("bob", hub=hub) as bob:
        for each in (ann, bob):
            await each.look_at(each.robot)
        await asyncio.sleep(2.0)

        async def watch() -> None:
            async for told in client.head_owners():
                if told.owner.kind == "fragment" and owners[-1:] != [told.owner.target]:
                    owners.append(told.owner.target)

        async def follow() -> None:
            async for each in client.connection_events():
                last[each.id] = each.state, each.answered_by

        watching = asyncio.gather(watch(), follow())
        performing = asyncio.create_task(client.perform(call(text), addressee=("ann", "bob"), await_answer=True))
        await asyncio.sleep(7.0)
        if answers != "nobody":
            await {"ann": ann, "bob": bob}[answers].say("me of course")
        told = await performing
        await asyncio.sleep(0.0)
        watching.cancel()

    assert owners == ["bob", "ann"]
    pairs = [each for each in told.events if each.kind == "adjacency_pair"]
    assert [each.responder for each in pairs] == ["ann", "bob"]
    if answers == "nobody":
        assert [(each.state, each.answered_by) for each in pairs] == [("failed", "")] * 2
    else:
        # The end of the answer comes in the same instant as the answer: the turn may close between the two.
        assert [each.answered_by for each in pairs] == [answers] * 2
        assert [last[each.id] for each in pairs] == [("completed", answers)] * 2
        assert [each.text for each in told.heard] == ["me of course"]


async def watched(client: Robot, owners: list[tuple[float, str]]) -> None:
    """Note where the head goes, and when."""
    async for told in client.head_owners():
        if not owners or owners[-1][1] != told.owner.target:
            owners.append((client.now(), told.owner.target))


async def test_a_whole_robot_looks_at_three_in_turn_and_stays_with_who_answers(hub: MemoryHub) -> None:
    owners: list[tuple[float, str]] = []
    async with (
        robot(hub) as client,
        perceive("ann", hub=hub, position=(1.3, 0.5, 1.2)) as ann,
        perceive("bob", hub=hub, position=(1.3, 0.0, 1.2)) as bob,
        perceive("cy", hub=hub, position=(1.3, -0.5, 1.2)) as cy,
    ):
        for each in (ann, bob, cy):
            await each.look_at(each.robot)
        await asyncio.sleep(4.0)
        watching = asyncio.create_task(watched(client, owners))
        asking = asyncio.create_task(client.perform(call("Which one is it?"), addressee="*", await_answer=True))
        await asyncio.sleep(5.0)
        await cy.say("the one over there")
        told = await asking
        await asyncio.sleep(3.0)
        watching.cancel()

    targets = [target for _, target in owners]
    faces = [each for each in targets if each != "table"]  # it looks there where it begins
    assert [*dict.fromkeys(faces)] == ["ann", "bob", "cy"]
    assert targets[-1] == "cy"
    assert {each.answered_by for each in told.events if each.kind == "adjacency_pair"} == {"cy"}


@pytest.mark.parametrize("seed", range(1, 7))
async def test_a_party_of_three_is_asked_and_who_answers_is_looked_at(hub: MemoryHub, seed: int) -> None:
    config = load(settings=["simulation.human=party", "simulation.people=3", f"simulation.seed={seed}"])
    owners: list[tuple[float, str]] = []
    async with running(hub, services(config, *roster.ROBOT, "simulation")), connect(hub=hub) as client:
        await client.person()
        await asyncio.sleep(8.0)
        watching = asyncio.create_task(watched(client, owners))
        told = await client.perform(call("Which piece do you like?"), addressee="*", await_answer=True)
        watching.cancel()

    pairs = [each for each in told.events if each.kind == "adjacency_pair"]
    assert sorted(each.responder for each in pairs) == ["ann", "bob", "cy"]
    # Who says something of their own to the robot while the answer is decided has preempted their own pair.
    decided = [each for each in pairs if each.state != "preempted"]
    assert len({(each.state == "failed", each.answered_by, each.delay) for each in decided}) == 1
    spoken = [target for at, target in owners if at >= pairs[0].started.seconds]
    assert pairs[0].answered_by in {"", *spoken}
