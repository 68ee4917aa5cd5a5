"""What a visitor is told before they sit down: who is there already."""

import asyncio

from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.console.web.script import Script
from engage_hri.services.console.web.seats import invitation
from engage_hri.services.console.web.service import window
from engage_hri.services.runtime.service import running
from tests.console.test_seats import idle


def test_nobody_is_there() -> None:
    invited = invitation((), {}, {"collaboration"})

    assert invited.button == "Take a seat"
    assert invited.there.startswith("Nobody sits before the robot.")


def test_who_is_simulated_and_has_the_task_is_told_before_one_sits_beside() -> None:
    invited = invitation(("human",), {"human": "simulation"}, {"simulation", "collaboration"})

    assert invited.button == "Sit beside human"
    assert invited.there == (
        "human sits before the robot already, and is played by a program. "
        "You may sit down beside them: the robot sees you, and looks back at you. "
        "But it does its task with the person whom it met first, until that person leaves. "
        "To have the robot for yourself, start it with `engage demo --you`."
    )


def test_other_visitors_are_people_of_their_own() -> None:
    invited = invitation(("ann", "bob"), {"ann": "perceive-1", "bob": "perceive-2"}, {"simulation"})

    assert invited.button == "Sit beside ann and bob"
    assert invited.there == (
        "ann and bob sit before the robot already. "
        "You may sit down beside them: the robot sees you, and looks back at you."
    )


def test_a_crowd_makes_no_long_button() -> None:
    assert invitation(tuple("abcde"), {}, ()).button == "Sit beside a, b and 3 others"


async def test_the_window_knows_who_is_there_and_who_tells_of_them(hub: MemoryHub) -> None:
    bus = hub.join("console", role="wizard")
    async with running(hub, {"recognition": idle}), window(hub, bus, Script(())) as shown:
        assert shown.invitation.button == "Take a seat"
        async with perceive("human", hub=hub, name="simulation"):
            await asyncio.sleep(0.1)
            assert "human sits before the robot already, and is played by a program." in shown.invitation.there
        await asyncio.sleep(0.1)
        assert shown.invitation.button == "Take a seat"
