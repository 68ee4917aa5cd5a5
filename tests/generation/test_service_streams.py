"""Streamed fragments against partners played by hand: what is sent when, races with the realizer, turns' outcomes."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Reference, Speech, SpeechOption
from engage_hri.schemas.blocks import Block, SpokenText
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed, TurnFragment
from engage_hri.schemas.requests import Cancel
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.requests.ends import RequestRefused
from tests.generation.emitted import lines
from tests.generation.partners import Partners, stage

IT = SpeechOption(text="it", cost=1)


def says(id: str, status: str, text: str = "words") -> TurnFragment:
    return TurnFragment(id=id, turn_status=status, behaviors=(Speech(id="s", text=text),))  # type: ignore[arg-type]


def refers(id: str, status: str, target: str) -> TurnFragment:
    reference = Reference(id="ref", target=target, minimum_reliability=0.75, options=(IT,))
    return TurnFragment(id=id, turn_status=status, behaviors=(reference,))  # type: ignore[arg-type]


@asynccontextmanager
async def listening(partners: Partners) -> AsyncIterator[list[tuple[float, TurnClosed]]]:
    """Outcomes of turns, and when they came."""
    closed: list[tuple[float, TurnClosed]] = []

    async def listen() -> None:
        with partners.bus.subscribe(keys.TURN_CLOSED) as inbox:
            async for received in inbox:
                assert isinstance(received.message, TurnClosed)
                closed.append((asyncio.get_running_loop().time(), received.message))

    task = asyncio.create_task(listen())
    await asyncio.sleep(0)
    yield closed
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def spoken(partners: Partners, block: str, text: str = "words") -> None:
    partners.end(partners.request(block), spoken=(SpokenText(behavior="s", text=text),))


# -- what is sent when --------------------------------------------------------------------------------------------


async def test_the_next_fragment_of_a_turn_is_sent_at_once_and_follows_the_words_before_it(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        for id, status in (("a", "beginning"), ("b", "middle"), ("c", "end")):
            partners.send(says(id, status))
        blocks = [await partners.fragment_block(id) for id in "abc"]

        assert [[line for line in lines(block) if line.startswith("s:start")] for block in blocks] == [
            [],
            ["s:start after a:s:end"],
            ["s:start after b:s:end"],
        ]
        assert asyncio.get_running_loop().time() == 0.0


async def test_a_fragment_is_not_to_be_performed_without_those_of_its_turn_that_go_on(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        for id, status in (("a", "beginning"), ("b", "middle"), ("c", "end")):
            partners.send(says(id, status))
            await partners.fragment_block(id)
            if id == "a":
                partners.reach("a", "s", "end")

        assert [partners.request(id).follows for id in "abc"] == [(), ("a",), ("a", "b")]


async def test_words_that_have_been_said_are_not_waited_for(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        partners.reach("a", "s", "end")
        partners.send(says("b", "end"))

        assert lines(await partners.fragment_block("b")) == ["turn-gaze:stroke = s:end"]


async def test_a_reference_costs_what_it_takes_from_where_the_fragments_before_it_leave_the_head(
    hub: MemoryHub,
) -> None:
    async with stage(hub, costs={"head": 20.0, "arm": 60.0}) as partners:
        targets = {"a": "left", "b": "left", "c": "middle", "d": "middle"}
        sent = [
            partners.send(refers(id, "middle" if id != "a" else "beginning", target))
            for id, target in targets.items()
            if id != "d"
        ]
        for id in "abc":
            await partners.fragment_block(id)
            partners.reach(id, "ref-phrase", "start")  # till then the reference may be chosen again
        for id in "abc":
            partners.end(partners.request(id))
        sent.append(partners.send(refers("d", "end", "middle")))  # nothing moves any more
        await partners.fragment_block("d")
        partners.end(partners.request("d"))
        outcomes = [await pending.outcome for pending in sent]

        made = [outcome.choices[0] for outcome in outcomes if isinstance(outcome, FragmentOutcome)]
        assert [choice.gesture for choice in made] == ["gaze"] * 4
        # One word, 0.35 s; twenty degrees of the head, 0.2 s.
        assert [round(choice.cost, 6) for choice in made] == [0.55, 0.35, 0.55, 0.55]


async def test_what_the_realizer_refuses_is_no_part_of_the_turn_and_the_turn_goes_on(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        partners.refusal = Fault(reason="a deadlock")
        for status in ("middle", "end"):
            with pytest.raises(RequestRefused, match="a deadlock"):
                await partners.send(says(f"bad-{status}", status)).outcome
        partners.refusal = None
        partners.send(says("c", "end"))
        block = await partners.fragment_block("c")

        assert "s:start after a:s:end" in lines(block)
        assert partners.cancelled == []
        assert partners.signals == []


async def test_each_fragment_has_its_outcome_when_its_own_block_is_over(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        first, second = (partners.send(says(id, status)) for id, status in (("a", "beginning"), ("b", "end")))
        await partners.fragment_block("b")
        spoken(partners, "b")
        outcome = await second.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert (outcome.fragment, outcome.status, first.outcome.done()) == ("b", "done", False)


async def test_a_fragment_that_fails_before_its_block_tells_recognition_of_the_turn_that_had_begun(
    hub: MemoryHub,
) -> None:
    async with stage(hub, GenerationConfig(condition="degraded-generation")) as partners:
        partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        deictic = SpeechOption(text="this", cost=1, deictic=True)
        reference = Reference(id="ref", target="left", minimum_reliability=0.9, options=(deictic,))
        fragment = TurnFragment(id="b", turn_status="end", behaviors=(reference,))
        outcome = await partners.send(fragment).outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "failed"
        await asyncio.sleep(0.1)
        assert [(each.signal.signal, each.signal.turn) for each in partners.signals] == [("aborted", "a")]


async def test_what_is_cancelled_with_a_fragment_that_failed_is_told_the_cause_of_that(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        with partners.bus.subscribe(keys.cancel("realizer")) as inbox:
            for id, status in (("a", "beginning"), ("b", "end")):
                partners.send(says(id, status))
                await partners.fragment_block(id)
            gone = Fault(reason="control has left", cause="gone", whose="control")
            partners.end(partners.request("a"), "failed", fault=gone)
            received = await inbox.next()

        assert received is not None
        cancel = received.message
        assert isinstance(cancel, Cancel)
        assert (cancel.id, cancel.reason) == (partners.request("b").id, "a failed")
        assert (cancel.cause, cancel.whose) == ("gone", "control")


async def test_a_turn_that_never_began_is_not_aborted_aloud(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a", "full"))
        partners.send(says("b", "full"))
        await partners.fragment_block("a")
        partners.requests.cancel("ask-b")
        await asyncio.sleep(1.0)

        assert partners.signals == []


# -- the outcome of a turn ----------------------------------------------------------------------------------------


async def test_the_outcome_of_a_turn_repeats_what_became_of_its_pair(hub: MemoryHub) -> None:
    async with stage(hub) as partners, listening(partners) as closed:
        for id, status in (("a", "beginning"), ("b", "end")):
            pending = partners.send(says(id, status))
            await partners.fragment_block(id)
        partners.event("pair", "started", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a")
        for id in "ab":
            spoken(partners, id, f"words of {id}")
        outcome = await pending.outcome
        await asyncio.sleep(3.0)
        before = list(closed)
        partners.event("pair", "succeeded", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a")
        await asyncio.sleep(1.0)

        assert isinstance(outcome, FragmentOutcome)
        assert [event.state for event in outcome.events] == ["started"]  # it does not wait for the answer
        assert before == []
        ((at, turn),) = closed
        assert at == 3.0
        assert (turn.turn, turn.addressee, turn.status, turn.fragments) == ("a", "human", "done", ("a", "b"))
        assert [event.state for event in turn.events] == ["succeeded"]
        assert turn.spoken == (
            SpokenText(behavior="a:s", text="words of a"),
            SpokenText(behavior="b:s", text="words of b"),
        )


async def test_a_turn_without_a_pair_is_closed_with_its_last_outcome(hub: MemoryHub) -> None:
    async with stage(hub) as partners, listening(partners) as closed:
        partners.send(says("a", "full"))
        await partners.fragment_block("a")
        await asyncio.sleep(2.0)
        spoken(partners, "a")
        await asyncio.sleep(1.0)

        assert [(at, turn.turn, turn.events) for at, turn in closed] == [(2.0, "a", ())]


async def test_an_answer_that_nobody_decides_is_waited_for_only_so_long(hub: MemoryHub) -> None:
    async with stage(hub, GenerationConfig(decision_patience=3.0)) as partners, listening(partners) as closed:
        partners.send(says("a", "full"))
        await partners.fragment_block("a")
        partners.event("pair", "started", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a", limit=4.0)
        spoken(partners, "a")
        await asyncio.sleep(20.0)

        assert [(at, turn.status, [event.state for event in turn.events]) for at, turn in closed] == [
            (7.0, "done", ["started"])
        ]


async def test_a_turn_of_the_same_name_closes_the_one_that_still_waits(hub: MemoryHub) -> None:
    async with stage(hub) as partners, listening(partners) as closed:
        for number in (1, 2):
            pending = partners.send(says("a", "full"), f"ask-{number}")
            await asyncio.sleep(1.0)
            partners.event(
                f"pair-{number}", "started", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a"
            )
            partners.end(partners.blocks[-1])
            await pending.outcome
        partners.event("pair-2", "failed", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a")
        await asyncio.sleep(1.0)

        assert [[(event.id, event.state) for event in turn.events] for _, turn in closed] == [
            [("pair-1", "started")],
            [("pair-2", "failed")],
        ]


async def test_an_aborted_turn_says_why_and_what_was_said(hub: MemoryHub) -> None:
    async with stage(hub) as partners, listening(partners) as closed:
        partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        spoken(partners, "a")
        await asyncio.sleep(11.0)

        assert [(at, turn.status, turn.reason, len(turn.spoken)) for at, turn in closed] == [
            (10.0, "aborted", "silence for 10 s", 1)
        ]


async def test_a_backchannel_is_no_turn_and_neither_is_what_was_refused(hub: MemoryHub) -> None:
    async with stage(hub) as partners, listening(partners) as closed:
        partners.refusal = Fault(reason="a deadlock")
        with pytest.raises(RequestRefused):
            await partners.send(says("a", "full")).outcome
        partners.refusal = None
        partners.send(says("b", "backchannel", "mhm"))
        await partners.fragment_block("b")
        spoken(partners, "b")
        await asyncio.sleep(20.0)

        assert closed == []


async def test_a_backchannel_may_come_as_soon_as_the_turns_end_is_signalled(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a", "full"))
        await partners.fragment_block("a")
        with pytest.raises(RequestRefused, match="holds the turn"):
            await partners.send(says("b", "backchannel", "mhm")).outcome
        partners.reach("a", "turn-ended", "start")
        accepted = partners.send(says("c", "backchannel", "mhm"))
        await accepted.accepted
        partners.end(partners.request("a"))
        block = await partners.fragment_block("c")

        assert isinstance(block, Block)
