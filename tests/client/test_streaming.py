"""A turn that is spoken while it is still being written, against a generation that answers as the protocol says."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnClosed, TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.summary import summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import connect
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready, running

LASTS = 1.0
"""Seconds that each fragment takes, one after the other."""
Judge = Callable[[TurnFragment], Fault | str]
"""A fault: refused; a status: how its performance ends."""


def good(fragment: TurnFragment) -> str:
    return "done"


class Generation:
    """Performs fragments in order. heard: each with the time it came at. A fragment that ends badly ends its turn."""

    def __init__(self, judge: Judge = good) -> None:
        self.heard: list[tuple[float, TurnFragment]] = []
        self.cancelled: list[str] = []
        self._judge = judge
        self._asked: dict[str, PerformFragment] = {}
        self._ends: dict[str, asyncio.TimerHandle] = {}
        self._free = 0.0
        self._open = False

    @property
    def statuses(self) -> list[str]:
        return [fragment.turn_status for _, fragment in self.heard]

    async def serve(self, bus: Bus, ready: Ready) -> None:
        desk = RequestDesk(bus, "generation", lambda cancel: None)
        with bus.subscribe(*RequestDesk.patterns("generation")) as inbox:
            ready()
            async for received in inbox:
                match desk.take(received):
                    case PerformFragment() as request:
                        self._take(bus, desk, request)
                    case Cancel(id=id):
                        self.cancelled.append(id)
                        self._ends[id].cancel()
                        self._end(bus, desk, self._asked[id], "interrupted")

    def _take(self, bus: Bus, desk: RequestDesk, request: PerformFragment) -> None:
        loop, fragment = asyncio.get_running_loop(), request.fragment
        self.heard.append((loop.time(), fragment))
        verdict = self._judge(fragment)
        if fragment.turn_status in ("middle", "end") and not self._open:
            verdict = Fault(reason=f"{fragment.turn_status} with no turn open", where=fragment.id)
        if isinstance(verdict, Fault):
            desk.refuse(request.id, verdict)
            return
        desk.accept(request.id)
        self._open = fragment.turn_status in ("beginning", "middle")
        self._free = max(self._free, loop.time()) + LASTS
        self._asked[request.id] = request
        self._ends[request.id] = loop.call_at(self._free, self._end, bus, desk, request, verdict)

    def _end(self, bus: Bus, desk: RequestDesk, request: PerformFragment, status: str) -> None:
        id = request.fragment.id
        if status != "done":
            self._open = False
        words = " ".join(each.text for each in request.fragment.behaviors if isinstance(each, Speech))
        spoken = (SpokenText(behavior="s", text=words, complete=status == "done"),)
        fault = Fault(reason="it broke", where=id) if status == "failed" else None
        desk.end(
            FragmentOutcome(id=request.id, fragment=id, status=status, spoken=spoken, fault=fault)  # type: ignore[arg-type]
        )
        if request.fragment.turn_status in ("end", "full"):
            asyncio.get_running_loop().call_later(2.0, self._close, bus, id)

    def _close(self, bus: Bus, id: str) -> None:
        pair = ConnectionEvent(
            id="pair", kind="adjacency_pair", initiator="robot", responder="ann", state="succeeded", response="nod",
            at=bus.stamp(), started=bus.stamp(), delay=2.0, block=id,
        )  # fmt: skip
        bus.publish(
            keys.TURN_CLOSED, TurnClosed(turn="t", addressee="ann", status="done", fragments=(id,), events=(pair,))
        )


async def writing(*pieces: object, pause: float = 0.1) -> AsyncIterator[str]:
    for piece in pieces:
        await asyncio.sleep(pause)
        yield piece  # type: ignore[misc]


def bits(text: str) -> list[str]:
    return [f"{word} " for word in text.split()]


async def spoken(
    hub: MemoryHub, generation: Generation, pieces: AsyncIterator[str], **settings: object
) -> tuple[FragmentOutcome, ...]:
    async with running(hub, {"generation": generation.serve}), connect(hub=hub) as robot:
        return await stream(robot, pieces, id="t", **settings)  # type: ignore[arg-type]


async def test_each_sentence_is_sent_while_the_next_is_being_written(hub: MemoryHub) -> None:
    generation = Generation()
    outcomes = await spoken(hub, generation, writing(*bits("Hello there. Look at [cup]. It is red.")))

    assert [(round(at, 6), each.id, each.turn_status) for at, each in generation.heard] == [
        (0.2, "t-1", "beginning"), (0.5, "t-2", "middle"), (0.8, "t-3", "middle"), (0.8, "t-4", "end"),
    ]  # fmt: skip
    assert [each.fragment for each in outcomes] == ["t-1", "t-2", "t-3", "t-4"]
    assert summary(*outcomes).said == "Hello there. Look at . It is red."  # this one says no references
    (look, cup, stop) = generation.heard[1][1].behaviors
    assert isinstance(stop, Speech)
    assert stop.text == "."
    assert isinstance(look, Speech)
    assert isinstance(cup, Reference)
    assert (cup.target, cup.options) == ("cup", None)


@pytest.mark.parametrize(
    ("text", "statuses"),
    [("Hello", ["full"]), ("Hello. You", ["beginning", "end"]), ("", []), ("A. B. C", ["full"]), ("[cup]", ["full"])],
)
async def test_the_last_words_end_the_turn(hub: MemoryHub, text: str, statuses: list[str]) -> None:
    generation = Generation()
    await spoken(hub, generation, writing(text))

    assert generation.statuses == statuses


async def test_the_turn_as_a_whole_says_whom_it_is_for_and_what_answers_it(hub: MemoryHub) -> None:
    generation = Generation()
    turn = ToolInput(
        turn_status="full", parts=(), turn_index=2, addressee="ann", expects="action", thinking=True
    )  # fmt: skip
    await spoken(hub, generation, writing("One. Two"), turn=turn)

    assert [(each.turn_index, each.addressee, each.accept[:1], each.delay) for _, each in generation.heard] == [
        (2, "ann", ("act",), True), (2, "ann", ("act",), False),
    ]  # fmt: skip


async def test_it_may_return_when_the_turn_is_answered(hub: MemoryHub) -> None:
    outcomes = await spoken(hub, Generation(), writing("One. Two"), await_answer=True)

    assert asyncio.get_running_loop().time() == pytest.approx(0.1 + 2 * LASTS + 2.0)
    assert summary(*outcomes).answer == "nod"


@pytest.mark.parametrize("status", ["interrupted", "failed"])
async def test_nobody_goes_on_writing_when_the_turn_was_taken(hub: MemoryHub, status: str) -> None:
    generation = Generation(lambda fragment: status if fragment.id == "t-1" else "done")
    written: list[str] = []

    async def endless() -> AsyncIterator[str]:
        while True:
            await asyncio.sleep(0.4)
            written.append("Word. ")
            yield "Word. "

    outcomes = await spoken(hub, generation, endless())

    assert len(written) == 3  # at 0.4, 0.8, 1.2: the first fragment ends at 1.4
    assert outcomes[0].status == status
    assert generation.statuses == ["beginning", "middle", "middle"]


async def test_a_refused_fragment_ends_the_turn_and_is_told(hub: MemoryHub) -> None:
    generation = Generation(
        lambda fragment: Fault(reason="no 'cop'", where="$") if fragment.id == "t-2" else "done"
    )  # fmt: skip
    outcomes = await spoken(hub, generation, writing("One. ", "A [cop]. ", "Three. ", "Four."))

    assert [each.status for each in outcomes] == ["done", "refused"]
    assert generation.statuses == ["beginning", "middle", "end"]
    assert generation.heard[-1][1].behaviors == ()
    told = summary(*outcomes)
    assert (told.status, told.said, told.problems) == ("failed", "One.", ("$: no 'cop'",))
    assert told.cut_short


async def test_nothing_is_ended_where_the_first_fragment_was_refused(hub: MemoryHub) -> None:
    generation = Generation(lambda fragment: Fault(reason="nobody is here"))
    outcomes = await spoken(hub, generation, writing("One. ", "Two. "))

    assert [each.status for each in outcomes] == ["refused"]
    assert generation.statuses == ["beginning"]


@pytest.mark.parametrize("bad", ["t-1", "t-2"])
async def test_of_sentences_that_come_at_once_none_is_sent_after_one_that_is_refused(
    hub: MemoryHub, bad: str
) -> None:
    generation = Generation(
        lambda fragment: Fault(reason="another turn is open") if fragment.id == bad else "done"
    )  # fmt: skip
    outcomes = await spoken(hub, generation, writing("One is said. Two is said. Three is said. Four."))

    before = ["t-1"] if bad == "t-2" else []
    assert [each.id for _, each in generation.heard if each.behaviors] == [*before, bad]
    assert [each.status for each in outcomes] == [*["done"] * len(before), *["refused"] * (4 - len(before))]
    assert summary(*outcomes).cut_short == bool(before)  # else nothing was begun


@pytest.mark.parametrize("dies", [0.5, 3.0])
@pytest.mark.parametrize("wait", [0.1, 2.0, 10.0])
async def test_a_stream_ends_unknown_if_generation_dies_and_stays_away(
    hub: MemoryHub, dies: float, wait: float
) -> None:
    lives = AsyncExitStack()
    await lives.enter_async_context(running(hub, {"generation": Generation().serve}))

    async def pieces() -> AsyncIterator[str]:
        yield "One is said. "
        await asyncio.sleep(dies)
        await lives.aclose()
        await asyncio.sleep(wait)
        yield "Two is said. Three is said. "

    async with connect(hub=hub) as robot, asyncio.timeout(dies + 5.0):
        told = summary(*await stream(robot, pieces(), id="t"))

    assert told.status == "unknown"
    assert told.said == ("One is said." if dies > LASTS else "")


async def test_cancelling_the_stream_cancels_what_is_being_said(hub: MemoryHub) -> None:
    generation = Generation()
    closed: list[bool] = []

    async def pieces() -> AsyncIterator[str]:
        try:
            for _ in range(100):
                await asyncio.sleep(0.1)
                yield "Word. "
        finally:
            closed.append(True)

    async with running(hub, {"generation": generation.serve}), connect(hub=hub, name="writer") as robot:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(stream(robot, pieces(), id="t"), 0.25)
        await asyncio.sleep(0.1)

    assert closed == [True]
    assert sorted(id.partition("#")[0] for id in generation.cancelled) == ["writer/t-1", "writer/t-2"]


async def test_what_the_writer_raises_comes_through(hub: MemoryHub) -> None:
    async def broken() -> AsyncIterator[str]:
        yield "One. "
        raise OSError("the model is gone")

    async with running(hub, {"generation": Generation().serve}), connect(hub=hub) as robot:
        with pytest.raises(OSError, match="the model is gone"):
            await stream(robot, broken(), id="t")


async def test_a_tool_call_comes_back_as_its_result_whatever_becomes_of_it(hub: MemoryHub) -> None:
    say = {"turn_status": "full", "parts": [{"say": "Hello."}]}
    generation = Generation(lambda fragment: "failed" if fragment.behaviors[0].id == "refer-1" else "done")
    async with running(hub, {"generation": generation.serve}), connect(hub=hub) as robot:
        good = await perform_call(robot, say, await_answer=True)
        wrong = await perform_call(robot, '{"turn_status": "full", "parts": [{"tell": "x"}]}')
        broken = await perform_call(robot, {"turn_status": "full", "parts": [{"refer": "cup"}]})

    assert (good.status, good.said, good.answer) == ("done", "Hello.", "nod")
    assert (wrong.status, wrong.problems[0][:11]) == ("refused", "$.parts[0]:")
    assert (broken.status, broken.problems) == ("failed", (f"{generation.heard[1][1].id}: it broke",))
    assert len({fragment.id for _, fragment in generation.heard}) == 2


@pytest.mark.parametrize("piece", [3, None, b"bytes", {"say": "x"}, ["a"]])
async def test_a_piece_that_is_no_text_is_refused_as_itself(hub: MemoryHub, piece: object) -> None:
    generation = Generation()
    async with running(hub, {"generation": generation.serve}), connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match=r"^t: the piece .* is neither text nor a `Part`"):
            await stream(robot, writing("Hello there. ", "You", piece, " again."), id="t")

    assert all("again" not in str(fragment) for _, fragment in generation.heard)
