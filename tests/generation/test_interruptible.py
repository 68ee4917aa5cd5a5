"""Who may interrupt a turn, and after how long: all else is told, and the robot goes on without a hold."""

import asyncio
import random
from typing import Any, NamedTuple

import pytest

from engage_hri import perceive
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.check import problems
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.recognition import Interjection, InterjectionReading
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.turns.interjections import UNDECIDED, WORDLESS
from engage_hri.services.generation.turns.robot_turns import RobotTurns
from tests.generation.test_talked_into import LONG, call, robot
from tests.generation.test_turn_policy import fragment
from tests.generation.turns import robot_turns
from tests.random_cases import share_of

PEOPLE = ("ann", "bob", "cy")
"""The robot speaks to the first two."""


def news(who: str, reading: InterjectionReading, since: float, words: str = "") -> Interjection:
    at = Stamp("test", since)
    return Interjection(actor=who, since=at, at=at, reading=reading, words=words)


def speaking(**fields: object) -> RobotTurns:
    turns = robot_turns()
    turns.accept(fragment("a", "full", **fields), ("ann", "bob"))
    turns.fragment_begins("a")
    return turns


# -- one speech, by the rule ---------------------------------------------------------------------------------------


class Said(NamedTuple):
    """A speech. decided: seconds from its beginning to its reading; None: nobody tells one.

    words: those of an interruption; "": its length has decided it.
    """

    who: str
    since: float
    lasts: float
    reading: InterjectionReading
    decided: float | None
    words: str = "wait"


def expected(said: Said, named: object, after: float) -> tuple[float | None, float, float]:
    """When the turn is broken off (None: never), and from when to when the robot waits before that."""
    may = said.who in named if isinstance(named, tuple) else named == "*" or (named is not False and said.who != "cy")
    counts = said.since + after
    is_heeded = may and (after == 0.0 or after < said.lasts)
    known = None if said.decided is None else said.since + said.decided
    if not is_heeded:
        return None, 0.0, 0.0
    if said.reading == "interruption" and known is not None and not said.words and known < said.since + WORDLESS:
        heeded, floor = max(known, counts), said.since + WORDLESS
        if heeded >= floor:
            return heeded, 0.0, 0.0
        return (floor if said.lasts > WORDLESS else None), counts, floor
    if known is not None and known <= counts:
        return (counts if said.reading == "interruption" else None), 0.0, 0.0
    gives_up = counts + UNDECIDED
    until = gives_up if known is None else min(known, gives_up)
    return (known if said.reading == "interruption" and known is not None else None), counts, until


@pytest.mark.parametrize("seed", range(share_of(300)))
def test_a_speech_breaks_the_turn_off_only_if_it_may_and_lasts(seed: int) -> None:
    chance = random.Random(seed)
    named = chance.choice((None, True, False, "*", "cy", ("ann",), ("ann", "cy"), ()))
    named_ids = (named,) if named == "cy" else named
    after = chance.choice((0.0, 0.0, 0.5, 1.3))
    reading = chance.choice(("interruption", "backchannel", "noise", "other", "answer"))
    decided = chance.choice((None, round(chance.uniform(0.1, 2.5), 2)))
    words = chance.choice(("", "wait"))
    said = Said(chance.choice(PEOPLE), 1.0, round(chance.uniform(0.1, 3.0), 2), reading, decided, words)  # type: ignore[arg-type]
    broken_off, held_from, held_until = expected(said, named_ids, after)

    turns = speaking(interruptible=named, interruptible_after=after)
    steps = [(said.since, 1), (said.since + said.lasts, 0)]
    if decided is not None:
        steps.append((said.since + decided, 2))
    ended = None
    ticks = [round(1.0 + number / 100, 2) for number in range(700)]
    for at, what in sorted([(round(at, 2), what) for at, what in steps] + [(at, 3) for at in ticks]):
        if what == 0:
            turns.interjections.falls_silent(said.who)
        elif what < 3:
            turns.feed(news(said.who, "open" if what == 1 else reading, said.since, said.words), at)
        elif ended is None:
            if turns.tick(at) is not None:
                ended = at
            elif held_from + 0.011 < at < held_until - 0.011:
                assert turns.held == "a", at
            elif at < held_from - 0.011 or at > held_until + 0.011:
                assert turns.held == "", at

    assert ended == (None if broken_off is None else pytest.approx(broken_off, abs=0.011))
    [told] = turns.interjections.of_turn("a")
    assert (told.actor, told.went_on) == (said.who, ended is None and (decided is not None or held_until > 0.0))


def test_seconds_are_not_negative() -> None:
    [problem] = problems(TurnFragment(id="f", interruptible_after=-1.0))
    assert problem.path == "$.interruptible_after"


# -- fragments of a turn -------------------------------------------------------------------------------------------


def test_a_beginning_says_it_for_its_turn_and_each_fragment_may_say_otherwise() -> None:
    turns = robot_turns()
    turns.accept(fragment("a", "beginning", interruptible=False, interruptible_after=1.0), ("ann", "bob"))
    inherits = turns.accept(fragment("b", "middle"), "")
    own = turns.accept(fragment("c", "end", interruptible="bob", interruptible_after=0.0), "")

    assert [inherits.gives_way_after(who) for who in PEOPLE] == [None, None, None]
    assert [own.gives_way_after(who) for who in PEOPLE] == [None, 0.0, None]


def test_it_holds_in_the_pauses_of_an_open_turn() -> None:
    turns = robot_turns()
    turns.accept(fragment("a", "beginning", interruptible=False), "ann")
    turns.fragment_begins("a")
    turns.accept(fragment("b", "middle", interruptible=True), "")
    for id, at in (("a", 1.0), ("b", 2.0)):
        turns.fragment_ended(id, complete=True, now=at)
    turns.feed(news("ann", "open", 3.0), 3.0)
    turns.feed(news("ann", "interruption", 3.0), 3.5)

    assert turns.tick(3.5) is None
    assert turns.open_turn == "a"


# -- whole robots --------------------------------------------------------------------------------------------------


async def talked_into(
    hub: MemoryHub, by: str, seconds: float, words: str = "stop that please", **fields: Any
) -> tuple[Summary, float]:
    """What became of a turn to ann, and how long it took."""
    async with robot(hub) as client, perceive("ann", hub=hub) as ann, perceive("bob", hub=hub) as bob:
        for each in (ann, bob):
            await each.look_at(each.robot)
        await asyncio.sleep(2.0)
        made = TurnFragment(id="f", addressee="ann", behaviors=(Speech(id="s", text=LONG),), **fields)
        began = client.now()
        performing = asyncio.create_task(client.perform(made, await_answer=True))
        await asyncio.sleep(1.5)
        await {"ann": ann, "bob": bob}[by].say(words, seconds=seconds)
        told = await performing
        return summary(told), client.now() - began


@pytest.mark.parametrize(
    ("by", "seconds", "fields", "stops"),
    [
        ("ann", 1.0, {}, True),
        ("bob", 1.0, {}, False),
        ("ann", 1.0, {"interruptible": False}, False),
        ("bob", 1.0, {"interruptible": False}, False),
        ("bob", 1.0, {"interruptible": ("bob",)}, True),
        ("ann", 1.0, {"interruptible": ("bob",)}, False),
        ("bob", 1.0, {"interruptible": "*"}, True),
        ("ann", 1.0, {"interruptible_after": 2.0}, False),
        ("ann", 3.0, {"interruptible_after": 2.0}, True),
    ],
)
async def test_who_may_interrupt_stops_the_robot_and_who_may_not_is_told(
    hub: MemoryHub, by: str, seconds: float, fields: dict[str, Any], *, stops: bool
) -> None:
    told, _ = await talked_into(hub, by, seconds, **fields)

    assert told.status == ("interrupted" if stops else "done")
    assert [(each.who, each.reading, each.went_on) for each in told.interjections] == [
        (by, "interruption", not stops)
    ]


async def test_nobody_is_waited_for_who_may_not_interrupt(hub: MemoryHub) -> None:
    _, undisturbed = await talked_into(hub, "bob", 0.2, "uh-huh", interruptible=False)
    told, took = await talked_into(MemoryHub(), "ann", 1.0, "uh-huh", interruptible=False)

    assert told.status == "done"
    assert took == pytest.approx(undisturbed, abs=0.3)


async def test_perform_says_who_may_interrupt_in_place_of_the_fragment(hub: MemoryHub) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(client.perform(call(LONG), interruptible=False))
        await asyncio.sleep(1.5)
        await ann.type("stop")
        told = await performing

    assert told.status == "done"
    assert [(each.actor, each.words) for each in told.interjections] == [("ann", "stop")]
