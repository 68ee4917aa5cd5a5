"""Every request ends exactly once at both ends, whatever the bus and the servers do in between."""

import asyncio

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.requests import Outcome
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.bus.faulty import Faults, FaultyHub
from tests.bus.performer import Server, block


@given(
    loss=st.floats(0.0, 0.6),
    duplicate=st.floats(0.0, 0.5),
    delay=st.floats(0.0, 0.5),
    seed=st.integers(0, 1 << 16),
    script=st.lists(
        st.tuples(
            st.sampled_from(["ask", "ask", "update", "cancel", "cut", "heal", "kill server", "start server"]),
            st.floats(0.0, 2.5),
        ),
        max_size=15,
    ),
)
@settings(max_examples=60, deadline=None)
def test_every_request_ends_exactly_once_at_both_ends(
    loss: float, duplicate: float, delay: float, seed: int, script: list[tuple[str, float]]
):
    async def main() -> None:
        hub = FaultyHub(Faults(loss=loss, duplicate=duplicate, delay=delay), seed)
        client = hub.join("client")
        client.declare_alive()
        lives: list[Server] = []
        pendings = []
        async with Requester(client) as requests:
            for number, (what, pause) in enumerate(script):
                match what:
                    case "ask":
                        pendings.append(requests.send(keys.BLOCK, block(str(number))))
                    case "update" if pendings and not pendings[-1].outcome.done():
                        content = Block(id=pendings[-1].request.id, composition="APPEND")
                        requests.send(keys.BLOCK, PerformBlock(id=content.id, requester="client", block=content))
                    case "cancel" if pendings:
                        requests.cancel(pendings[-1].request.id)
                    case "cut":
                        hub.partition("client")
                    case "heal":
                        hub.heal()
                    case "kill server" if lives and not lives[-1].task.done():
                        await lives[-1].die(hub)
                    case "start server" if not lives or lives[-1].task.done():
                        lives.append(Server(hub))
                await asyncio.sleep(pause)
            hub.heal()
            if not lives or lives[-1].task.done():
                lives.append(Server(hub))
            ends = await asyncio.wait_for(
                asyncio.gather(*(pending.outcome for pending in pendings), return_exceptions=True), 600.0
            )
            await asyncio.sleep(10.0)

        assert all(isinstance(end, (Outcome, EngageError)) for end in ends)
        assert all(pending.accepted.done() for pending in pendings)
        for life in lives:
            ids = [request.id for request in life.taken if request.id in life.timers]
            performed = {id for id in ids if f"{id} done" in life.ended or f"{id} interrupted" in life.ended}
            assert len(life.ended) == len(performed)
            assert life.task.done() or not any(life.desk.is_live(id) for id in ids)
        for life in lives:
            await life.die(hub)
        await hub.close()

    run_virtual(main())
