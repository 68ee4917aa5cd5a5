"""What "it" can mean: the one thing that was referred to, across fragments and turns, if it was said at all."""

import asyncio

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.talk.offline_plan import generated
from engage_hri.services.generation.references.phrases import NO_DISCOURSE, Discourse
from engage_hri.services.simulation.still import table_world
from tests.generation.partners import Partners, stage

WORLD = table_world()


def refers(id: str, status: str, *targets: str, index: int = 1, addressee: str = "") -> TurnFragment:
    """Phrases are to be proposed."""
    behaviors = tuple(
        Reference(id=f"r{number}", target=target, minimum_reliability=0.3) for number, target in enumerate(targets)
    )
    return TurnFragment(
        id=id, turn_status=status, turn_index=index, behaviors=behaviors, addressee=addressee  # type: ignore[arg-type]
    )  # fmt: skip


def offered_it(*fragments: TurnFragment) -> list[list[bool]]:
    """For each reference of each fragment: was "it" among the phrases?"""
    plans = generated(fragments, WORLD, Config(), "")
    return [[any(pair.phrase == "it" for pair in choice.pairs) for choice in plan.choices] for plan in plans]


def directs(*objects: str, initiator: str = "human") -> ConnectionEvent:
    at = Stamp("test", 0.0)
    return ConnectionEvent(
        id="e", kind="directed_gaze", initiator=initiator, responder="robot", state="started", at=at, started=at,
        objects=objects,
    )  # fmt: skip


A, B = "blue-square", "red-square"


def test_it_is_what_an_earlier_fragment_of_the_turn_has_named() -> None:
    assert offered_it(refers("1", "beginning", A), refers("2", "middle", A), refers("3", "end", B, A)) == [
        [False], [True], [False, False],
    ]  # fmt: skip


def test_it_is_the_only_thing_of_the_turn_before_until_the_turn_names_something() -> None:
    first = refers("1", "full", A)

    assert offered_it(first, refers("2", "full", A, index=3)) == [[False], [True]]
    assert offered_it(first, refers("2", "full", B, A, index=3)) == [[False], [False, False]]
    assert offered_it(refers("1", "full", A, B), refers("2", "full", A, index=3)) == [[False, False], [False]]


def test_it_is_not_of_two_turns_ago() -> None:
    silent = TurnFragment(id="2", turn_status="full")

    assert offered_it(refers("1", "full", A), silent, refers("3", "full", A, index=3)) == [[False], [], [False]]


def test_a_backchannel_is_no_turn() -> None:
    sign = TurnFragment(id="2", turn_status="backchannel")

    assert offered_it(refers("1", "full", A), sign, refers("3", "full", A, index=3)) == [[False], [], [True]]


def test_somebody_else_has_heard_of_nothing() -> None:
    named = NO_DISCOURSE.in_turn("t", ("ann",)).naming("t", [A])

    assert named.in_turn("u", ("ann",)).topic == A
    assert named.in_turn("u", ("ben",)).topic == ""


def test_what_was_not_said_is_not_named() -> None:
    named = NO_DISCOURSE.in_turn("t", ("ann",)).naming("t", [A]).naming("u", [B])

    assert named.topic == ""
    assert named.without("u", {B}).topic == A
    assert named.without("u", {A}) == named  # the other fragment's
    assert named.in_turn("v", ("ann",)).without("u", {B}).topic == A


def test_a_person_who_directs_to_something_else_changes_the_topic() -> None:
    named = NO_DISCOURSE.in_turn("t", ("ann",)).naming("t", [A])

    assert named.hearing(directs(B), "robot") == Discourse("t", ("ann",))
    assert named.hearing(directs(A), "robot") == named
    assert named.hearing(directs(B, initiator="robot"), "robot") == named
    assert named.hearing(replace(directs(B), state="succeeded"), "robot") == named  # it began before


# -- in the service ------------------------------------------------------------------------------------------------


async def its(partners: Partners, pending: object) -> bool:
    outcome = await pending.outcome  # type: ignore[attr-defined]
    assert isinstance(outcome, FragmentOutcome)
    return any(pair.phrase == "it" for choice in outcome.choices for pair in choice.pairs)


async def test_a_streamed_fragment_knows_what_those_before_it_are_going_to_name(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        sent = [partners.send(refers("a", "beginning", "left")), partners.send(refers("b", "end", "left"))]
        for id in "ab":
            await partners.fragment_block(id)
        for id in "ab":
            partners.end(partners.request(id))

        assert [await its(partners, pending) for pending in sent] == [False, True]


async def test_what_an_aborted_turn_has_said_is_named_and_the_rest_is_not(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(refers("a", "full", "left", "right"))
        await partners.fragment_block("a")
        partners.reach("a", "r0-phrase", "end")
        partners.end(partners.request("a"), status="interrupted")
        again = partners.send(refers("b", "full", "left"))
        await partners.fragment_block("b")
        partners.end(partners.request("b"), status="interrupted")
        later = partners.send(refers("c", "full", "left"))
        await partners.fragment_block("c")
        partners.end(partners.request("c"))

        assert await its(partners, again)
        assert not await its(partners, later)  # "b" said nothing


async def test_what_a_refused_fragment_was_to_name_is_not_named(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(refers("a", "beginning", "left"))
        await partners.fragment_block("a")
        partners.refusal = Fault(reason="impossible")
        partners.send(refers("b", "middle", "right"))
        await asyncio.sleep(0.1)
        partners.refusal = None
        last = partners.send(refers("c", "end", "left"))
        await partners.fragment_block("c")
        for id in "ac":
            partners.end(partners.request(id))

        assert await its(partners, last)


async def test_a_refused_turn_leaves_the_one_before_it_the_last(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(refers("a", "full", "left"))
        await partners.fragment_block("a")
        partners.reach("a", "r0-phrase", "end")
        partners.end(partners.request("a"))
        partners.refusal = Fault(reason="impossible")
        partners.send(refers("b", "full", "right"))
        await asyncio.sleep(0.1)
        partners.refusal = None
        last = partners.send(refers("c", "full", "left"))
        await partners.fragment_block("c")
        partners.end(partners.request("c"))

        assert await its(partners, last)
