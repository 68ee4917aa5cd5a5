"""Who owns the head while the service runs: gaze shifts sent, owners published, inhibitions obeyed."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, GazeShift, Pointing, Speech
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, Inhibit, InhibitionEnded, TurnFragment
from engage_hri.schemas.recognition import Statistics, WindowStatistics
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.requests.serving import GRACE
from tests.commanding import command
from tests.generation.partners import TABLE, Partners, gaze_targets, stage

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


async def test_a_shift_takes_the_head_from_one_that_is_on_its_way(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        partners.shifts_arrive = False
        for target in ("left", "right"):
            partners.event(target, "started", initiator="human", responder="robot", objects=(target,))
            await asyncio.sleep(0.5)

        assert [target for _, target in partners.shifts] == ["human", "left", "right"]
        assert partners.cancelled == [partners.request("response-2").id]


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

        assert [(abort.block, abort.behavior) for abort in partners.aborts] == [("f", "look"), ("f", "turn-gaze")]


async def test_a_lease_lasts_while_its_owner_renews_it_and_ends_when_released(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        ended = inhibit(partners, ttl=3.0)
        await asyncio.sleep(20.0)
        assert not ended.done()
        partners.requests.cancel("lease")
        outcome = await ended

        assert isinstance(outcome, InhibitionEnded)
        assert outcome.reason == "released"
        assert asyncio.get_running_loop().time() == 20.0


async def test_a_lease_lapses_when_its_owner_falls_silent(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        request = Inhibit(id="lease", requester="somebody", ttl=3.0, mode="target", target="table")
        command(partners.client, keys.INHIBIT, request)
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


# -- the six claims, one after the other --------------------------------------------------------------------------


def moving(speed: float) -> World:
    hand = Entity(id="hand", kind="hand", owner="human", position=(0.7, 0.1, 0.8), velocity=(speed, 0.0, 0.0))
    return World(entities=(*TABLE.entities, hand))


async def test_six_claims_have_the_head_in_turn_and_say_why_and_what_waits(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        partners.see(moving(0.5))  # hands at 1.2
        await asyncio.sleep(1.0)
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))  # response at 2.0
        pending = partners.send(looks())
        await partners.fragment_block("f")
        await asyncio.sleep(7.0)  # glance at 2.0 + 5.7
        assert partners.owners[-1].owner.kind == "response"  # .9 + .3 later
        partners.reach("f", "look", "start")  # fragment at 9.0
        await asyncio.sleep(1.0)
        lease = inhibit(partners, mode="target", target="table", ttl=60.0)  # inhibition at 10.0
        await asyncio.sleep(1.0)
        waiting = [(claim.kind, claim.target, bool(claim.reason)) for claim in partners.owners[-1].waiting]
        partners.requests.cancel("lease")  # fragment again at 11.3
        await lease
        await asyncio.sleep(1.0)
        partners.end(partners.request("f"))
        await pending.outcome  # 12.0, and the response at 12.3
        partners.event("e", "succeeded", initiator="human", responder="robot", objects=("left",))
        await asyncio.sleep(2.0)  # 12.8 + .3: hands
        partners.see(moving(0.0))
        await asyncio.sleep(2.0)

        assert [(round(at, 6), kind, target) for at, kind, target in owners(partners)] == [
            (0.0, "face", "human"),
            (1.2, "hands", "hand"),
            (2.0, "response", "left"),
            (7.7, "glance", "human"),
            (8.9, "response", "left"),
            (9.0, "fragment", "middle"),
            (10.0, "inhibition", "table"),
            (11.3, "fragment", "middle"),
            (12.3, "response", "left"),
            (13.1, "hands", "hand"),
            (14.6, "glance", "human"),  # 5.7 after the last ended, while the hand still is the hand's
            (15.8, "face", "human"),
        ]
        assert [kind for kind, _, _ in waiting] == ["fragment", "response", "hands", "face"]
        assert all(said for *_, said in waiting)
        assert all(each.owner.reason for each in partners.owners)


async def test_a_glance_is_a_shift_that_announces_an_optional_look_at_the_face(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        window = WindowStatistics(events=9, mtbce_without_maintenance=4.0)
        statistics = Statistics(actor="human", at=partners.bus.stamp(), session=window, recent=window)
        partners.bus.publish(keys.statistics("human"), statistics)
        partners.see(moving(0.5))
        await asyncio.sleep(10.0)

        (glance,) = [each.block for each in partners.blocks if len(each.block.behaviors) == 2][:1]
        shift, announced = glance.behaviors
        assert isinstance(shift, GazeShift)
        assert (announced.kind, announced.responder) == ("mutual_facial_gaze", "human")  # type: ignore[union-attr]
        assert (announced.cause, announced.optional) == ("maintenance", True)  # type: ignore[union-attr]
        assert [at for at, kind, _ in owners(partners) if kind == "glance"][:1] == [4.3]


async def test_whoever_joins_late_learns_who_has_the_head(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(5.0)
        late = hub.join("late")
        with late.subscribe(keys.HEAD_OWNER) as inbox:
            message = (await anext(aiter(inbox))).message

            assert message == partners.owners[-1]


async def test_a_fragment_keeps_the_head_after_its_gaze_until_its_block_ends(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(looks(status="beginning"))
        await partners.fragment_block("f")
        partners.reach("f", "look", "start")
        await asyncio.sleep(1.0)
        partners.reach("f", "look", "end")
        await asyncio.sleep(3.0)
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))
        await asyncio.sleep(1.0)
        partners.end(partners.request("f"))
        await pending.outcome
        await asyncio.sleep(1.0)

        assert owners(partners)[1:] == [
            (0.0, "fragment", "middle"),
            (1.0, "fragment", "human"),
            (5.3, "face", "human"),
        ]


async def test_a_shift_that_is_refused_is_asked_for_again_after_a_pause(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        partners.refusal = Fault(reason="out of reach")
        partners.event("e", "started", initiator="human", responder="robot", objects=("left",))
        await asyncio.sleep(1.5)
        partners.refusal = None
        await asyncio.sleep(1.0)

        assert partners.shifts == [("maintenance", "human"), ("response", "left")]  # at 3.0: refused at 1.0 and 2.0
        assert partners.owners[-1].owner.kind == "response"


@pytest.mark.parametrize(
    ("hand", "part", "aborted"),
    [
        ("LEFT_HAND", "point-left", True),
        ("LEFT_HAND", "point-right", False),
        ("BOTH_HANDS", "point-right", True),
        (None, "point-right", True),  # it may be that arm
        ("BOTH_HANDS", "gaze", False),
    ],
)
@pytest.mark.parametrize("mode", ["release", "hold", "target"])
async def test_an_inhibited_arm_stops_pointing(
    hub: MemoryHub, hand: str | None, part: str, aborted: bool, mode: str
) -> None:
    async with stage(hub) as partners:
        point = Pointing(id="point", target="middle", mode=hand)  # type: ignore[arg-type]
        partners.send(TurnFragment(id="f", turn_status="full", behaviors=(point, SAY)))
        await partners.fragment_block("f")
        partners.reach("f", "point", "start")
        await asyncio.sleep(1.0)
        assert partners.aborts == []
        inhibit(partners, part=part, mode=mode, target="table" if mode == "target" else "")
        await asyncio.sleep(1.0)

        assert [abort.behavior for abort in partners.aborts] == ["point"] * aborted


async def test_a_lease_renewed_with_nonsense_is_over_and_the_service_goes_on(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        ask = Inhibit(id="lease", requester=partners.client.name, ttl=60.0)
        command(partners.client, keys.INHIBIT, ask)
        await asyncio.sleep(1.0)
        assert partners.owners[-1].owner.kind == "inhibition"
        again = Inhibit(id="lease", requester=partners.client.name, ttl=-1.0, revision=1)
        command(partners.client, keys.INHIBIT, again)
        await asyncio.sleep(100.0)

        assert "ttl -1.0" in partners.faults[0].reason
        assert owners(partners)[-1] == (1.3, "face", "human")


async def test_a_body_that_comes_back_is_told_where_to_look(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        hub.kill("control")
        await asyncio.sleep(1.0)

        assert partners.shifts == [("maintenance", "human"), ("maintenance", "human")]
