"""Leases that inhibit gaze or pointing: taken, released, and what is still permitted."""

import pytest

from engage_hri.schemas.behaviors import Gaze, Gesture, Pointing, Speech
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import Inhibit
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.inhibitions import Inhibition, Leases, Permits


def lease(id: str = "l", **fields: object) -> Inhibit:
    return Inhibit(id=id, requester="manager", **fields)  # type: ignore[arg-type]


def test_a_lease_forbids_until_it_is_released() -> None:
    leases = Leases(GenerationConfig())
    leases.take(lease())

    assert not leases.permits().gaze
    assert leases.release("l")
    assert leases.permits() == Permits()
    assert leases.inhibition is None


def test_the_newest_lease_on_gaze_claims_the_head() -> None:
    leases = Leases(GenerationConfig())
    leases.take(lease("a"))
    leases.take(lease("b", mode="target", target="table"))
    leases.take(lease("c", part="point-left"))

    assert leases.inhibition == Inhibition("table", "manager: target", "target")
    assert leases.release("b")
    assert leases.inhibition == Inhibition("", "manager: hold", "hold")
    assert not leases.release("b")


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"ttl": 0.0}, "ttl"),
        ({"ttl": -1.0}, "ttl"),
        ({"ttl": float("nan")}, "ttl"),
        ({"ttl": float("inf")}, "ttl"),
        ({"mode": "target"}, "target"),
    ],
)
def test_a_lease_that_means_nothing_is_refused(fields: dict[str, object], reason: str) -> None:
    leases = Leases(GenerationConfig())

    with pytest.raises(InputRefused, match=reason):
        leases.take(lease(**fields))

    assert leases.permits() == Permits()


@pytest.mark.parametrize(
    ("parts", "hands"),
    [
        ([], ("LEFT_HAND", "RIGHT_HAND")),
        (["point-left"], ("RIGHT_HAND",)),
        (["point-right"], ("LEFT_HAND",)),
        (["point-left", "point-right"], ()),
    ],
)
def test_each_arm_is_inhibited_by_itself(parts: list[str], hands: tuple[str, ...]) -> None:
    leases = Leases(GenerationConfig())
    for part in parts:
        leases.take(lease(part, part=part))

    permits = leases.permits()

    assert permits.hands == hands
    assert permits.allows(Pointing(id="p", target="x")) == bool(hands)
    assert permits.allows(Pointing(id="p", target="x", mode="BOTH_HANDS")) == (len(hands) == 2)
    assert bool(permits.no_point) == (not hands)


def test_degraded_generation_is_a_standing_inhibition_of_everything_but_words() -> None:
    leases = Leases(GenerationConfig(condition="degraded-generation"))
    permits = leases.permits()

    assert leases.inhibition is not None
    assert leases.inhibition.mode == "stare"
    assert permits.allows(Speech(id="s", text="hello"))
    assert not permits.allows(Gaze(id="g", target="x"))
    assert not permits.allows(Gesture(id="b", lexeme="beat"))
    assert permits.no_gaze == permits.no_point == "speech only"


def test_degraded_recognition_changes_nothing_here() -> None:
    leases = Leases(GenerationConfig(condition="degraded-recognition"))

    assert leases.permits() == Permits()
    assert leases.inhibition is None
