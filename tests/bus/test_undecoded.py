"""The bus in memory without decoding, as private systems use it: nothing is different but the time it takes."""

import asyncio
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import pytest
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Speech, Timing
from engage_hri.schemas.blocks import Block, PerformBlock, SyncPointProgress, WarningFeedback
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import Message, published
from engage_hri.schemas.participants import AskStatus
from engage_hri.services.bus.interface import Received, Sample
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.commandline.shell.roster import service
from engage_hri.services.commandline.shell.sources import still
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.simulation.still import table_world

PLAIN = (str, int, float, bool, bytes, type(None))


def mutable(hint: Any, seen: set[type]) -> list[str]:
    """What of a field's type could be changed by one receiver under the eyes of another."""
    if hint in PLAIN or get_origin(hint) is Literal:
        return []
    if get_origin(hint) in (Union, UnionType, tuple) or (isinstance(hint, type) and issubclass(hint, tuple)):
        return [found for each in get_args(hint) if each is not ... for found in mutable(each, seen)]
    if isinstance(hint, type) and issubclass(hint, Struct):
        if hint in seen:
            return []
        seen.add(hint)
        hints = get_type_hints(hint)
        fields = [found for name in hint.__struct_fields__ for found in mutable(hints[name], seen)]
        return fields if hint.__struct_config__.frozen else [hint.__name__, *fields]
    return [str(hint)]


def test_no_receiver_can_change_a_message_of_another() -> None:
    seen: set[type] = set()

    assert mutable(Message, seen) == ["typing.Any"]  # what a ledger holds: of types of each service, for recorders
    assert len(seen) > len(get_args(Message))


def test_what_can_be_changed_would_be_found() -> None:
    class Loose(Struct, frozen=True):
        fields: dict[str, str]

    class Thawed(Struct):
        inner: tuple[Loose, ...] | None

    assert mutable(Thawed, set()) == ["Thawed", "dict[str, str]"]


class Recording(MemoryHub):
    """A hub that keeps what is sent, as it would be on a wire."""

    def __init__(self, *, decodes: bool) -> None:
        super().__init__(decodes=decodes)
        self.log: list[tuple[str, str, bytes]] = []

    def _pass_on(self, sender: str, received: Received, sample: Sample) -> None:
        self.log.append((sender, received.key, published(received.key, received.message)[0]))
        super()._pass_on(sender, received, sample)


async def performed(*, decodes: bool) -> list[tuple[str, str, bytes]]:
    """All messages of a whole system that performs a block, with something wrong in it, and a turn."""
    config = load()
    services = {name: service(name, config) for name in ("realizer", "recognition", "control", "generation")}
    block = Block(
        id="b",
        behaviors=(
            Speech(id="s", text="this one here"),
            Gesture(id="g", lexeme="BEAT", timing=(Timing("stroke", "s:end"),)),
            Gesture(id="x", lexeme="UNHEARD_OF"),
        ),
    )
    turn = TurnFragment(id="f", addressee="human", behaviors=(Speech(id="s", text="and now you"),))
    async with Recording(decodes=decodes) as hub, running(hub, {"simulation": still(table_world()), **services}):
        async with connect(hub=hub, name="manager") as robot:
            await robot.realize(block)
            await robot.perform(turn)
        await asyncio.sleep(1.0)
        return hub.log


def test_a_whole_system_sends_the_same_messages_byte_for_byte() -> None:
    decoded, undecoded = [run_virtual(performed(decodes=decodes)) for decodes in (True, False)]

    assert len(decoded) > 100
    assert len({key for _, key, _ in decoded}) > 10
    assert decoded == undecoded


@pytest.mark.parametrize("decodes", [True, False])
async def test_what_cannot_be_sent_is_refused_at_its_sender(decodes: bool) -> None:
    async with MemoryHub(decodes=decodes) as hub:
        bus = hub.join("one")
        bus.answer(keys.ESTIMATE, lambda message: message)
        with bus.subscribe(keys.FEEDBACK) as inbox:
            for bad in (object(), "\udc80"):
                point = SyncPointProgress(block="b", behavior=bad, sync="end", at=bus.stamp(), time=0.0)  # type: ignore[arg-type]
                with pytest.raises((TypeError, UnicodeEncodeError)):
                    bus.publish(keys.FEEDBACK, point)
            assert len(inbox) == 0


async def test_documents_are_decoded_in_any_case_and_the_rest_is_what_was_sent() -> None:
    async with MemoryHub(decodes=False) as hub:
        bus = hub.join("one")
        request = PerformBlock(id="r", block=Block(id="b"))
        warning = WarningFeedback(block="b", kind="LATE", message="so")
        with bus.subscribe(keys.BLOCK, keys.FEEDBACK) as inbox:
            bus.publish(keys.BLOCK, request)
            bus.publish(keys.FEEDBACK, warning)
            first, second = [await inbox.next() for _ in range(2)]
        bus.answer(keys.status("one"), lambda question: question)
        asked = AskStatus()

        assert first is not None
        assert (first.message == request, first.message is request) == (True, False)
        assert second is not None
        assert second.message is warning
        assert await bus.query(keys.status("one"), asked) is asked
