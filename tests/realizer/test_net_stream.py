"""Tokens seen moving: the messages about a block's net, and nothing else, played by the rule of Petri nets."""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, suppress

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event, Gaze, Pointing, Speech, Wait
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    Composition,
    Fired,
    NetMarked,
    NetPlanned,
    NetWaiting,
    PerformBlock,
)
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.perform.net_stream import NetStream
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.words import Spelling
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import FakeRecognition, Stage, after, block, stage, together
from tests.realizer.test_figures import FIGURES

GAZE = Gaze(id="gaze-1", target="can-1")
POINT = Pointing(id="point-1", target="can-1")
SPEECH = Speech(id="speech-1", text="This can?")


class Watcher:
    """One who knows of a block's net only what the stream tells."""

    def __init__(self, block: str = "b") -> None:
        self.block = block
        self.plans: list[NetPlanned] = []
        self.seen: list[frozenset[int]] = []
        """The marking after each message."""
        self.fired: dict[str, float] = {}
        self.is_over = False

    def take(self, message: object) -> None:
        match message:
            case NetPlanned(block=self.block):
                before = self.plans[-1] if self.plans else None
                self.plans.append(message)
                initial = frozenset(n for n, place in enumerate(message.places) if place.kind == "idle")
                played = self._play(message, initial, message.fired)
                assert played == frozenset(message.marked)
                if before is not None and before.transitions == message.transitions:
                    assert message.fired[: len(before.fired)] == before.fired
                self.seen.append(played)
                self.fired = {message.transitions[each.transition].name: each.time for each in message.fired}
            case NetMarked(block=self.block) if self.plans:
                assert not self.is_over
                plan, told = self.plans[-1], (self.seen[-1] | set(message.put)) - set(message.taken)
                if not message.is_over or told:
                    assert self._play(plan, self.seen[-1], message.fired) == told
                self.seen.append(told)
                self.fired |= {plan.transitions[each.transition].name: each.time for each in message.fired}
                self.is_over = message.is_over

    def _play(self, plan: NetPlanned, marking: frozenset[int], fired: Iterable[Fired]) -> frozenset[int]:
        """Fire these transitions, in their order: each takes a token from all places before it, and must find it."""
        tokens = set(marking)
        for one in fired:
            before = {n for n, place in enumerate(plan.places) if place.target == one.transition}
            behind = {n for n, place in enumerate(plan.places) if place.source == one.transition}
            assert before <= tokens, f"{plan.transitions[one.transition].name} is not enabled"
            tokens = (tokens - before) | behind
        return frozenset(tokens)

    def initial(self) -> frozenset[int]:
        return frozenset(n for n, place in enumerate(self.plans[-1].places) if place.kind == "idle")

    def under_way(self, marking: frozenset[int]) -> set[str]:
        """The phases that hold a token, each by the point of its behavior that it begins with."""
        plan = self.plans[-1]
        phases = [plan.places[number] for number in marking if plan.places[number].kind == "phase"]
        return {
            next(str(point) for point in plan.transitions[each.source].points if point.behavior == each.behavior)
            for each in phases
        }

    def ties(self, marking: frozenset[int]) -> set[tuple[str, float]]:
        """The places between instants that hold a token: kind and seconds."""
        plan = self.plans[-1]
        held = [plan.places[number] for number in marking]
        return {(each.kind, each.lag) for each in held if each.kind in ("delay", "order") and not each.behavior}


async def _listen(bus: Bus, watcher: Watcher) -> None:
    with bus.subscribe(keys.NET) as inbox:
        async for received in inbox:
            watcher.take(received.message)


@asynccontextmanager
async def watching(seen: Stage, watcher: Watcher) -> AsyncIterator[None]:
    bus = seen.hub.join(f"watcher-{id(watcher)}")
    listening = asyncio.create_task(_listen(bus, watcher), name="watch the net")
    await asyncio.sleep(0)
    try:
        yield
        await asyncio.sleep(0.1)
    finally:
        listening.cancel()
        with suppress(asyncio.CancelledError):  # not what it found wrong
            await listening
        await bus.leave()


async def watched(example: Block, body: FakeBody | None = None) -> tuple[Watcher, BlockOutcome]:
    watcher = Watcher()
    async with stage(body) as seen, watching(seen, watcher):
        outcome = await seen.perform(example)
    return watcher, outcome


NAMES = {"4.4": "4.8", "4.9": "4.9", "4.10": "4.10", "4.11": "4.11"}
"""Figures of nets by those of blocks: Figure 4.8 is the net of the block of Figure 4.4."""


@pytest.mark.parametrize("slow", [{}, {"point-1": 1.5}, {"gaze-1": 2.0, "speech-1": 0.5}], ids=str)
@pytest.mark.parametrize("figure", NAMES, ids=NAMES.get)
async def test_the_tokens_of_a_figure_are_seen_moving(figure: str, slow: dict[str, float]) -> None:
    example, _, times = FIGURES[figure]
    body = FakeBody({id: Script(slow=factor) for id, factor in slow.items()})

    watcher, outcome = await watched(example, body)

    assert outcome.status == "done"
    assert [each.transition for each in watcher.plans[0].fired][:1] == [0]
    assert watcher.seen[0] == watcher._play(watcher.plans[0], watcher.initial(), watcher.plans[0].fired)
    assert watcher.is_over
    assert watcher.seen[-1] == watcher.initial()
    assert len(set(watcher.seen)) >= 6
    assert watcher.fired.keys() == {each.name for each in watcher.plans[0].transitions}
    if not slow:
        assert {name: watcher.fired[name] for name in times} == pytest.approx(times)


async def test_in_figure_4_8_gaze_and_pointing_go_on_together_then_pointing_and_speech() -> None:
    watcher, _ = await watched(FIGURES["4.4"][0])

    walk = [watcher.under_way(marking) for marking in watcher.seen]
    assert [each for number, each in enumerate(walk) if not number or each != walk[number - 1]] == [
        set(),
        {"gaze-1:start"},
        {"gaze-1:stroke", "point-1:start"},
        {"gaze-1:stroke", "point-1:ready"},
        {"gaze-1:stroke", "point-1:stroke_start", "speech-1:start"},
        {"gaze-1:stroke", "point-1:stroke", "speech-1:start"},
        {"gaze-1:stroke", "point-1:stroke_end", "speech-1:start"},
        {"gaze-1:stroke", "point-1:relax"},
        {"gaze-1:stroke_end"},
        set(),
    ]


async def test_in_figure_4_10_a_token_waits_two_seconds_in_the_delay() -> None:
    watcher, _ = await watched(FIGURES["4.10"][0])

    assert any(("delay", 2.0) in watcher.ties(marking) for marking in watcher.seen)
    assert watcher.fired["speech-1:start"] - watcher.fired["point-1:stroke_start"] == pytest.approx(2.0)


async def test_in_figure_4_9_the_order_holds_a_token_while_speech_is_late() -> None:
    """Speech waits for a second speech; the token from the stroke waits in the order place."""
    first = Speech(id="first", text="Look.")
    example = block((POINT, first, SPEECH), after("point-1:stroke_start", "speech-1:start"))

    watcher, _ = await watched(example, FakeBody({"first": Script(slow=3.0)}))

    plan = watcher.plans[-1]
    names = [each.name for each in plan.transitions]
    order = next(
        number
        for number, place in enumerate(plan.places)
        if (names[place.source], names[place.target]) == ("point-1:stroke_start", "speech-1:start")
    )
    held = [watcher.under_way(marking) for marking in watcher.seen if order in marking]
    assert any("first:start" in each for each in held)
    assert not any("speech-1:start" in each for each in held)
    assert watcher.fired["speech-1:start"] > watcher.fired["point-1:stroke_start"]


@pytest.mark.parametrize("required", [True, False])
async def test_a_block_that_fails_leaves_no_token(required: bool) -> None:
    point = Pointing(id="point-1", target="can-1", required=required)
    example = block((GAZE, point, SPEECH), together("gaze-1:stroke", "point-1:start"))

    watcher, outcome = await watched(example, FakeBody({"point-1": Script(fail="stroke")}))

    assert outcome.status == ("failed" if required else "done")
    assert watcher.is_over
    assert watcher.seen[-1] == (frozenset() if required else watcher.initial())


async def test_a_block_that_is_interrupted_leaves_no_token() -> None:
    watcher = Watcher()
    async with stage() as seen, watching(seen, watcher):
        pending = seen.ask(FIGURES["4.4"][0])
        await seen.seen("point-1:ready")
        assert watcher.seen[-1]
        seen.requests.cancel("r-b")
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert watcher.is_over
    assert watcher.seen[-1] == frozenset()


async def test_what_is_dropped_on_the_way_is_gone_from_the_net_and_the_others_keep_their_places() -> None:
    body = FakeBody({"point-1": Script(fail="stroke")})

    watcher, outcome = await watched(FIGURES["4.4"][0], body)

    assert outcome.dropped == ("point-1",)
    first, *later = watcher.plans
    anew = next(each for each in later if each.transitions != first.transitions)
    assert {each.behavior for each in first.places} == {"", "gaze-1", "point-1", "speech-1"}
    assert {each.behavior for each in anew.places} == {"", "gaze-1", "speech-1"}
    names = {anew.transitions[each.transition].name for each in anew.fired}
    assert {"gaze-1:stroke", "speech-1:start"} <= names
    held = {
        (anew.places[n].behavior, anew.transitions[anew.places[n].source].name)
        for n in anew.marked
        if anew.places[n].kind == "phase"
    }
    assert held == {("gaze-1", "gaze-1:stroke"), ("speech-1", "speech-1:start")}
    assert watcher.seen[-1] == watcher.initial()


async def test_a_net_that_is_planned_anew_several_times_in_a_moment_is_told_once() -> None:
    plans = [plan_block(block((GAZE, POINT, SPEECH)[:count])) for count in (3, 2, 1)]
    async with MemoryHub() as hub:
        bus, watcher = hub.join("realizer"), Watcher()
        listening = asyncio.create_task(_listen(hub.join("watcher"), watcher), name="watch the net")
        await asyncio.sleep(0)
        stream = NetStream(bus, "b", Spelling(plans[0].block))
        for plan in plans:
            stream.planned(plan, RunningNet(plan.net, plan.members, plan.at), bus.now())
        await asyncio.sleep(0.1)
        stream.close()
        listening.cancel()
        with suppress(asyncio.CancelledError):
            await listening
    sizes = [len(each.transitions) for each in watcher.plans]
    assert sizes == [len(plans[0].net.transitions), len(plans[2].net.transitions)]


async def test_the_net_spells_points_as_the_block_does() -> None:
    watcher, _ = await watched(replace(block((GAZE, POINT)), dialect="bml-1.0"))

    syncs = [(each.behavior, each.sync) for instant in watcher.plans[0].transitions for each in instant.points]
    assert sorted(sync for id, sync in syncs if id == "gaze-1") == ["end", "ready", "relax", "start"]
    assert ("point-1", "strokeStart") in syncs
    assert len(syncs) == len(set(syncs))


async def test_what_fires_in_the_moment_of_a_new_plan_is_told_once() -> None:
    """With the number that it has in the new net."""
    body = FakeBody({"point-1": Script(fail="ready")})

    watcher, outcome = await watched(block((GAZE, POINT, SPEECH)), body)

    assert outcome.dropped == ("point-1",)
    anew = watcher.plans[1]
    told = [anew.transitions[each.transition].name for each in anew.fired]
    assert "gaze-1:stroke" in told
    assert {each.transition for each in anew.fired} > {each.transition for each in watcher.plans[0].fired}
    assert watcher.seen[-1] == watcher.initial()


async def test_who_comes_late_knows_all_within_two_seconds() -> None:
    early, late = Watcher(), Watcher()
    async with stage() as seen, watching(seen, early):
        await asyncio.sleep(3.0)  # times are the block's own, not those of the clock
        pending = seen.ask(FIGURES["4.4"][0])
        await seen.seen("point-1:stroke_start")
        async with watching(seen, late):
            await seen.seen("point-1:end")
            assert late.plans
            assert late.seen[-1] == early.seen[-1]
            assert late.fired == early.fired
            await pending.outcome

    assert (late.is_over, late.seen[-1], late.fired) == (True, early.seen[-1], early.fired)


async def test_a_net_is_told_no_more_when_its_block_has_ended() -> None:
    watcher = Watcher()
    async with stage() as seen, watching(seen, watcher):
        await seen.perform(FIGURES["4.9"][0])
        count = len(watcher.seen)
        await asyncio.sleep(10.0)

    assert watcher.is_over
    assert len(watcher.seen) == count


# -- blocks that wait for their turn ---------------------------------------------------------------------------------


async def told_of_turn(*asked: tuple[float, Block], stops: float | None = None) -> list[tuple[float, object]]:
    """What is told of the last block: its messages with their times. stops: when it is cancelled."""
    told: list[tuple[float, object]] = []
    name, loop = asked[-1][1].id, asyncio.get_running_loop()

    async def listen(bus: Bus) -> None:
        with bus.subscribe(keys.NET) as inbox:
            async for received in inbox:
                if getattr(received.message, "block", "") == name:
                    told.append((round(loop.time(), 2), received.message))

    async with stage() as seen:
        listening = asyncio.create_task(listen(seen.hub.join("listener")))
        pending = []
        for at, each in asked:
            await asyncio.sleep(at - loop.time())
            pending.append(seen.ask(each))
        if stops is not None:
            await asyncio.sleep(stops - loop.time())
            seen.requests.cancel(pending[-1].request.id, "no more")
        for one in pending:
            await one.outcome
        await asyncio.sleep(0.2)
        listening.cancel()
        await asyncio.wait([listening])
    return told


def waits(id: str, seconds: float, composition: Composition = "MERGE") -> Block:
    return Block(id=id, behaviors=(Wait(id="w", duration=seconds),), composition=composition)


async def test_a_block_that_waits_for_its_turn_tells_for_whom_and_again_for_who_comes_late() -> None:
    told = await told_of_turn((0.0, waits("a", 3.0)), (0.0, waits("b", 5.2)), (0.5, waits("c", 1.0, "APPEND")))

    waiting = [(at, each.since.seconds, each.waits_for) for at, each in told if isinstance(each, NetWaiting)]
    assert waiting == [
        (0.5, 0.5, ("a", "b")), (2.5, 0.5, ("a", "b")), (3.0, 0.5, ("b",)), (5.0, 0.5, ("b",)), (5.2, 0.5, ()),
    ]  # fmt: skip
    assert isinstance(told[5][1], NetPlanned)
    assert told[5][0] == 5.2
    assert not any(isinstance(each, NetWaiting) for _, each in told[5:])


async def test_a_block_that_ends_while_it_waits_for_its_turn_is_told_to_be_over() -> None:
    told = await told_of_turn((0.0, waits("a", 3.0)), (0.5, waits("c", 1.0, "APPEND")), stops=1.5)

    assert [(at, type(each)) for at, each in told] == [(0.5, NetWaiting), (1.5, NetMarked)]
    assert told[-1][1] == NetMarked(block="c", is_over=True)


@pytest.mark.parametrize(
    "asked", [((0.0, waits("c", 1.0, "APPEND")),), ((0.0, waits("a", 3.0)), (0.5, waits("c", 1.0)))]
)
async def test_a_block_that_need_not_wait_tells_of_no_turn(asked: tuple[tuple[float, Block], ...]) -> None:
    told = await told_of_turn(*asked)

    assert isinstance(told[0][1], NetPlanned)
    assert not any(isinstance(each, NetWaiting) for _, each in told)


class Tokens(Watcher):
    """Sees only where tokens are, whatever moved them."""

    def take(self, message: object) -> None:
        match message:
            case NetPlanned():
                self.plans.append(message)
                self.seen.append(frozenset(message.marked))
            case NetMarked():
                self.seen.append((self.seen[-1] | set(message.put)) - set(message.taken))
                self.is_over = message.is_over


async def test_a_block_that_is_over_holds_the_tokens_that_it_began_with_though_an_event_goes_on() -> None:
    """Recognition follows the event from then on; nobody has looked yet."""
    watcher = Tokens()
    event = Event(id="e", kind="directed_gaze", responder="human", objects=("can",))
    async with stage(recognition=FakeRecognition({"e": None})) as seen, watching(seen, watcher):
        outcome = await seen.perform(block((SPEECH, event)))

    assert (outcome.status, "e:end" in seen.times()) == ("done", False)
    assert watcher.is_over
    assert "e:start" in watcher.under_way(watcher.seen[-2])
    assert watcher.seen[-1] == watcher.initial()


async def test_the_net_has_the_words_that_the_block_is_to_say_and_what_it_follows() -> None:
    watcher, _ = await watched(block((GAZE, SPEECH)))
    assert [(each.behavior, each.text) for each in watcher.plans[0].speeches] == [("speech-1", "This can?")]
    async with stage() as seen, watching(seen, follower := Watcher("second")):
        first = seen.ask(block((SPEECH,)))
        request = PerformBlock(id="r-2", block=replace(block((SPEECH,)), id="second"), follows=("b",))
        await seen.requests.send(keys.BLOCK, request).outcome
        await first.outcome
    assert follower.plans[0].follows == ("b",)
