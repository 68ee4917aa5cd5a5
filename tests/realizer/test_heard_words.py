"""What the voice has said is used: a stroke falls on its word however slow or fast the voice is."""

import asyncio
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Constraint, Gesture, Mark, Speech, Synchronize
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.body import SyncPointReached
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.service import embody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual

TEXT = "a extraordinarily two I mathematics so to seven incomprehensible nine ten"
WORDS = TEXT.split()


async def _times(word: int, seed: int) -> dict[str, float]:
    mark = Mark("m", len(" ".join(WORDS[:word])) + 1)
    block = Block(
        id="b",
        behaviors=(Speech(id="s", text=TEXT, marks=(mark,)), Gesture(id="g", lexeme="BEAT")),
        constraints=(Constraint(operators=(Synchronize(syncs=("s:m", "g:stroke")),)),),
    )
    config = ControlConfig(variability=Variability(seed=seed, noise=0.2))
    found: dict[str, float] = {}
    async with MemoryHub() as hub:
        bus = hub.join("test")
        services = {"control": partial(embody, config=config), "realizer": partial(realize, config=RealizerConfig())}
        async with running(hub, services), Requester(bus) as requests:
            with bus.subscribe(keys.SYNC_POINT) as inbox:
                await requests.send(keys.BLOCK, PerformBlock(id="b", requester=bus.name, block=block)).outcome
                await asyncio.sleep(0.01)
                while (received := await inbox.next(bus.now() + 0.01)) is not None:
                    if isinstance(each := received.message, SyncPointReached):
                        found[f"{each.behavior}:{each.sync}"] = bus.local(each.at)
        await bus.leave()
    return found


@pytest.mark.parametrize("word", [2, 4, 8])
def test_a_stroke_falls_on_its_word_by_the_bodys_own_log_on_a_noisy_body(word: int) -> None:
    seen = [run_virtual(_times(word, seed)) for seed in range(10)]
    skews = [abs(each["g:stroke"] - each["s:m"]) for each in seen]

    assert sum(skews) / len(skews) <= 0.010
    assert max(skews) <= 0.040
