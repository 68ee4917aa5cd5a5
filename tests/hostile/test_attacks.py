"""The whole robot under attack: short forms of what was run with thousands of seeds (docs/hostile.md)."""

import pytest

from engage_hri.services.control.torso.body import SimulatedBody
from tests.hostile.own import CarelessBody, broken_client, deaf_client, good_client
from tests.random_cases import share_of
from tests.rigs.hostile.attacks import attack
from tests.rigs.hostile.trial import Kind, Report


def told(reports: list[Report]) -> str:
    return "\n".join(f"seed {report.attack.seed}: {line}" for report in reports for line in report.wrong)


@pytest.mark.parametrize("seed", range(share_of(4)))
def test_random_messages_end_nothing_and_leave_nothing_behind(seed: int) -> None:
    report = attack(seed, kinds=("messages",), seconds=10.0)

    assert report.wrong == []
    assert report.counts["messages"] > 100
    assert report.counts["messages that were none"] > 10


@pytest.mark.parametrize("seed", [0, 2, 5, 6])
def test_a_lying_body_and_cuts_leave_each_request_with_one_outcome(seed: int) -> None:
    report = attack(seed, kinds=("body",), seconds=15.0)

    assert report.wrong == []
    assert report.counts["honest requests"] > 5


@pytest.mark.parametrize("seed", range(share_of(3)))
def test_a_body_of_ones_own_is_tried_behind_the_real_control(seed: int) -> None:
    report = attack(seed, kinds=("messages", "body"), seconds=10.0, body=SimulatedBody, client=good_client)

    assert report.wrong == []


def test_the_same_seed_does_the_same() -> None:
    one, other = (attack(7, kinds=("messages", "body"), seconds=8.0) for _ in range(2))

    assert one.counts == other.counts
    assert one.wrong == other.wrong


@pytest.mark.contained
def test_a_careless_body_is_found_out() -> None:
    report = attack(1, kinds=("body",), seconds=8.0, body=CarelessBody)

    assert any("list index out of range" in line for line in report.wrong)
    assert any("CarelessBody" in trace or "own.py" in trace for trace in report.failures)


def test_a_client_that_never_ends_is_found_out() -> None:
    report = attack(1, kinds=("body",), seconds=2.0, client=deaf_client)

    assert any("the client has not ended" in line for line in report.wrong)


def test_a_client_that_breaks_is_found_out() -> None:
    report = attack(1, kinds=("body",), seconds=2.0, client=broken_client)

    assert any("KeyError('mine')" in line for line in report.wrong)


@pytest.mark.parametrize("kinds", [("requests",)])
def test_requests_at_bad_moments_end_no_service_and_no_honest_request(kinds: tuple[Kind, ...]) -> None:
    reports = [attack(seed, kinds=kinds, seconds=10.0) for seed in range(4)]

    assert told(reports) == ""
    assert not any(report.failures for report in reports)
