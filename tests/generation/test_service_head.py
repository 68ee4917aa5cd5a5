"""Who owns the head while the service runs: gaze shifts sent, owners published, inhibitions obeyed."""

import asyncio

import pytest

from schemas import keys
from schemas.attention import Inhibit, InhibitionEnded
from schemas.behaviors import Gaze, GazeShift, Speech
from schemas.fragments import FragmentOutcome, TurnFragment
from services.generation.config import GenerationConfig
from services.memory_bus import MemoryHub
from services.requests import GRACE, RequestRefused
from tests.generation.partners import Partners, gaze_targets, stage

LOOK = Gaze(id="look", target="middle")
SAY = Speech(id="s", text="Look")


def looks(id: str = "f", status: str = "full", **fields: object) -> TurnFragment:
    return TurnFragment(id=id, turn_status=status, behaviors=(LOOK, SAY), **fields)  # type: ignore[arg-type]


def owners(partners: Partners) -> list[tuple[float, str, str]]:
    """Changes of owner: since, kind, target."""
    changes: list[tuple[float, str, str]] = []
    for each in partners.owners:
        change = (partners.bus.local(each.since), each.owner.kind, each.owner.target)
        if not changes or changes[-1] != change:
            changes.append(change)
    return changes


def inhibit(partners: Partners, id: str = "lease", **fields: object) -> "asyncio.Future[object]":
    request = Inhibit(id=id, requester=partners.client.name, **fields)  # type: ignore[arg-type]
    return partners.requests.send(keys.INHIBIT, request).outcome  # type: ignore[return-value]


async def test_the_robot_looks_at_the_face_from_the_beginning(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(0.1)

        assert partners.shifts == [("maintenance", "human")]
        assert owners(partners) == [(0.0, "face", "human")]


async def test_a_fragments_gaze_owns_the_head_from_its_start_to_its_end(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(looks())
        await partners.fragment_block("f")
        await asyncio.sleep(1.0)
        partners.reach("f", "look", "start")
        await asyncio.sleep(1.0)
        partners.reach("f", "look", "end")
        partners.reach("f", "turn-gaze", "start")
        await asyncio.sleep(1.0)
        partners.end(partners.request("f"))
        await asyncio.sleep(1.0)

        assert owners(partners) == [
            (0.0, "face", "human"),
            (1.0, "fragment", "middle"),
            (2.0, "fragment", "human"),
            (3.3, "face", "human"),
        ]
        assert partners.shifts == [("maintenance", "human")]


async def test_a_response_is_answered_by_a_block_of_its_own(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))
        await asyncio.sleep(1.0)
        partners.event("e", "failed", initiator="human", responder="robot", objects=("left",))
        await asyncio.sleep(1.0)

        assert partners.shifts == [("maintenance", "human"), ("response", "left"), ("maintenance", "human")]
        assert owners(partners)[1:] == [(1.0, "response", "left"), (2.3, "face", "human")]


async def test_thinking_averts_the_gaze_until_the_next_fragment(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(looks("a", "beginning", delay=True, delay_target="table"))
        await partners.fragment_block("a")
        await asyncio.sleep(1.0)
        partners.end(partners.request("a"))
        await asyncio.sleep(2.0)
        partners.send(looks("b", "end"))
        await partners.fragment_block("b")
        await asyncio.sleep(1.0)

        assert owners(partners)[1:] == [(1.0, "fragment", "table"), (3.3, "face", "human")]
        assert partners.shifts == [("maintenance", "human"), ("maintenance", "table"), ("maintenance", "human")]


async def test_inhibited_gaze_stops_the_arbiter_and_the_fragments(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        inhibit(partners)
        await asyncio.sleep(0.1)
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))
        pending = partners.send(looks())
        block = await partners.fragment_block("f")
        partners.end(partners.request("f"))
        outcome = await pending.outcome

        assert gaze_targets(block) == []
        assert partners.shifts == [("maintenance", "human")]  # before the lease
        assert isinstance(outcome, FragmentOutcome)
        assert outcome.warnings == ("look is left out: inhibited",)


async def test_an_inhibition_aborts_a_running_gaze_and_those_that_still_start(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        partners.send(looks())
        await partners.fragment_block("f")
        partners.reach("f", "look", "start")
        await asyncio.sleep(1.0)
        inhibit(partners)
        await asyncio.sleep(1.0)
        partners.reach("f", "look", "end")
        partners.reach("f", "turn-gaze", "start")
        await asyncio.sleep(1.0)

        block = partners.request("f").id
        assert [abort.id for abort in partners.aborts] == [f"{block}/look", f"{block}/turn-gaze"]


async def test_a_lease_lasts_while_its_owner_renews_it_and_ends_when_released(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        ended = inhibit(partners, ttl=3.0)
        await asyncio.sleep(20.0)
        assert not ended.done()
        partners.requests.cancel("lease")
        outcome = await ended

        assert outcome == InhibitionEnded(id="lease", reason="released")
        assert asyncio.get_running_loop().time() == 20.0


async def test_a_lease_lapses_when_its_owner_falls_silent(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        request = Inhibit(id="lease", requester="somebody", ttl=3.0, mode="target", target="table")
        partners.client.publish(keys.INHIBIT, request)
        await asyncio.sleep(10.0)

        assert owners(partners)[-2:] == [(0.0, "inhibition", "table"), (3.3, "face", "human")]


async def test_a_lease_ends_with_its_owners_life(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        inhibit(partners, ttl=60.0)
        await asyncio.sleep(1.0)
        hub.kill("manager")
        await asyncio.sleep(10.0)

        assert owners(partners)[-1] == (1.0 + GRACE + 0.3, "face", "human")


async def test_in_degraded_generation_the_head_stares_to_the_upper_right(hub: MemoryHub) -> None:
    async with stage(hub, GenerationConfig(condition="degraded-generation")) as partners:
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))
        pending = partners.send(looks())
        block = await partners.fragment_block("f")
        partners.end(partners.request("f"))
        await pending.outcome

        assert [behavior.id for behavior in block.behaviors] == ["turn-pair", "s", "turn-ended"]
        assert owners(partners) == [(0.0, "inhibition", "")]
        assert partners.shifts == [("maintenance", "table")]
        (shift,) = (each for request in partners.blocks for each in request.block.behaviors if each.id == "shift")
        assert shift == GazeShift(id="shift", target="table", offset_direction="UPRIGHT", offset_angle=60.0)


async def test_the_gaze_cannot_be_held_on_what_nobody_knows(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        with pytest.raises(RequestRefused, match="ghost"):
            await inhibit(partners, mode="target", target="ghost")
        await asyncio.sleep(1.0)

        assert owners(partners) == [(0.0, "face", "human")]
