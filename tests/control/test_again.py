"""Control again, from its ledger: whatever requesters and drivers do, it decides the same, to the last bit."""

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator
from contextlib import aclosing
from functools import partial
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import AbortBehavior, BehaviorOutcome, GoHome, PerformBehavior
from engage_hri.schemas.body_faults import BodyFault, SwitchFaults
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import Taken
from engage_hri.schemas.requests import Refused
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    DriverBroken,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.service import embody
from engage_hri.services.control.serving import steps
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.steps import BodyTold, ControlStep, StreamEnded
from engage_hri.services.control.testing import BEHAVIORS, WORLD
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.intake import Again, AnswerRequest
from engage_hri.services.runtime.service import running
from tests.commanding import command
from tests.ledgers import RecordedLives, changed_step
from tests.random_cases import share_of

CONFIG = ControlConfig(variability=Variability(seed=5))
FAULTS = (
    BodyFault(kind="lost", amount=0.3), BodyFault(kind="slow", part="right_arm", amount=2.0),
    BodyFault(kind="voiceless"), BodyFault(kind="overheated", part="left_arm"),
    BodyFault(kind="stall", part="head", amount=1.0),
)  # fmt: skip
GONE = World(entities=WORLD.entities[:2])


class Fickle(SimulatedBody):
    """A driver that may refuse, fail, break, lie, complain, be deaf, and not find its way home."""

    def __init__(self, chance: Random) -> None:
        super().__init__()
        self.chance = chance

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if self.chance.random() < 0.05:
            raise BehaviorRefused(Fault(reason="not in the mood", where=behavior.id))
        is_deaf = self.chance.random() < 0.1
        async with aclosing(super().perform(behavior, authority)) as stream:
            async for progress in stream:
                match self.chance.randrange(60):
                    case 0:
                        raise BodyFailed(Fault(reason="a motor is hot", where=behavior.id))
                    case 1:
                        raise DriverBroken(Fault(reason="the cable is out", where=behavior.id))
                    case 2:
                        yield Reached("lunch", progress.at, progress.at)
                    case 3:
                        yield replace(progress, at="soon")
                    case 4:
                        self.on_fault(Fault(reason="the daemon is gone", service="control"))
                        self.on_recovery("the daemon is back")
                yield progress
        if is_deaf:
            await asyncio.sleep(20.0)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if self.chance.random() < 0.2:
            raise BodyFailed(Fault(reason="its arm is stuck", service="control"))
        await super().home(parts)


async def live(hub: MemoryHub, chance: Random, seconds: float) -> None:
    """One life of control, and two who command all sorts of things of it. One of the two may be killed."""
    world, number = hub.join("simulation"), 0
    world.publish(keys.WORLD, WORLD)
    async with running(hub, {"control": partial(embody, config=CONFIG, body=Fickle(chance))}):
        ends = [hub.join(name) for name in ("realizer", "guest")]
        for end in ends:
            end.declare_alive()
        async with Requester(ends[0]) as one, Requester(ends[1]) as other:
            known: list[PerformBehavior] = []
            until = world.now() + seconds
            dies_at = world.now() + chance.uniform(0.5, 2.0) * seconds
            while world.now() < until:
                number += 1
                by = chance.choice((one, other))
                match chance.randrange(12):
                    case 0 if known:
                        before = chance.choice(known)
                        abort = AbortBehavior(id=f"abort-{number}", block=before.block, behavior=before.behavior.id)
                        by.send(keys.BEHAVIOR, replace(abort, how=chance.choice(("relax", "freeze"))))
                    case 1 if known:
                        by.cancel(chance.choice(known).id, "enough")
                    case 2:
                        home = GoHome(id=f"home-{number}", parts=chance.choice(((), ("head",))))
                        by.send(keys.BEHAVIOR, home)
                        if chance.random() < 0.3:
                            by.cancel(home.id)
                    case 3:
                        off = SwitchFaults(id=f"off-{number}", all_off=True)
                        on = SwitchFaults(id=f"on-{number}", on=(chance.choice(FAULTS),))
                        by.send(keys.FAULTS, chance.choice((on, off)))
                    case 4:
                        world.publish(keys.WORLD, chance.choice((WORLD, GONE)))
                    case 5 | 6 if known:
                        extend(by, chance, chance.choice(known))
                    case 7:  # nobody renews it, or somebody does it late
                        once = replace(drawn(chance, number), held_after=1.0, lease=3.0)
                        for _ in range(chance.choice((1, 2))):
                            command(ends[0], keys.BEHAVIOR, once)
                            await asyncio.sleep(1.5)
                    case _:
                        known.append(drawn(chance, number))
                        by.send(keys.BEHAVIOR, known[-1])
                if world.now() > dies_at:
                    hub.kill("guest")
                await asyncio.sleep(chance.choice((0.0, 0.05, 0.3, 1.0, 3.0)))
        for end in ends:
            await end.leave()
        await asyncio.sleep(30.0)
    await world.leave()


def drawn(chance: Random, number: int) -> PerformBehavior:
    """A request that nobody has made yet; some have the names of others, or cannot be."""
    behavior = replace(chance.choice(BEHAVIORS), id=chance.choice(("a", "b", f"c{number}")))
    through = chance.choice(("start", "stroke", "end", "end", "end"))
    return PerformBehavior(
        id=f"perform-{number}", block=chance.choice(("one", "two")), behavior=behavior, through=through,
        held=chance.random() < 0.1, held_after=chance.choice((0.0, 1.0)), lease=chance.choice((0.0, 3.0)),
    )  # fmt: skip


def extend(by: Requester, chance: Random, before: PerformBehavior) -> None:
    through = chance.choice(("stroke", "end", "end", "lunch"))
    by.send(keys.BEHAVIOR, replace(before, through=through, held=chance.random() < 0.3))


async def recorded(hub: MemoryHub, seed: int, lives: int = 1) -> RecordedLives:
    record = RecordedLives(
        hub, "control", lambda clock, session: ControlIntake("robot", CONFIG, clock.name), ControlStep
    )
    chance = Random(seed)
    for _ in range(lives):
        await live(hub, chance, 60.0)
        await asyncio.sleep(keys.HISTORY_MAX_AGE + 0.1)
    await record.read()
    return record


@pytest.mark.parametrize("seed", range(share_of(8)))
async def test_each_life_of_control_decides_the_same_again(hub: MemoryHub, seed: int) -> None:
    record = await recorded(hub, seed, lives=2)

    assert len(record.lives) == 2
    for session in record.lives:
        again = record.again(session)
        assert again.lack.is_nothing
        assert not again.differences, again.differences[0]
        assert again.steps > 50
        each_behavior_ends_once(again)


def each_behavior_ends_once(again: Again) -> None:
    """Nothing is done to a behavior before it has begun, or after its end; and it has one end."""
    live, ended = set[str](), Counter[str]()
    for effect in again.outputs:
        match effect:
            case steps.BeginBehavior(request=request):
                assert request.id not in live
                live.add(request.id)
            case AnswerRequest(answer=BehaviorOutcome(id=id) | Refused(id=id)):
                live.discard(id)
                ended[id] += 1
            case (
                steps.GiveAuthority(request=id)
                | steps.HoldBehavior(request=id)
                | steps.RevokeAuthority(request=id)
                | steps.LeaveStream(request=id)
            ):
                assert id in live
    assert set(ended.values()) == {1}
    assert not live


async def test_all_that_can_happen_to_a_behavior_happens(hub: MemoryHub) -> None:
    """The sessions above would prove little if they were quiet."""
    record = await recorded(hub, 5, lives=3)
    steps, did, ends = Counter[str](), Counter[str](), Counter[str]()
    for session in record.lives:
        steps.update(each.content["type"] for taken in record.lives[session] for each in taken.steps if each.content)
        outputs = record.again(session).outputs
        did.update(type(each).__name__ for each in outputs)
        ends.update(
            each.answer.status
            for each in outputs
            if isinstance(each, AnswerRequest) and isinstance(each.answer, BehaviorOutcome)
        )

    assert steps.keys() >= {
        "control_began", "request_handed", "hold_request", "body_told", "stream_ended",
        "authority_revoked", "eyes_moved", "home_ended", "faults_played", "body_complained",
    }  # fmt: skip
    assert did.keys() >= {
        "PublishMessage", "AnswerRequest", "Alert", "Reassure", "ShowWorld", "PlayFaults", "BeginBehavior",
        "GiveAuthority", "HoldBehavior", "RevokeAuthority", "LeaveStream", "TakeHome", "StopHome",
    }  # fmt: skip
    assert ends.keys() == {"done", "taken_over", "aborted", "lapsed", "failed"}


@pytest.mark.parametrize("kind", [BodyTold, StreamEnded])
async def test_a_step_that_took_something_else_is_noticed_and_named(hub: MemoryHub, kind: type) -> None:
    record = await recorded(hub, 2)
    [(session, ledger)] = record.lives.items()
    tag = kind.__struct_config__.tag  # type: ignore[attr-defined]
    other, changed = changed_step(ledger, tag, request="another")

    first = record.again(session, other).differences[0]

    assert first.number == changed
    assert first.step.content["request"] == "another"


async def test_nothing_is_told_while_nobody_listens(hub: MemoryHub) -> None:
    told: list[Message] = []
    chance = Random(3)
    async with running(hub, {"control": partial(embody, config=CONFIG, body=Fickle(chance))}):
        bus = hub.join("realizer")
        bus.publish(keys.WORLD, WORLD)
        async with Requester(bus) as requests:
            for number in range(5):
                requests.send(keys.BEHAVIOR, drawn(chance, number))
                await asyncio.sleep(2.0)
            assert not bus.is_heard(keys.taken("control"))
            with bus.subscribe(keys.taken("control")) as inbox:
                requests.send(keys.BEHAVIOR, drawn(chance, 6))
                await asyncio.sleep(2.0)
                while (received := inbox.take()) is not None:
                    told.append(received.message)
        await bus.leave()

    assert told
    assert all(isinstance(each, Taken) and each.first > 5 for each in told)
