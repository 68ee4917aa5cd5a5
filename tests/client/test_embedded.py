"""A robot in the program itself: what it gives, and what its errors look like from there."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri import EngageError, InputRefused, RunFailed, embedded, perceive
from engage_hri.schemas.faults import Fault
from tests.control.test_drivers import Bare

HELLO = {"turn_status": "full", "parts": [{"say": "Hello, do you hear me?"}]}


async def test_it_is_performed_before_a_person_who_answers() -> None:
    async with embedded() as robot:
        outcome = await robot.perform(HELLO, await_answer=True)

    assert outcome.status == "done"
    assert [event.state for event in outcome.events if event.kind == "adjacency_pair"] == ["completed"]


async def test_a_person_of_the_program_is_perceived_on_its_bus() -> None:
    async with embedded(human="none") as robot, perceive("ben", hub=robot.hub) as ben:
        await ben.look_at(ben.robot)
        with robot.utterances() as said:
            await ben.say("Hello, robot.")
            words = [await anext(aiter(said)) for _ in range(2)]

    assert {word.actor for word in words} == {"ben"}
    assert words[-1].text.startswith("Hello,")


async def test_two_of_one_name_in_one_process_know_nothing_of_one_another() -> None:
    async with embedded() as one, embedded(human="none") as other:
        assert (await one.person()).id == "human"
        assert not (await other.world()).people


class Voiceless(Bare):
    """A body of the program, which says that it was connected."""

    connections = 0

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        self.connections += 1
        yield


async def test_a_body_of_the_program_takes_the_place_of_the_simulated_one() -> None:
    body = Voiceless()
    async with embedded(body=body) as robot:
        with pytest.raises(EngageError, match=r"bare|voice"):
            await robot.perform(HELLO)

    assert body.connections == 1


async def test_settings_are_those_of_the_configuration_and_stronger_than_human() -> None:
    async with embedded(settings=["simulation.human=none", "bus.robot=rob"]) as robot:
        assert (robot.id, (await robot.world()).people) == ("rob", ())


@pytest.mark.parametrize("setting", ["realizer.lateness=1", "simulation.human=nobody", "control.body=nothing", "x"])
async def test_a_wrong_setting_is_refused_as_itself(setting: str) -> None:
    with pytest.raises(InputRefused):
        async with embedded(settings=[setting]):
            pass


class Unplugged(Bare):
    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        raise RunFailed(Fault(reason="no cable", where="body"))
        yield


async def test_a_body_that_cannot_be_had_is_told_as_itself() -> None:
    with pytest.raises(RunFailed, match="no cable"):
        async with embedded(body=Unplugged()):
            pass


@pytest.mark.parametrize("error", [KeyError("mine"), ExceptionGroup("mine", [ValueError("a")])])
async def test_an_error_of_the_program_comes_out_as_it_is(error: Exception) -> None:
    with pytest.raises(type(error)) as raised:
        async with embedded():
            raise error

    assert raised.value is error
