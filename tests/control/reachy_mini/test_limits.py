"""What a Reachy Mini is sent keeps the limits of its joints, whatever is begun, taken over, held and aborted."""

import asyncio
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.references import type_name
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.testing import BEHAVIORS, WORLD, Stage
from tests.control.reachy_mini.fake import FakeDaemon
from tests.control.reachy_mini.limits import too_much


@pytest.mark.parametrize("alive", [False, True])
@pytest.mark.parametrize("seed", range(4))
async def test_no_target_is_beyond_what_the_joints_are_trusted_with(seed: int, alive: bool):
    chance, daemon = Random(seed), FakeDaemon()
    body = ReachyMini(connect=daemon, alive=alive)
    body.see(WORLD)
    able = [behavior for behavior in BEHAVIORS if type_name(behavior) in body.capabilities.types]
    async with body.connected():
        stages: list[Stage] = []
        for number in range(40):
            behavior = replace(chance.choice(able), id=f"b{number}")
            stages.append(Stage(body, behavior, chance.choice(("start", "end"))))
            await asyncio.sleep(chance.uniform(0.0, 0.6))
            one = chance.choice(stages).authority
            match chance.choice(("hold", "go on", "relax", "freeze", "extend")):
                case "hold":
                    one.hold()
                case "go on":
                    one.go_on()
                case "extend":
                    one.extend("end")
                case how:
                    one.revoke(how)  # type: ignore[arg-type]
        for stage in stages:
            stage.authority.go_on()
            stage.authority.extend("end")
        await body.home()
        await asyncio.gather(*(stage.task for stage in stages), return_exceptions=True)

    assert len(daemon.commands) > 300
    assert too_much(daemon.commands, body.capabilities.joints) == []
