"""Several live blocks at once, whatever goes wrong: each ends exactly once, the body ends safe, nothing is left.

They take each other's parts, wait for each other's points, follow and replace each other; behaviors fail, stall, are
refused or interrupted; blocks are cancelled.
"""

import asyncio
from collections import Counter
from collections.abc import Callable, Sequence

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    FaceLexeme,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    Speech,
    Synchronize,
    Wait,
)
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    Block,
    BlockOutcome,
    BlockProgress,
    InterruptBehavior,
    SyncPointProgress,
)
from engage_hri.schemas.references import SyncRef
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script, parts_of
from tests.realizer.stage import Stage, stage
from tests.realizer.test_simulated_body import FAULTS, robot

KINDS: tuple[BlockBehavior, ...] = (
    Gaze(id="g", target="a"),
    Gaze(id="g2", target="b"),
    GazeShift(id="look", target="human"),
    Pointing(id="left", target="a", mode="LEFT_HAND"),
    Pointing(id="any", target="b"),
    Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"),
    Head(id="nod", lexeme="NOD"),
    FaceLexeme(id="face", lexeme="SMILE"),
    Posture(id="lean", lexeme="LEAN_FORWARD"),
    Speech(id="s", text="one two", marks=(Mark("m", 3),)),
    Speech(id="s2", text="three"),
    Wait(id="w", duration=0.75),
)
OFFSETS = (-1.0, 0.0, 0.0, 0.0, 0.5)
PATIENCE = 600.0


class Sent(Struct, frozen=True):
    """A block, when it is sent, and when it is cancelled or one of its behaviors is interrupted."""

    block: Block
    at: float
    cancelled: float | None = None
    interrupted: tuple[str, float] | None = None


@st.composite
def several(draw: st.DrawFn) -> tuple[Sent, ...]:
    """Two to five, close to each other in time. Their constraints name points of their own and of earlier ones."""
    sent: list[Sent] = []
    at = 0.0
    for number in range(draw(st.integers(2, 5))):
        chosen = draw(st.lists(st.sampled_from(KINDS), max_size=4, unique_by=lambda each: each.id))
        own = [SyncRef(behavior=each.id, sync=sync) for each in chosen for sync in sync_points(each)]
        others = [
            SyncRef(block=other.block.id, behavior=each.id, sync=sync)
            for other in sent
            for each in other.block.behaviors
            for sync in sync_points(each)
        ]
        operators: list[Synchronize | After | Before] = []
        for _ in range(draw(st.integers(0, 3)) if own else 0):
            kind = draw(st.sampled_from((Synchronize, After, Before)))
            ref = draw(st.sampled_from(own + others))
            operators.append(kind(ref=_text(draw, ref), syncs=(_text(draw, draw(st.sampled_from(own))),)))
        required = draw(st.sampled_from((None, None, *chosen)))
        block = Block(
            id=f"b{number}",
            behaviors=tuple(replace(each, required=each is required) for each in chosen),
            constraints=(Constraint(operators=tuple(operators)),),
            composition=draw(st.sampled_from(("MERGE", "MERGE", "MERGE", "APPEND", "REPLACE"))),
        )
        moment = st.sampled_from((0.0, 0.2, 0.6, 1.5))
        named = draw(st.sampled_from((None, None, *chosen)))
        sent.append(
            Sent(
                block,
                at,
                cancelled=at + draw(moment) if draw(st.integers(0, 4)) == 0 else None,
                interrupted=(named.id, at + draw(moment)) if named is not None else None,
            )
        )
        at += draw(st.sampled_from((0.0, 0.0, 0.3, 1.0, 2.5)))
    return tuple(sent)


def _text(draw: st.DrawFn, ref: SyncRef) -> str:
    return str(replace(ref, offset=draw(st.sampled_from(OFFSETS))))


async def play(
    story: Sequence[Sent], ask: Callable[[Block], Pending], requests: Requester
) -> dict[str, BlockOutcome]:
    """Send them all, and disturb them; the outcomes of those that were not refused."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    pending: dict[str, Pending] = {}
    interruptions: list[Pending] = []

    def interrupt(block: str, behavior: str) -> None:
        request = InterruptBehavior(id=f"i-{block}", requester="test", block=block, behavior=behavior)
        interruptions.append(requests.send(keys.BLOCK, request))

    deeds: list[tuple[float, int, Callable[[], object]]] = []
    for each in story:
        deeds.append((each.at, 0, lambda each=each: pending.update({each.block.id: ask(each.block)})))
        if each.cancelled is not None:
            deeds.append((each.cancelled, 1, lambda each=each: requests.cancel(f"r-{each.block.id}")))
        if each.interrupted is not None:
            id, at = each.interrupted
            deeds.append((at, 2, lambda each=each, id=id: interrupt(each.block.id, id)))
    for at, _, deed in sorted(deeds, key=lambda it: it[:2]):
        await asyncio.sleep(began + at - loop.time())
        deed()
    everything = [it.outcome for it in (*pending.values(), *interruptions)]
    await asyncio.wait_for(asyncio.gather(*everything, return_exceptions=True), PATIENCE)
    for it in interruptions:
        assert isinstance(it.outcome.exception() or it.outcome.result(), BehaviorInterrupted | RequestRefused)
    found = {}
    for id, asked in pending.items():
        if (error := asked.outcome.exception()) is None:
            outcome = asked.outcome.result()
            assert isinstance(outcome, BlockOutcome)
            found[id] = outcome
        else:
            assert isinstance(error, RequestRefused)
    return found


def check_feedback(story: Sequence[Sent], outcomes: dict[str, BlockOutcome], feedback: Sequence[object]) -> None:
    """One end for each block that began, in its points' order, and all of them for what was performed to its end."""
    said = [each for each in feedback if isinstance(each, SyncPointProgress)]
    points = {}
    for each in said:
        points.setdefault((each.block, each.behavior), []).append(each.sync)
    for sent in story:
        outcome = outcomes.get(sent.block.id)
        for behavior in sent.block.behaviors:
            expected = list(sync_points(behavior))
            seen = points.get((sent.block.id, behavior.id), [])
            assert seen == expected[: len(seen)], (sent.block.id, behavior.id, seen)
            if outcome is not None and outcome.status == "done":
                is_lost = behavior.id in (*outcome.dropped, *outcome.interrupted)
                assert is_lost or seen == expected, (sent.block.id, behavior.id, seen)


SCRIPTS = st.dictionaries(
    st.sampled_from([each.id for each in KINDS]),
    st.sampled_from(
        (
            Script(slow=2.0),
            Script(slow=4.0),
            Script(slow=0.5),
            Script(refuse=True),
            Script(fail="end"),
            Script(fail="stroke"),
            Script(stall="end"),
            Script(stall="stroke_start"),
        )
    ),
    max_size=4,
)


@settings(max_examples=share_of(60), deadline=None)
@given(several(), SCRIPTS, st.booleans())
def test_many_blocks_end_once_each_on_any_body(
    story: tuple[Sent, ...], scripts: dict[str, Script], pauses: bool
) -> None:
    async def main() -> None:
        async with stage(FakeBody(scripts, pauses=pauses)) as seen:
            outcomes = await play(story, seen.ask, seen.requests)
            await asyncio.sleep(1.0)

            ends = Counter(each.block for each in seen.ends())
            assert max(ends.values(), default=1) == 1
            assert ends.keys() <= outcomes.keys()
            check_feedback(story, outcomes, seen.feedback)
            assert seen.body.acts == {}
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_virtual(main())


@settings(max_examples=share_of(30), deadline=None)
@given(several(), FAULTS)
def test_many_blocks_leave_the_robot_safe(story: tuple[Sent, ...], faults: object) -> None:
    async def main() -> None:
        async with robot(faults) as seen:  # type: ignore[arg-type]
            outcomes = await play(story, seen.ask, seen.requests)
            await asyncio.sleep(10.0)

            ends = Counter(each.block for each in seen.ends())
            assert max(ends.values(), default=1) == 1
            assert ends.keys() <= outcomes.keys()
            assert seen.away_from_home() == {}
            assert not seen.body.state().moving
            assert seen.body.moves.runs == {}
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_virtual(main())


def broken(story: Sequence[Sent], seen: Stage) -> list[str]:
    """Constraints of blocks nobody was warned of that do not hold, though all their points were while both lived.

    And though nobody took any of their parts.
    """
    times: dict[tuple[str, str, str], float] = {}
    for said in seen.feedback:
        if isinstance(said, SyncPointProgress):
            times[said.block, said.behavior, said.sync] = said.at.seconds
    lives: dict[tuple[str | None, str], float] = {
        (said.block, said.progress): said.at.seconds for said in seen.feedback if isinstance(said, BlockProgress)
    }
    users = Counter(
        (part, sent.block.id) for sent in story for each in sent.block.behaviors for part in parts_of(each)
    )
    parts = Counter(part for part, _ in users)
    disputed = {block for part, block in users if parts[part] > 1}
    warned = {warning.block for warning in seen.warnings()}
    found = []
    for sent in story:
        block = sent.block
        if block.id in warned or (block.id, "start") not in lives:
            continue
        for operator in block.constraints[0].operators:
            refs = [SyncRef.parse(text) for text in (operator.ref, *operator.syncs)]
            known = [times.get((ref.block or block.id, ref.behavior, ref.sync)) for ref in refs]
            others = [ref.block for ref in refs if ref.block]
            is_over = any(lives.get((other, "end"), 0.0) <= lives[block.id, "start"] for other in others)
            if None in known or is_over or disputed.intersection((block.id, *others)):
                continue
            ref, sync = (time + each.offset for time, each in zip(known, refs, strict=True) if time is not None)
            is_kept = {
                Synchronize: abs(sync - ref) < 1e-4,
                After: sync >= ref - 1e-4,
                Before: sync <= ref + 1e-4,
            }[type(operator)]
            if not is_kept:
                found.append(f"{block.id}: {operator}: {sync} against {ref}")
    return found


@settings(max_examples=share_of(60), deadline=None)
@given(several())
def test_ties_between_blocks_hold_or_somebody_is_told(story: tuple[Sent, ...]) -> None:
    async def main() -> None:
        async with stage(FakeBody()) as seen:
            calm = [replace(each, cancelled=None, interrupted=None) for each in story]
            await play(calm, seen.ask, seen.requests)
            await asyncio.sleep(1.0)

            assert broken(calm, seen) == []

    run_virtual(main())
