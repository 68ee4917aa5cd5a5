"""The laws of perception: our own eyes keep them, and each mistake that people make is called by its name."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActorLost, HeadPose, Looked
from engage_hri.schemas.units import Stamp
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.testing.gathering import killed_and_recovered, seen
from engage_hri.services.perception.testing.laws import LAWS, Evidence, Told, TrueLook, Verdict, judged
from tests.perception.eyes.faces import recorded
from tests.perception.eyes.people import Pose

pytestmark = pytest.mark.usefixtures("exact_face")
ROBOT = (0.05, 0.0, 1.17)
PLACES = ((0.05, 0.0, 1.17), (0.4, -0.5, 0.8), (0.4, 0.6, 0.8), (0.2, 0.8, 1.6))
"""Places that a head faces, three seconds each."""
RATE = 15


def poses(spread: float = 0.05, person: str = "ann") -> list[Told]:
    """Twelve seconds of a good source: a head that faces the places, as wrong as it states."""
    chance, told = np.random.default_rng(3), list[Told]()
    for k in range(12 * RATE):
        at, eyes = k / RATE, (1.2, 0.1, 1.2)
        ahead = np.array(PLACES[int(at / 3)]) - eyes
        yaw, pitch = np.arctan2(ahead[1], ahead[0]), np.arctan2(ahead[2], np.hypot(*ahead[:2]))
        yaw, pitch = yaw + chance.normal(0, 0.05), pitch + chance.normal(0, 0.05)
        direction = (float(np.cos(yaw) * np.cos(pitch)), float(np.sin(yaw) * np.cos(pitch)), float(np.sin(pitch)))
        pose = HeadPose(
            actor=person, position=eyes, direction=direction, at=Stamp("", at), yaw_spread=spread, pitch_spread=spread
        )
        came = at + 0.05 + float(chance.uniform(0, 0.02))
        told += [Told(pose, at, came), Told(Looked(at=Stamp("", at), seen=(person,)), at, came)]
    return told


TRUTH = [TrueLook(3 * k, 3 * k + 2.99, "ann", place) for k, place in enumerate(PLACES)]


def verdicts(told: list[Told], *, is_live: bool = True) -> dict[str, Verdict]:
    return {each.law: each for each in judged(Evidence(told, TRUTH, is_live))}


def test_a_good_source_keeps_all_laws() -> None:
    assert [each.law for each in verdicts(poses()).values() if each.broken] == []
    assert [each.law for each in verdicts(poses()).values() if each.unjudged] == ["a stall that lasts is told"]


def changed(change: Callable[[HeadPose], HeadPose], **spread: float) -> list[Told]:
    return [
        each._replace(message=change(each.message)) if isinstance(each.message, HeadPose) else each
        for each in poses(**spread)
    ]


def faces(turn: Callable[[float, float, float], tuple[float, float, float]]) -> list[Told]:
    return changed(lambda pose: replace(pose, direction=turn(*pose.direction)))


def in_degrees(x: float, y: float, z: float) -> tuple[float, float, float]:
    yaw = float(np.degrees(np.arctan2(y, x)))
    return float(np.cos(yaw)), float(np.sin(yaw)), z


def quiet(told: list[Told], since: float, until: float) -> list[Told]:
    """The same with a stall."""
    return [each for each in told if not since < each.at < until]


def late(told: list[Told], by: float) -> list[Told]:
    return [each._replace(came=each.at + by) for each in told]


def lost(told: list[Told], at: float, came: float) -> list[Told]:
    said = Told(ActorLost(actor="ann", at=Stamp("", at)), at, came)
    return sorted([*told, said], key=lambda each: each.came)


def renamed(told: list[Told], since: float) -> list[Told]:
    return [
        each._replace(message=replace(each.message, actor="bob"))
        if isinstance(each.message, HeadPose) and each.at > since
        else each
        for each in told
    ]


FACING, HONEST = "heads face where they do", "stated deviations are honest"
BROKEN = {
    "mirrored": (faces(lambda x, y, z: (x, -y, z)), FACING, "mirrored?"),
    "upside down": (faces(lambda x, y, z: (x, y, -z)), FACING, "up and down"),
    "backwards": (faces(lambda x, y, z: (-x, -y, -z)), FACING, "backwards?"),
    "camera axes": (faces(lambda x, y, z: (-y, -z, x)), FACING, "axes of the camera?"),
    "degrees": (faces(in_degrees), FACING, "degrees or radians?"),
    "spread in degrees": (changed(lambda pose: pose, spread=2.9), HONEST, "degrees or radians?"),
    "too sure": (changed(lambda pose: pose, spread=0.01), HONEST, "deviation of each error"),
    "millimetres": (
        changed(lambda pose: replace(pose, position=(1200.0, 100.0, 1200.0))),
        "places are metres in the robot's frame",
        "millimetres?",
    ),
    "stamps of sending": (late(poses(), 0.0), "instants are of capture, not of sending", "sending instead"),
    "too late": (late(poses(), 0.8), "instants are of capture, not of sending", "newest only"),
    "twice": ([*poses()[:60], *poses()[58:]], "instants of capture grow", "one stamp for each picture"),
    "lost by a stall": (
        lost(quiet(poses(), 4.0, 7.0), 4.0, 6.5), "absence only when it is said", "a stall is no absence",
    ),
    "another id after a gap": (
        renamed(quiet(poses(), 4.0, 5.0), 4.5), "ids are kept over gaps and crossings", "keep an id",
    ),
    "a stall untold": (quiet(poses(), 4.0, 7.0), "a stall that lasts is told", "tell a `Fault`"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_mistake_is_found_and_called_by_its_name(name: str) -> None:
    told, law, advice = BROKEN[name]
    verdict = verdicts(told)[law]

    assert verdict.broken
    assert advice in verdict.advice


def test_each_law_is_broken_by_one_of_these() -> None:
    assert {law for _, law, _ in BROKEN.values()} == set(LAWS)


def test_a_stall_that_is_told_and_a_loss_after_looking_keep_the_laws() -> None:
    told = quiet(poses(), 4.0, 7.0)
    fault = Told(Fault(reason="the camera gives no picture for 1.5 s"), 5.6, 5.6)
    found = verdicts(sorted([*told, fault], key=lambda each: each.came))

    assert not any(found[law].broken for law in ("a stall that lasts is told", "absence only when it is said"))


def test_two_who_swap_their_ids_where_they_cross_are_found() -> None:
    told = poses()
    other = [
        each._replace(message=replace(each.message, actor="bob", position=(1.2, 0.9, 1.2)))
        for each in told if isinstance(each.message, HeadPose)
    ]  # fmt: skip
    swapped = [
        each._replace(message=replace(each.message, actor={"ann": "bob", "bob": "ann"}[each.message.actor]))
        if isinstance(each.message, HeadPose) and each.at > 6
        else each
        for each in (*told, *other)
    ]
    found = verdicts(sorted(swapped, key=lambda each: each.came))["ids are kept over gaps and crossings"]

    assert "two places at once" in found.broken
    assert "cross" in found.advice


async def test_our_eyes_keep_the_laws(tmp_path: Path) -> None:
    """Landmarks of two who cross, one of whom is out of sight for a second; then nobody."""

    def heads(at: float) -> list[Pose]:
        here = [Pose((-0.4 + 0.1 * at, 0.0, 1.1), 15.0, -5.0)] if not 3 < at < 4 else []
        return [*here, Pose((0.4 - 0.1 * at, 0.05, 1.5), -10.0, 0.0)] if at < 8 else []

    path = recorded(tmp_path / "a.mcap", heads, 12.0)
    evidence = await seen(EyesConfig(source=f"landmarks:{path}", place=(0.0, 0.0, 1.2)), 20.0, ())
    found = {each.law: each for each in judged(evidence)}

    assert {law: each.broken for law, each in found.items() if each.broken} == {}
    assert len([each for each in found.values() if not each.unjudged]) == 4
    assert len(evidence.of(ActorLost)) == 2


@pytest.mark.real_time
async def test_a_source_of_ours_that_is_killed_looks_again(tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", lambda at: [Pose((0.0, 0.0, 1.0))], 4.0)

    assert await killed_and_recovered(EyesConfig(source=f"landmarks:{path}")) == ("", "")
