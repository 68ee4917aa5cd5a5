"""The service on a memory bus: fragment to block to outcome, refusals, turns, in exact virtual time."""

import asyncio

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event, Gaze, Pointing, Reference, Speech, SpeechOption, TurnSignal
from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.messages import encode
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation import fragments
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.requests.ends import Patience, RequestRefused
from engage_hri.services.requests.serving import GRACE
from tests.generation.partners import TABLE, stage

HELLO = Speech(id="s", text="Hello")
THIS = SpeechOption(text="this", cost=1, deictic=True)


def says(id: str, status: str = "full", **fields: object) -> TurnFragment:
    return TurnFragment(id=id, turn_status=status, behaviors=(HELLO,), **fields)  # type: ignore[arg-type]


def refers(id: str = "show", minimum: float = 0.95, target: str = "middle", **fields: object) -> TurnFragment:
    reference = Reference(id="ref", target=target, minimum_reliability=minimum, options=(THIS,))
    return TurnFragment(id=id, behaviors=(HELLO, reference), **fields)  # type: ignore[arg-type]


def now() -> float:
    return asyncio.get_running_loop().time()


# -- from fragment to outcome -------------------------------------------------------------------------------------


async def test_a_fragment_becomes_a_block_and_the_block_an_outcome(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(refers())
        block = await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.event("e", "started", block="show", behavior="ref-event")
        partners.end(partners.request("show"), spoken=(SpokenText(behavior="s", text="Hello"),))
        await asyncio.sleep(1.0)
        undecided = pending.outcome.done()
        partners.event("e", "succeeded", block="show", behavior="ref-event", delay=0.4)
        outcome = await pending.outcome

        assert [type(behavior) for behavior in block.behaviors] == [
            Event, Speech, Gaze, Pointing, Speech, Event, Gaze, Event, TurnSignal,
        ]  # fmt: skip
        assert not undecided
        assert isinstance(outcome, FragmentOutcome)
        assert (outcome.status, outcome.fragment, outcome.warnings) == ("done", "show", ())
        assert [event.state for event in outcome.events] == ["succeeded"]
        assert outcome.choices[0].gesture == "directed_gaze_with_pointing"
        assert outcome.spoken == (SpokenText(behavior="s", text="Hello"),)
        assert now() == 1.0


async def test_the_block_names_the_arm_that_was_estimated(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(refers(target="left"))
        block = await partners.fragment_block("show")

        (point,) = (behavior for behavior in block.behaviors if isinstance(behavior, Pointing))
        assert point.mode == "LEFT_HAND"


async def test_an_event_nobody_decides_delays_the_outcome_only_so_long(hub: MemoryHub) -> None:
    async with stage(hub, GenerationConfig(decision_patience=3.0)) as partners:
        pending = partners.send(refers())
        await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.event("e", "started", block="show", behavior="ref-event")
        partners.end(partners.request("show"))
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.warnings == ("ref-event was never decided",)
        assert now() == 3.0


@pytest.mark.parametrize("gone", ["dropped", "interrupted"])
async def test_an_event_that_is_lost_after_its_start_does_not_delay_the_outcome(hub: MemoryHub, gone: str) -> None:
    """Recognition may refuse it after its start: then nobody will ever decide it."""
    async with stage(hub, GenerationConfig(decision_patience=3.0)) as partners:
        pending = partners.send(refers())
        await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.end(partners.request("show"), **{gone: ("ref-event",)})
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert "ref-event was never decided" not in outcome.warnings
        assert now() == 0.0


async def test_without_recognition_the_realizers_word_counts(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(refers())
        await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.reach("show", "ref-event", "end")
        partners.end(partners.request("show"))
        await pending.outcome

        assert now() == 0.0


async def test_the_outcome_of_a_turn_tells_all_its_events(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        for id, status in [("a", "beginning"), ("b", "end")]:
            pending = partners.send(says(id, status))
            await partners.fragment_block(id)
            if id == "a":
                partners.event("pair", "started", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a")
            partners.event("pair", "succeeded", kind="adjacency_pair", block="a", behavior="turn-pair", turn="a")
            partners.end(partners.request(id))
            outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert [(event.id, event.state) for event in outcome.events] == [("pair", "succeeded")]


async def test_an_outcome_tells_nothing_of_an_earlier_fragment_of_the_same_id(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        outcomes = []
        for event in ("first", "second"):
            pending = partners.send(refers(), id=event)
            await partners.fragment_block("show")
            partners.reach("show", "ref-event", "start")
            partners.event(event, "started", block="show", behavior="ref-event")
            partners.event(
                "first", "succeeded" if event == "first" else "completed", block="show", behavior="ref-event"
            )
            partners.end(partners.request("show"))
            if event == "second":
                await asyncio.sleep(1.0)
                partners.event(event, "failed", block="show", behavior="ref-event")
            outcomes.append(await pending.outcome)
            partners.blocks.clear()

        assert [[(event.id, event.state) for event in outcome.events] for outcome in outcomes] == [
            [("first", "succeeded")],
            [("second", "failed")],
        ]


async def test_turns_are_performed_in_order_one_after_the_other(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        sent = [partners.send(says(id)) for id in ("a", "b")]
        await partners.fragment_block("a")
        await asyncio.sleep(5.0)
        waited = [request.block.id for request in partners.blocks if request.block.id in "ab"]
        partners.end(partners.request("a"))
        await partners.fragment_block("b")
        partners.end(partners.request("b"))
        await asyncio.gather(*(pending.outcome for pending in sent))

        assert waited == ["a"]


async def test_what_cannot_be_made_well_enough_is_warned_of_twice(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(refers(minimum=0.99))
        await partners.fragment_block("show")
        partners.end(partners.request("show"))
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert "0.99" in outcome.warnings[0]
        assert [(it.block, it.message) for it in partners.warnings] == [("show", text) for text in outcome.warnings]


# -- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fragment", "reason"),
    [
        (says("x", "middle"), "no turn open"),
        (says("x", addressee="nobody"), "nobody"),
    ],
)
async def test_a_bad_fragment_is_refused_and_the_next_good_one_performed(
    hub: MemoryHub, fragment: TurnFragment, reason: str
) -> None:
    async with stage(hub) as partners:
        with pytest.raises(RequestRefused, match=reason):
            await partners.send(fragment, "bad").outcome
        good = partners.send(says("good"))
        await partners.fragment_block("good")
        partners.end(partners.request("good"))

        outcome = await good.outcome
        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "done"
        assert [reason in str(fault) for fault in partners.faults] == [True]


async def test_what_the_realizer_refuses_is_refused_whole(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.refusal = Fault(reason="a deadlock", where="a: c", line=4)
        with pytest.raises(RequestRefused, match="line 4: a deadlock"):
            await partners.send(says("a")).outcome
        partners.refusal = None
        good = partners.send(says("b"))
        await partners.fragment_block("b")
        partners.end(partners.request("b"))

        assert await good.outcome


async def test_a_fragment_in_line_that_the_realizer_refuses_has_failed(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a"))
        second = partners.send(says("b"))
        await partners.fragment_block("a")
        partners.refusal = Fault(reason="a deadlock")
        partners.end(partners.request("a"))
        outcome = await second.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert (outcome.status, outcome.fault) == ("failed", Fault(reason="a deadlock", service="realizer"))


async def test_a_fragment_waits_for_the_world_and_not_for_ever(hub: MemoryHub) -> None:
    async with stage(hub, world=None) as partners:
        lost = partners.send(says("lost"))
        with pytest.raises(RequestRefused, match="world is unknown"):
            await lost.outcome
        gave_up = now()
        partners.send(says("early"))
        await asyncio.sleep(1.0)
        partners.see(TABLE)
        await partners.fragment_block("early")

        assert gave_up == 5.0
        assert now() == 6.0


async def test_fragments_that_wait_for_the_world_count_among_those_that_may_wait(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fragments, "FRAGMENTS", 2)
    async with stage(hub, world=None) as partners:
        for id in "ab":
            partners.send(says(id))
        with pytest.raises(RequestRefused, match="2 fragments are waiting or performed, which is the limit"):
            await partners.send(says("c")).outcome
        assert now() == 0.0
        partners.see(TABLE)
        await partners.fragment_block("a")


async def test_a_reference_that_cannot_be_made_fails_its_fragment(hub: MemoryHub) -> None:
    async with stage(hub, GenerationConfig(condition="degraded-generation")) as partners:
        outcome = await partners.send(refers()).outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "failed"
        assert outcome.fault is not None
        assert "no way to refer to middle" in outcome.fault.reason
        assert [request.block.id for request in partners.blocks] == ["maintenance-1"]  # the head alone


# -- what ends a turn early ---------------------------------------------------------------------------------------


async def test_a_cancelled_fragment_interrupts_its_block_and_aborts_its_turn(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        first = partners.send(says("a", "beginning"))
        second = partners.send(says("b", "end"))
        await partners.fragment_block("b")
        partners.requests.cancel("ask-a", "changed my mind")
        outcomes = await asyncio.gather(first.outcome, second.outcome)

        assert [outcome.status for outcome in outcomes] == ["interrupted", "interrupted"]  # type: ignore[attr-defined]
        # The one that follows first: it must not begin because the other ends.
        assert partners.cancelled == [partners.request("b").id, partners.request("a").id]
        assert [(each.signal.signal, each.signal.turn) for each in partners.signals] == [("aborted", "a")]


async def test_a_cancelled_fragment_in_line_is_never_performed(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a"))
        second = partners.send(says("b"))
        third = partners.send(says("c"))
        await partners.fragment_block("a")
        partners.requests.cancel("ask-b")
        outcome = await second.outcome
        partners.end(partners.request("a"))
        await partners.fragment_block("c")
        partners.end(partners.request("c"))
        await third.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "interrupted"
        assert [request.block.id for request in partners.blocks if request.block.id in "abc"] == ["a", "c"]


async def test_a_block_that_fails_ends_the_turn_but_not_the_service(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        failing = partners.send(says("a"))
        await partners.fragment_block("a")
        partners.end(partners.request("a"), "failed", fault=Fault(reason="the arm is stuck"))
        outcome = await failing.outcome
        good = partners.send(says("b"))
        await partners.fragment_block("b")
        partners.end(partners.request("b"))
        await good.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert (outcome.status, outcome.fault) == ("failed", Fault(reason="the arm is stuck", service="realizer"))
        assert [each.signal.signal for each in partners.signals] == ["aborted"]


async def test_a_failure_after_the_turns_end_does_not_take_the_pair_back(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(says("a"))
        await partners.fragment_block("a")
        partners.reach("a", "turn-ended", "start")
        partners.end(partners.request("a"), "failed")
        await pending.outcome
        await asyncio.sleep(1.0)

        assert partners.signals == []


async def test_silence_aborts_an_open_turn(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        partners.end(partners.request("a"))
        await asyncio.sleep(9.9)
        before = len(partners.signals)
        await asyncio.sleep(0.2)
        with pytest.raises(RequestRefused, match="no turn open"):
            await partners.send(says("b", "end")).outcome

        assert before == 0
        assert [partners.bus.local(each.at) for each in partners.signals] == [10.0]


async def test_a_barge_in_interrupts_the_robot(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(says("a"))
        await partners.fragment_block("a")
        await asyncio.sleep(1.0)
        partners.interjects("open")
        await asyncio.sleep(0.8)
        partners.interjects("interruption")
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "interrupted"
        assert now() == 2.5  # a voice without words has to last
        assert [each.signal.signal for each in partners.signals] == ["aborted"]


async def test_what_became_of_a_fragment_is_unknown_once_the_realizer_is_dead(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(says("a"))
        await partners.fragment_block("a")
        hub.kill("realizer")
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.status == "unknown"
        assert now() == Patience().grace


async def test_a_dead_manager_ends_what_it_asked_for(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(says("a"))
        await partners.fragment_block("a")
        hub.kill("manager")
        await asyncio.sleep(GRACE + 0.1)

        assert partners.cancelled == [partners.request("a").id]
        assert [each.signal.signal for each in partners.signals] == ["aborted"]


async def test_a_covered_piece_is_still_spoken_of_and_one_that_has_gone_is_not(hub: MemoryHub) -> None:
    without = World(entities=tuple(entity for entity in TABLE.entities if entity.id != "middle"))
    async with stage(hub, GenerationConfig()) as partners:
        partners.see(without)
        await asyncio.sleep(9.0)
        partners.send(refers("covered"))
        await partners.fragment_block("covered")
        await asyncio.sleep(2.0)

        partners.end(partners.request("covered"))
        gone = partners.send(refers("gone"))
        block = await partners.fragment_block("gone")
        partners.end(partners.request("gone"))
        outcome = await gone.outcome

    assert isinstance(outcome, FragmentOutcome)
    assert outcome.status == "done"
    assert not outcome.references
    assert any("does not know the object 'middle'; only said:" in each for each in outcome.warnings)
    assert not any(isinstance(each, Pointing) for each in block.behaviors)


@pytest.mark.parametrize("part", [float("nan"), float("inf"), 1e308])
async def test_a_world_with_what_is_no_place_is_refused_and_the_last_good_one_used(
    hub: MemoryHub, part: float
) -> None:
    async with stage(hub) as partners:
        with partners.bus.subscribe(keys.fault("generation")) as faults:
            nowhere = World(entities=(replace(TABLE.entities[0], position=(part, 0.0, 0.0)),))
            hub.inject(keys.WORLD, encode(nowhere), "application/msgpack")
            partners.send(refers())
            await partners.fragment_block("show")  # refers to what the last good world holds

            assert "at `$.entities[0].position[0]`" in str(faults._queue[0].message)
