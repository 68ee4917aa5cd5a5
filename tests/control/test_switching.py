"""Faults of the simulated body, switched on in the middle of what it does, and off again."""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing, suppress
from random import Random

import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, Pointing, Speech
from engage_hri.schemas.body_faults import KINDS, BodyFault, flaw, words
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.config import Displaced, Slow, Stall, Variability
from engage_hri.services.control.contract.body import Body, BodyFailed, MovementAuthority, Progress, Spoke
from engage_hri.services.control.testing.findings import angles
from engage_hri.services.control.testing.motions import recorded, violations
from engage_hri.services.control.testing.stage import Stage, default, performed, times
from engage_hri.services.control.testing.suite import WORLD
from engage_hri.services.control.testing.truth import CROWDS, crowded
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.watching import Bystander
from tests.random_cases import share_of

POINT = Pointing(id="p", target="near-right", mode="RIGHT_HAND")
SPEECH = Speech(id="s", text="one two three four five six seven eight nine ten")
PARTS = ("head", "left_arm", "right_arm", "torso", "face")


@pytest.fixture
async def body() -> SimulatedBody:
    body = SimulatedBody()
    body.see(WORLD)
    return body


def now() -> float:
    return asyncio.get_running_loop().time()


def phases(body: Body, behavior: BlockBehavior) -> dict[str, float]:
    return {phase.to: phase.natural for phase in body.estimate(behavior, None, WORLD).phases}


# -- each by itself -----------------------------------------------------------------------------------------------


async def test_an_arm_that_becomes_slow_on_its_way_comes_late_by_as_much(body: SimulatedBody):
    expected, begin = phases(body, POINT), now()
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(0.2)
    body.switch_faults([BodyFault(kind="slow", part="right_arm", amount=4.0)])
    await asyncio.sleep(1.0)
    body.switch_faults([])
    at = times(await stage.over())

    late = at["stroke"] - begin - sum(expected[sync] for sync in ("ready", "stroke_start", "stroke"))
    assert late == pytest.approx(1.0 * (1 - 1 / 4), abs=0.1)  # it takes a moment to change its speed
    assert at["end"] - at["relax"] == pytest.approx(expected["end"])


async def test_what_goes_on_in_other_parts_is_not_slower(body: SimulatedBody):
    gaze = Gaze(id="g", target="near-right")
    expected, begin = phases(body, gaze), now()
    stage = Stage(body, gaze, "end")
    await asyncio.sleep(0.1)
    body.switch_faults([BodyFault(kind="slow", part="right_arm", amount=4.0)])

    assert times(await stage.over())["end"] - begin == pytest.approx(sum(expected.values()))


async def test_an_arm_stalls_on_its_way_until_it_is_let_go(body: SimulatedBody):
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(0.1)
    body.switch_faults([BodyFault(kind="stall", part="right_arm", before="stroke")])
    await asyncio.sleep(5.0)
    stood = body.state().pose
    await asyncio.sleep(5.0)

    assert stage.passed == ["start", "ready", "stroke_start"]
    assert body.state().pose == stood
    body.switch_faults([])
    released = now()
    at = times(await stage.over())
    assert released < at["stroke"] < released + 1.0
    assert default(stage.passed) == sync_points(POINT)


async def test_a_stall_that_is_over_does_not_begin_anew_when_another_fault_is_added(body: SimulatedBody):
    stall = BodyFault(kind="stall", part="right_arm", before="stroke", amount=1.0)
    body.switch_faults([stall])
    stage = Stage(body, POINT, "stroke")
    await asyncio.sleep(5.0)
    body.switch_faults([stall, BodyFault(kind="mute")])
    stage.authority.extend("end")
    await asyncio.sleep(2.0)

    assert stage.task.done()


async def test_a_stall_that_comes_too_late_to_stop_there_does_not_happen(body: SimulatedBody):
    expected, begin = phases(body, POINT), now()
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(expected["ready"] - 0.001)
    body.switch_faults([BodyFault(kind="stall", part="right_arm", before="ready")])
    at = times(await stage.over())

    assert at["end"] - begin == pytest.approx(sum(expected.values()))


async def test_a_motor_gives_out_on_its_way_and_the_arm_goes_home(body: SimulatedBody):
    home = body.state().pose
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(0.2)
    body.switch_faults([BodyFault(kind="overheated", part="right_arm")])

    with pytest.raises(BodyFailed, match="motor of the right_arm is overheated"):
        await stage.over()
    await asyncio.sleep(3.0)
    assert "stroke" not in stage.passed
    assert angles(body.state().pose) == pytest.approx(angles(home), abs=0.01)


async def test_a_motor_that_has_cooled_down_in_time_does_not_give_out(body: SimulatedBody):
    stage = Stage(body, POINT, "start")
    await asyncio.sleep(0.1)
    body.switch_faults([BodyFault(kind="overheated", part="right_arm")])
    await asyncio.sleep(1.0)
    body.switch_faults([])
    stage.authority.extend("end")
    await stage.over()

    assert default(stage.passed) == sync_points(POINT)


async def test_noise_comes_and_goes(body: SimulatedBody):
    point = Pointing(id="q", target="near-right", mode="RIGHT_HAND")
    natural = sum(phases(body, point).values())
    took = []
    for faults in ([BodyFault(kind="noise", amount=0.3)], []):
        body.switch_faults(faults)
        begin = now()
        took.append(times(await performed(body, point))["end"] - begin)

    assert took[0] != pytest.approx(natural, abs=0.005)
    assert took[1] == pytest.approx(natural)


async def test_an_arm_that_somebody_moves_comes_early_once(body: SimulatedBody):
    near = [
        BodyFault(kind="displaced", part="right_shoulder_pitch", amount=25.0),
        BodyFault(kind="displaced", part="right_elbow", amount=80.0),
    ]
    body.switch_faults(near)
    await asyncio.sleep(2.0)
    believed = sum(list(phases(body, POINT).values())[:3])
    at = times(await performed(body, POINT))
    again = times(await performed(body, POINT))

    assert at["stroke"] - at["start"] < believed - 0.05
    assert again["stroke"] - again["start"] == pytest.approx(believed)


async def test_an_arm_that_was_moved_goes_home_when_that_is_over(body: SimulatedBody):
    home = body.state().pose
    body.switch_faults([BodyFault(kind="displaced", part="right_elbow", amount=80.0)])
    await asyncio.sleep(2.0)
    assert angles(body.state().pose) != pytest.approx(angles(home), abs=0.01)
    body.switch_faults([])
    await asyncio.sleep(2.0)

    assert angles(body.state().pose) == pytest.approx(angles(home), abs=0.01)


async def test_nobody_moves_an_arm_that_moves_or_into_the_table(body: SimulatedBody):
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(0.3)
    with pytest.raises(InputRefused, match="the right arm moves"):
        body.switch_faults([BodyFault(kind="displaced", part="right_elbow", amount=80.0)])
    assert body.faults == ()
    await stage.over()
    with pytest.raises(InputRefused, match=r"expected 5\.\.145"):
        body.switch_faults([BodyFault(kind="displaced", part="right_elbow", amount=3.0)])
    with pytest.raises(InputRefused, match="touch the table"):
        body.switch_faults(
            [
                BodyFault(kind="displaced", part="right_shoulder_pitch", amount=20.0),
                BodyFault(kind="displaced", part="right_elbow", amount=60.0),
            ]
        )


async def test_a_voice_falls_silent_in_the_middle_and_does_not_know(body: SimulatedBody):
    stage = Stage(body, SPEECH, "end")
    await asyncio.sleep(1.0)
    assert body.state().speaking == SPEECH.text
    body.switch_faults([BodyFault(kind="mute")])
    assert body.state().speaking == ""
    await asyncio.sleep(1.0)
    body.switch_faults([])
    assert body.state().speaking == SPEECH.text

    assert [item.word for item in await stage.over() if isinstance(item, Spoke)] == SPEECH.text.split()


async def test_a_voice_that_knows_it_has_gone_fails_at_a_word(body: SimulatedBody):
    stage = Stage(body, SPEECH, "end")
    await asyncio.sleep(1.0)
    body.switch_faults([BodyFault(kind="voiceless")])
    with pytest.raises(BodyFailed, match="cannot speak"):
        await stage.over()

    assert stage.passed == ["start"]
    assert not body.estimate(SPEECH, None, WORLD).feasible
    body.switch_faults([])
    assert times(await performed(body, SPEECH))["end"]


async def test_a_fault_of_one_behavior_leaves_the_others_alone(body: SimulatedBody):
    body.switch_faults([BodyFault(kind="slow", amount=3.0, behavior="p")])
    natural = sum(phases(body, POINT).values())
    took = [times(await performed(body, Pointing(id=id, target="near-right"))) for id in ("p", "other")]

    assert [at["end"] - at["start"] > 2 * natural for at in took] == [True, False]


# -- the law of the contract --------------------------------------------------------------------------------------

RANDOM = {
    "slow": lambda chance: BodyFault(kind="slow", part=chance.choice(PARTS), amount=chance.choice((0.5, 2.0, 5.0))),
    "stall": lambda chance: BodyFault(
        kind="stall", part=chance.choice(PARTS), amount=chance.uniform(0.0, 2.0),
        before=chance.choice(("", "ready", "stroke", "stroke_end", "end")),
    ),
    "overheated": lambda chance: BodyFault(kind="overheated", part=chance.choice(PARTS)),
    "noise": lambda chance: BodyFault(kind="noise", amount=0.5),
    "displaced": lambda chance: BodyFault(
        kind="displaced", part=chance.choice(("right_elbow", "neck_yaw")), amount=chance.choice((10.0, 80.0, 100.0))
    ),
    "mute": lambda chance: BodyFault(kind="mute"),
    "voiceless": lambda chance: BodyFault(kind="voiceless"),
    "lost": lambda chance: BodyFault(kind="lost", amount=0.5),
}  # fmt: skip


class Enduring(SimulatedBody):
    """Ends what fails without an error, so that a witness hears the rest."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        try:
            async with aclosing(super().perform(behavior, authority)) as stream:
                async for progress in stream:
                    yield progress
        except BodyFailed:
            authority.revoke()


async def troubled(body: SimulatedBody, kinds: Sequence[str], chance: Random) -> None:
    """Switch faults of these kinds on and off, for ever."""
    while True:
        await asyncio.sleep(chance.uniform(0.0, 0.8))
        faults = [RANDOM[chance.choice(kinds)](chance) for _ in range(chance.randrange(0, 3))]
        assert not [reason for fault in faults if (reason := flaw(fault, body.capabilities))]
        with suppress(InputRefused):  # a joint is displaced only while its part rests
            body.switch_faults(faults)


@pytest.mark.parametrize("seed", range(share_of(3)))
@pytest.mark.parametrize("crowd", CROWDS)
@pytest.mark.parametrize("kinds", [*RANDOM, "all"])
async def test_whatever_fault_comes_no_point_is_reported_that_the_joints_do_not_bear_out(
    kinds: str, crowd: str, seed: int
) -> None:
    body, chance = Enduring(), Random(f"{kinds} {crowd} {seed}")
    body.see(WORLD)
    home = body.state().pose
    able = tuple(RANDOM) if kinds == "all" else (kinds,)
    if crowd == "nods" and kinds == "displaced":
        pytest.skip("a nod ends where the head is, and who has moved it is not known to the witness")
    if crowd == "nods":
        able = tuple(kind for kind in able if kind != "displaced")
    trouble = asyncio.create_task(troubled(body, able, chance))
    async with recorded(body) as recording:
        witness = await crowded(Bystander(), body, CROWDS[crowd], chance)
        trouble.cancel()
        body.switch_faults([])
        assert witness is not None
        lies = await witness.close(may_fail=True)
        await body.home()

    assert lies == []
    for stage in witness.stages:
        told, points = default(stage.passed), sync_points(stage.behavior)
        assert told == points[: len(told)]
        assert not stage.passed or told == points or stage.authority.revoked
    assert angles(body.state().pose) == pytest.approx(angles(home), abs=0.01)
    assert violations(recording, body.capabilities.joints) == []


async def test_every_kind_that_it_names_is_tried() -> None:
    body = SimulatedBody()

    assert set(body.capabilities.faults) == set(KINDS)
    assert set(RANDOM) == set(KINDS) - {"miscalibrated"}  # see test_miscalibrated.py


# -- configuration ------------------------------------------------------------------------------------------------


async def test_what_the_configuration_says_is_on_and_can_be_switched_off() -> None:
    said = Variability(
        slow=(Slow(part="head", factor=3.0),), stall=(Stall(part="face", before="stroke", seconds=2.0),),
        displaced=(Displaced(joint="right_elbow", angle=80.0),), overheated=("left_arm",), noise=0.1, mute="refuse",
        lost=0.2,
    )  # fmt: skip
    body = SimulatedBody(deviations=said)

    assert list(map(words, body.faults)) == [
        "slow head 3", "stall face 2 before stroke", "overheated left_arm", "displaced right_elbow 80", "noise 0.1",
        "voiceless", "lost 0.2",
    ]  # fmt: skip
    body.switch_faults([])
    assert body.faults == ()
    assert body.estimate(FaceLexeme(id="f", lexeme="SMILE"), None, WORLD).feasible


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (
            Variability(displaced=(Displaced(joint="third_elbow", angle=80.0),)),
            "displaced of 'third_elbow': known are",
        ),
        (Variability(slow=(Slow(part="hand", factor=2.0),)), "slow of 'hand': known are head, torso"),
        (Variability(stall=(Stall(part="head", before="noon"),)), "stall before 'noon': known are ready"),
    ],
)
async def test_a_fault_that_no_body_can_have_is_refused_at_the_start(said: Variability, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        SimulatedBody(deviations=said)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (BodyFault(kind="sleepy"), "cannot play 'sleepy'; it can play slow, stall"),
        (BodyFault(kind="mute", part="head", amount=1.0), "mute takes no part and no amount"),
        (BodyFault(kind="stall", part="voice"), "stall of 'voice': known are head"),
        (BodyFault(kind="slow", amount=0.0), "the amount of slow is 0: expected 0.05..100 (factor"),
        (BodyFault(kind="lost", amount=float("nan")), "the amount of lost is nan"),
        (BodyFault(kind="displaced", part="right_elbow"), "displaced needs an amount: degrees"),
        (BodyFault(kind="displaced", amount=4.0), "displaced of '': known are torso_turn"),
    ],
)  # fmt: skip
async def test_a_fault_that_makes_no_sense_is_refused_with_what_would(fault: BodyFault, reason: str) -> None:
    assert reason in flaw(fault, SimulatedBody().capabilities)
