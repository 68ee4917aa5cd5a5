"""`engage fault` beside a body in a process of its own, over real sockets; and what it sends, from what was on."""

import asyncio
from asyncio.subprocess import Process
from typing import Any

import msgspec
import pytest

from engage_hri.schemas.body import Capabilities, FaultKind
from engage_hri.schemas.body_faults import BodyFault, SwitchFaults, flaw, switched
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.bodies.fault import listed
from engage_hri.services.control.torso.body import SimulatedBody
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, line, stopped

SLOW, STALL = BodyFault(kind="slow", part="head", amount=3.0), BodyFault(kind="stall", part="head", before="end")


async def said(process: Process) -> tuple[int, str, str]:
    out, err = await asyncio.wait_for(process.communicate(), PATIENCE)
    assert process.returncode is not None
    return process.returncode, out.decode().strip(), err.decode().strip()


@pytest.mark.real_time
async def test_faults_are_switched_from_the_command_line() -> None:
    where = ("--robot", "faulty", "--connect", endpoint := free_endpoint())
    control = await start("run", "control", "--robot", "faulty", "--listen", endpoint, "--set",
                          "control.variability.noise=0.2")  # fmt: skip
    try:
        await line(control, "control is ready")
        stall = ("stall", "--part", "right_arm", "--before", "stroke")
        assert await said(await start("fault", *stall, *where)) == (
            0, "on: noise 0.2, stall right_arm before stroke", ""
        )  # fmt: skip
        code, out, _ = await said(await start("fault", "list", *where))
        assert (code, out.splitlines()[-1]) == (0, "on: noise 0.2, stall right_arm before stroke")
        assert "voiceless: The voice cannot speak and knows it" in out
        assert await said(await start("fault", "noise", "--off", *where)) == (
            0, "on: stall right_arm before stroke", ""
        )  # fmt: skip
        code, _, error = await said(await start("fault", "slow", "--part", "wing", *where))
        assert code == 2
        assert error.startswith("slow: slow of 'wing': known are head, torso, left_arm, right_arm, face, voice")
        assert await said(await start("fault", "none", *where)) == (0, "on: nothing; the body is healthy", "")
    finally:
        await stopped(control)


def after(*before: BodyFault, **request: Any) -> tuple[BodyFault, ...]:
    return switched(before, SwitchFaults(id="1", **request))


def test_a_fault_is_added_and_replaces_one_of_another_amount() -> None:
    assert after(SLOW, on=(STALL,)) == (SLOW, STALL)
    faster = BodyFault(kind="slow", part="head", amount=2.0)
    assert after(SLOW, STALL, on=(faster,)) == (STALL, faster)
    assert after(SLOW, STALL, on=(BodyFault(kind="slow"),)) == (SLOW, STALL, BodyFault(kind="slow"))


def test_what_is_named_is_switched_off_and_what_is_not_on_is_an_error() -> None:
    assert after(SLOW, STALL, off=(BodyFault(kind="slow"),)) == (STALL,)
    assert after(SLOW, STALL, off=(BodyFault(kind="stall", part="head"),)) == (SLOW,)
    with pytest.raises(InputRefused, match=r"slow left_arm 2: is not on \(on: slow head 3\)"):
        after(SLOW, off=(BodyFault(kind="slow", part="left_arm"),))


def test_all_go_off_before_others_come_on() -> None:
    assert after(SLOW, STALL, all_off=True) == ()
    assert after(SLOW, STALL, all_off=True, on=(STALL, SLOW)) == (STALL, SLOW)
    assert after(SLOW, STALL, off=(SLOW,), on=(SLOW,)) == (STALL, SLOW)
    with pytest.raises(InputRefused, match=r"is not on \(on: nothing\)"):
        after(SLOW, all_off=True, off=(SLOW,))


async def test_the_list_tells_what_each_kind_does_and_takes() -> None:
    text = listed(SimulatedBody().capabilities, (SLOW,))

    assert "\n    --amount: factor of time; below 1: quicker, within the limits; without it 2\n" in text
    assert text.endswith("\non: slow head 3")
    assert listed(Capabilities(body="real", types=(), parts=()), ()) == "this body can play no faults"


def test_the_list_tells_what_a_body_says_of_its_own_kinds_as_the_bus_brings_it() -> None:
    own = (
        FaultKind(kind="slow", does="Its gears are stiff.", on="part", amount="degrees", low=1.0, high=3.0),
        FaultKind(kind="blocked", does="Something stands in the way.", on="part", parts=("left_arm",)),
    )
    able = Capabilities(
        body="b", types=(), parts=("left_arm", "right_arm"), faults=("slow", "blocked", "x"), fault_kinds=own
    )
    text = listed(msgspec.json.decode(msgspec.json.encode(able), type=Capabilities), ())

    assert text.splitlines() == [
        "slow: Its gears are stiff.", "    --part: left_arm, right_arm; without it all", "    --amount: degrees",
        "blocked: Something stands in the way.", "    --part: left_arm; without it all",
        "x: a fault of this body, which does not say what it does", "on: nothing",
    ]  # fmt: skip
    assert flaw(BodyFault(kind="slow", amount=4.0), able) == "the amount of slow is 4: expected 1..3 (degrees)"
    assert flaw(BodyFault(kind="blocked", part="right_arm"), able) == "blocked of 'right_arm': known are left_arm"


async def test_no_kind_of_the_torso_with_physics_is_without_a_meaning() -> None:
    pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
    from engage_hri.services.control.mujoco.body import MujocoBody

    text = listed(MujocoBody().capabilities, ())

    assert "does not say" not in text
    assert "\nweak: The motor has a share of its torque" in text
    assert "\nslow: The gears are stiff with old grease" in text
