"""Whatever Python value is given as a fragment, a block, a call, a piece or a name: it is refused in words."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.faults import EngageError, InputRefused
from engage_hri.schemas.summary import Summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.inputs import block_in, call_in, fragment_in
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.control.testing.plugin import virtual_loop
from tests.random_cases import share_of


class Unshown:
    """Its `repr` fails, and so does nearly everything else."""

    def __repr__(self) -> str:
        raise AttributeError("nothing is shown")


def _endless() -> Any:
    inner: Any = []
    for _ in range(5000):
        inner = [inner]
    return inner


_ATOMS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9), st.binary(max_size=9),
    st.binary(max_size=9).map(bytearray), st.binary(max_size=9).map(memoryview), st.builds(object),
    st.builds(Unshown), st.builds(_endless), st.sampled_from([int, asyncio, len]),
    st.sampled_from(["\ud800", "[]", "null", "7", '{"parts": 7}', b"[]", b"<bml/>", "<bml/>"]),
)  # fmt: skip
_KEYS = st.one_of(
    st.none(), st.integers(), st.sampled_from(["turn_status", "parts", "say", "id", "type", "behaviors"])
)
VALUES = st.recursive(
    _ATOMS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.lists(inner, max_size=2).map(tuple),
        st.dictionaries(_KEYS, inner, max_size=4),
        st.frozensets(st.integers() | st.text(max_size=3), max_size=3),
    ),
    max_leaves=6,
)
CALL = {"turn_status": "full", "parts": [{"say": "hi"}]}


@settings(max_examples=share_of(100))
@given(value=VALUES)
@pytest.mark.parametrize("read", [fragment_in, block_in, call_in])
def test_what_is_no_input_is_refused(read: Callable[[Any, str], object], value: Any) -> None:
    with pytest.raises(InputRefused):
        read(value, "unnamed")


async def _of(value: Any) -> AsyncIterator[Any]:
    yield value


CALLS: dict[str, Callable[[Robot, Any], Any]] = {
    "perform": lambda robot, value: robot.perform(value, timeout=0.1),
    "perform within": lambda robot, value: robot.perform(CALL, timeout=value),
    "begin to perform": lambda robot, value: robot.begin_to_perform(value),
    "realize": lambda robot, value: robot.realize(value, timeout=0.1),
    "realize behaviors": lambda robot, value: robot.realize("greet", value, timeout=0.1),
    "realize constraints": lambda robot, value: robot.realize(b"<bml id='b'/>", follows=value, timeout=0.1),
    "inhibit": lambda robot, value: robot.inhibit_gaze(value, timeout=0.1).__aenter__(),
    "stream": lambda robot, value: stream(robot, value, id="turn"),
    "stream a piece": lambda robot, value: stream(robot, _of(value), id="turn"),
    "stream as": lambda robot, value: stream(robot, _of([]), id=value),
    "stream a turn": lambda robot, value: stream(robot, _of("hi"), id="turn", turn=value),
    "events": lambda robot, value: robot.connection_events(value),
    "events of a kind": lambda robot, value: robot.connection_events("ann", value),
    "statistics": lambda robot, value: robot.statistics(value, 0.1),
    "world": lambda robot, value: robot.world(value),
}


@given(value=VALUES)
@settings(max_examples=share_of(30))
@pytest.mark.parametrize("name", CALLS)
def test_a_robot_takes_any_value_or_refuses_it_in_words(name: str, value: Any) -> None:
    async def ask() -> None:
        async with MemoryHub() as hub, connect(hub=hub) as robot:
            try:
                given = CALLS[name](robot, value)
                if asyncio.iscoroutine(given):
                    await asyncio.wait_for(given, 1.0)  # there is no robot, so nothing is ever accepted
            except (EngageError, TimeoutError):
                pass
            except ValueError:  # a name that can be no person, or no kind
                if name not in ("events", "events of a kind", "statistics"):
                    raise

    _run(ask())


@given(value=VALUES)
@settings(max_examples=30)
def test_perform_call_never_raises_for_what_becomes_of_a_call(value: Any) -> None:
    async def call() -> None:
        async with MemoryHub() as hub, connect(hub=hub) as robot:
            for result in (await perform_call(robot, value), await perform_call(robot, CALL, timeout=value or -1.0)):
                assert isinstance(result, Summary)
                assert result.status in ("refused", "unknown", "failed")
                assert result.json

    _run(call())


def _run(coroutine: Any) -> None:
    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        runner.run(coroutine)
