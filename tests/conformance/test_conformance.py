"""Our conformance set: each rule of the realizer, in each dialect, by the simulated body in virtual time."""

import asyncio
import re
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from itertools import groupby
from pathlib import Path

import pytest
from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import canonical_sync, dialect_sync, sync_points
from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PerformBlock,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.references import SyncRef, type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.commandline.shell.roster import service
from engage_hri.services.commandline.shell.sources import still
from engage_hri.services.requests.ends import Requester, RequestRefused
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.simulation.still import table_world
from tests.conformance.case import Case, Written, cases
from tests.random_cases import share_of


def tried() -> Iterator[Case]:
    """Each rule in one dialect, of which each has its turn, or in all: `test_dialects.py` compares their nets."""
    found = groupby(cases(Path(__file__).parent / "cases"), key=lambda case: case.rule)
    for number, spelled in enumerate([*each] for _, each in found):
        first = number % len(spelled)
        yield from (spelled[first:] + spelled[:first])[: share_of(len(spelled), 4)]


class Seen(Struct):
    """What was said while a case was performed. outcomes: by block id, as it was written."""

    feedback: list[object] = field(default_factory=list)
    outcomes: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    blocks: dict[str, Block] = field(default_factory=dict)

    def progress(self, block: str) -> list[SyncPointProgress]:
        return [each for each in self.feedback if isinstance(each, SyncPointProgress) and each.block == block]

    def instants(self) -> Mapping[tuple[str, str, str], Seconds]:
        """Block, behavior and sync point in the drafts' spelling -> seconds of the clock."""
        found = {}
        for message in self.feedback:
            match message:
                case SyncPointProgress(block=id, behavior=behavior, sync=sync, at=at):
                    block = self.blocks[id]
                    type = next(type_name(each) for each in block.behaviors if each.id == behavior)
                    found[id, behavior, canonical_sync(sync, type, block.dialect)] = at.seconds
                case BlockProgress(block=str(id), progress=progress, at=at):
                    found[id, "bml", progress] = at.seconds
        return found


@pytest.mark.parametrize("case", [*tried()], ids=str)
async def test_rule(case: Case) -> None:
    seen = Seen()
    async with _system(seen, load(settings=case.settings)) as requests:
        await asyncio.gather(*(_perform(written, requests, seen, n) for n, written in enumerate(case.blocks)))

    assert tuple(seen.outcomes) == case.outcome
    kinds = {warning.split()[0] for warning in case.warnings}
    warned = [f"* {warning.split()[-1]}" for warning in seen.warnings] if kinds == {"*"} else seen.warnings
    assert sorted(warned) == sorted(case.warnings)
    assert sorted(seen.dropped) == sorted(case.dropped)
    instants = seen.instants()
    for claim in case.expect:
        assert _holds(claim, case, instants), f"{claim}: {instants}"
    for number, (id, block) in enumerate(seen.blocks.items()):
        if number < len(case.outcome) and case.outcome[number] != "refused":
            _require_orderly(seen, id, block, is_done=case.outcome[number] == "done")


@asynccontextmanager
async def _system(seen: Seen, config: Config) -> AsyncIterator[Requester]:
    services: dict[str, Service] = {"simulation": still(table_world())}
    services |= {name: service(name, config) for name in ("realizer", "control", "recognition")}
    async with MemoryHub() as hub, running(hub, services):
        bus = hub.join("test")
        async with Requester(bus) as requests:
            listening = asyncio.create_task(_listen(bus, seen), name="listen")
            try:
                yield requests
            finally:
                await asyncio.sleep(0.5)
                listening.cancel()
                await asyncio.gather(listening, return_exceptions=True)
        await bus.leave()


async def _listen(bus: Bus, seen: Seen) -> None:
    with bus.subscribe(keys.FEEDBACK) as inbox:
        async for received in inbox:
            seen.feedback.append(received.message)
            if isinstance(received.message, WarningFeedback):
                warning = received.message
                seen.warnings.append(f"{warning.kind} {':'.join(filter(None, (warning.block, warning.behavior)))}")


async def _perform(written: Written, requests: Requester, seen: Seen, number: int) -> None:
    seen.outcomes.append("")
    await asyncio.sleep(written.at)
    try:
        (block,) = read(written.xml.encode(), "case.xml")
        assert isinstance(block, Block)
        seen.blocks[block.id] = block
        request = PerformBlock(id=f"r-{number}", requester="test", block=block)
        outcome = await requests.send(keys.BLOCK, request).outcome
    except InputRefused as error:  # before it ever reached the realizer: `engage play` warns of this
        seen.warnings.append(f"PARSING_FAILURE {error.block or '-'}")
        seen.outcomes[number] = "refused"
    except RequestRefused:
        seen.outcomes[number] = "refused"
    else:
        assert isinstance(outcome, BlockOutcome)
        seen.outcomes[number] = outcome.status
        seen.dropped += outcome.dropped


def _holds(claim: str, case: Case, instants: Mapping[tuple[str, str, str], Seconds]) -> bool:
    """`!` before a reference: this point was never reported."""
    if claim.startswith("!"):
        return _instant(claim[1:], case, instants) is None
    match = re.fullmatch("(.*) (==|<=|>=) (.*)", claim)
    assert match, claim
    left, right = (_instant(text, case, instants) for text in (match[1], match[3]))
    assert left is not None, f"{match[1]} was never reported; {instants}"
    assert right is not None, f"{match[3]} was never reported; {instants}"
    match match[2]:
        case "==":
            return abs(left - right) <= case.within
        case "<=":
            return left <= right + case.within
    return left >= right - case.within


def _instant(text: str, case: Case, instants: Mapping[tuple[str, str, str], Seconds]) -> Seconds | None:
    ref = SyncRef.parse(text)
    block = ref.block or case.blocks[0].id
    at = instants.get((block, ref.behavior or "bml", ref.sync or "start"))
    return None if at is None else at + ref.offset


def _require_orderly(seen: Seen, id: str, block: Block, *, is_done: bool) -> None:
    """Start and end once, and between them each default point once, in order, as the block's dialect calls it."""
    progress = [each.progress for each in seen.feedback if isinstance(each, BlockProgress) and each.block == id]
    assert progress == ["start", "end"]
    assert any(isinstance(each, PredictionFeedback) and each.block == id for each in seen.feedback)
    ours = [each for each in seen.feedback if getattr(each, "block", None) == id]
    assert isinstance(ours[0], BlockProgress)
    for behavior in block.behaviors:
        reported = [each for each in seen.progress(id) if each.behavior == behavior.id]
        known = [dialect_sync(sync, type_name(behavior), block.dialect) for sync in sync_points(behavior)]
        points = [sync for sync in known if sync is not None]
        assert [each.sync for each in reported] == points[: len(reported)]
        assert [each.time for each in reported] == sorted(each.time for each in reported)
        is_open = isinstance(behavior, Event)  # Events are followed on recognition's own stream after the block.
        if is_done and not is_open and behavior.id not in seen.dropped:
            assert len(reported) == len(points), f"{behavior.id}: only {[each.sync for each in reported]}"
