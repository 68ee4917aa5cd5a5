"""Random streams of blocks beside each other: nobody loses a part in silence, and ties to other blocks hold.

The oracle knows no plans: it looks at what was sent, at what the body was made to do, and at what feedback said.
"""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Literal

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    Speech,
    Timing,
)
from engage_hri.schemas.blocks import Block, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body import PerformBehavior
from engage_hri.schemas.references import SyncRef
from engage_hri.services.control.config import Variability
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, parts_of, type_of
from tests.realizer.stage import Stage, stage
from tests.realizer.test_simulated_body import Robot, robot

KINDS: tuple[BlockBehavior, ...] = (
    Speech(id="s", text="one two", marks=(Mark("m", 3),)),
    Speech(id="t", text="three"),
    Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND"),
    Gesture(id="o", lexeme="WAVE"),
    Gesture(id="b", lexeme="BEAT", mode="BOTH_HANDS"),
    Pointing(id="p", target="a", mode="LEFT_HAND"),
    Gaze(id="g", target="a"),
    Gaze(id="h", target="b"),
    Head(id="n", lexeme="NOD"),
    FaceLexeme(id="f", lexeme="SMILE"),
    Posture(id="u", stance="STANDING"),
)
Times = dict[tuple[str, str, str], float]
"""When each point was reached: block, behavior, sync point."""
EXACT = 1e-4
"""Seconds by which times may differ."""
NOTICED = 0.1 + EXACT
"""Seconds by which a tie may be missed without a word (`SKEW`)."""


class Sent(Struct, frozen=True):
    """A block and when it is sent."""

    at: float
    block: Block


@st.composite
def streams(draw: st.DrawFn) -> tuple[Sent, ...]:
    """Two to four blocks; behaviors without a time, with a fixed one, tied to others of their block or an earlier."""
    story: list[Sent] = []
    at = 0.0
    for number in range(draw(st.integers(2, 4))):
        kinds = draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=4, unique_by=lambda each: each.id))
        behaviors = []
        for place, kind in enumerate(kinds):
            refs = ["", "", "", "0", "1"]
            refs += [f"{each.id}:{sync}" for each in kinds[:place] for sync in ("start", "end")]
            for sent in story:
                refs += [f"{sent.block.id}:bml:end+0.25"]
                refs += [
                    f"{sent.block.id}:{each.id}:{sync}" for each in sent.block.behaviors for sync in ("start", "end")
                ]
            ref = draw(st.sampled_from(refs))
            points = [sync for sync in sync_points(kind) if sync in ("start", "stroke")]
            sync = draw(st.sampled_from(points))
            behaviors.append(replace(kind, timing=(Timing(sync, ref),) if ref else ()))
        composition: Literal["MERGE", "APPEND"] = draw(st.sampled_from(("MERGE", "MERGE", "MERGE", "APPEND")))
        block = Block(id=f"b{number}", behaviors=tuple(behaviors), composition=composition)
        story.append(Sent(at, block))
        at += draw(st.sampled_from((0.0, 0.25, 1.0, 2.5)))
    return tuple(story)


class Watched(FakeBody):
    """A body that remembers what it took a part from, and how far that had come."""

    def __init__(self) -> None:
        super().__init__()
        self.performed: dict[tuple[str, str], BlockBehavior] = {}
        self.taken: list[tuple[PerformBehavior, PerformBehavior, tuple[str, ...]]] = []

    def _take_over(self, perform: PerformBehavior) -> None:
        self.performed[perform.block, perform.behavior.id] = perform.behavior
        mine = set(parts_of(perform.behavior))
        for act in self.acts.values():
            if type_of(perform.behavior) not in ("speech", "head") and mine.intersection(
                parts_of(act.perform.behavior)
            ):
                self.taken.append((act.perform, perform, tuple(act.passed)))
        super()._take_over(perform)


async def sent(story: Sequence[Sent], seen: Stage | Robot) -> None:
    """All blocks, each at its time, to their ends."""
    now, pending = 0.0, []
    for each in story:
        await asyncio.sleep(each.at - now)
        now = each.at
        pending.append(seen.ask(each.block).outcome)
    ended = asyncio.gather(*pending, return_exceptions=True)
    for outcome in await asyncio.wait_for(ended, 200.0):
        assert not isinstance(outcome, BaseException) or isinstance(outcome, RequestRefused), outcome


def times_of(feedback: Sequence[object]) -> Times:
    said = [each for each in feedback if isinstance(each, SyncPointProgress)]
    return {(each.block, each.behavior, each.sync): each.at.seconds for each in said}


def overlaps(performed: Mapping[tuple[str, str], BlockBehavior], times: Times) -> Iterator[str]:
    """Behaviors of different blocks that had one part at the same time, up to the ends of their strokes."""
    had: list[tuple[str, str, set[str], float, float]] = []
    for (block, _), each in performed.items():
        last = "stroke_end" if isinstance(each, Gesture | Pointing | Head) else "end"
        since, to = (times.get((block, each.id, sync)) for sync in ("start", last))
        if since is not None and to is not None:
            had.append((block, each.id, set(parts_of(each)), since, to))
    for (block_id, id, parts, since, to), other in combinations(had, 2):
        if block_id != other[0] and parts & other[2] and since < other[4] - EXACT and other[3] < to - EXACT:
            yield f"{block_id}:{id} and {other[0]}:{other[1]}"


def untied(story: Sequence[Sent], times: Times, warned: set[tuple[str, str]]) -> Iterator[str]:
    """Ties to other blocks that did not hold, with both points reached, and nobody was warned of."""
    for one in story:
        for each in one.block.behaviors:
            for timing in each.timing:
                ref = SyncRef.parse(timing.ref) if ":" in timing.ref else None
                if ref is None or not ref.block or (one.block.id, each.id) in warned:
                    continue
                own, other = (
                    times.get((one.block.id, each.id, timing.sync)),
                    times.get((ref.block, ref.behavior, ref.sync)),
                )
                if own is not None and other is not None and abs(own - other - ref.offset) > NOTICED:
                    yield f"{one.block.id}:{each.id}:{timing.sync} at {own}, {timing.ref} at {other}"


def with_ends(seen: Stage | Robot) -> Times:
    ends = {(each.block, "bml", "end"): each.at.seconds for each in seen.ends()}
    return times_of(seen.feedback) | ends  # type: ignore[return-value]


@settings(max_examples=share_of(60), deadline=None)
@given(streams())
def test_nobody_loses_a_part_to_another_block_in_silence(story: tuple[Sent, ...]) -> None:
    async def main() -> None:
        body = Watched()
        async with stage(body) as seen:
            await sent(story, seen)
        warned = {(each.block or "", each.behavior) for each in seen.warnings()}
        for loser, taker, passed in body.taken:
            needed = "stroke_end" if type_of(loser.behavior) in ("gesture", "pointing") else "stroke"
            is_told = (loser.block, loser.behavior.id) in warned
            is_own_fault = loser.block == taker.block
            assert is_own_fault or needed in passed or is_told, (loser.behavior, taker.behavior, passed)
        times = with_ends(seen)
        assert list(overlaps(body.performed, times)) == []
        assert list(untied(story, times, warned)) == []

    run_virtual(main())


@settings(max_examples=share_of(20), deadline=None)
@given(streams())
def test_blocks_share_the_simulated_body(story: tuple[Sent, ...]) -> None:
    async def main() -> None:
        async with robot(Variability()) as seen:
            await sent(story, seen)
            said = [each for each in seen.feedback if isinstance(each, WarningFeedback)]
            warned = {(each.block or "", each.behavior) for each in said}
            times = with_ends(seen)
        sent_out = {
            (sent.block.id, each.id): each for sent in story for each in sent.block.behaviors if each.id != "o"
        }
        assert list(overlaps(sent_out, times)) == []  # `o` may use either arm
        assert list(untied(story, times, warned)) == []

    run_virtual(main())
