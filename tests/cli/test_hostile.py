"""`engage hostile`, in this process."""

import asyncio

import pytest

from engage_hri.services.control.body import BodyState
from engage_hri.services.control.torso.body import SimulatedBody
from tests.cli.command import Engage


class Fainting(SimulatedBody):
    """After a while it does not know any more how it stands."""

    def state(self) -> BodyState:
        if asyncio.get_running_loop().time() > 3.0:
            raise ZeroDivisionError("of mine")
        return super().state()


class Unplugged(SimulatedBody):
    """Its SDK finds no robot."""

    def __init__(self) -> None:
        raise OSError("no serial port")


def test_it_prints_what_was_sent_and_what_came_of_it(engage: Engage) -> None:
    result = engage("hostile", "--only", "body", "--runs", 1, "--seconds", 5)

    assert result.code == 0
    assert "requests without outcome" in result.out
    assert "contained failures" in result.out


@pytest.mark.contained
def test_what_goes_wrong_is_told_with_the_command_that_does_it_again(engage: Engage) -> None:
    body = f"{__name__}:Fainting"

    result = engage("hostile", "--only", "body", "--runs", 1, "--seed", 4, "--seconds", 5, "--body", body)

    assert result.code == 1
    assert f"engage hostile --seed 4 --runs 1 --seconds 5 --only body --body {body}" in result.out
    assert "ZeroDivisionError: of mine" in result.out


@pytest.mark.parametrize(
    ("option", "value", "reason"),
    [
        ("--only", "kindness", "no attack 'kindness' (one of messages, requests, body)"),
        ("--body", "nowhere:Body", "body nowhere:Body: it cannot be imported: ModuleNotFoundError"),
        ("--body", f"{__name__}:Unplugged", ":Unplugged: its driver breaks as it is made: OSError: no serial port"),
        ("--body", "builtins:dict", "it makes a dict, and no body (it is to be a class that inherits"),
    ],
)
def test_what_is_no_attack_is_refused(engage: Engage, option: str, value: str, reason: str) -> None:
    result = engage("hostile", option, value)

    assert result.code == 2
    assert reason in result.err
