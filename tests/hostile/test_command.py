"""`python -m tests.rigs.hostile`, in this process."""

import asyncio

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.contract.body import BodyState
from engage_hri.services.control.torso.body import SimulatedBody
from tests.rigs.hostile.__main__ import main


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


def test_it_prints_what_was_sent_and_what_came_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--only", "body", "--runs", "1", "--seconds", "5"]) == 0

    told = capsys.readouterr().out
    assert "0 requests without outcome" in told
    assert "0 contained failures" in told


@pytest.mark.contained
def test_what_goes_wrong_is_told_with_the_command_that_does_it_again(capsys: pytest.CaptureFixture[str]) -> None:
    again = ["--seed", "4", "--runs", "1", "--seconds", "5", "--only", "body", "--body", f"{__name__}:Fainting"]

    assert main(again) == 1

    told = capsys.readouterr().out
    assert f"python -m tests.rigs.hostile {' '.join(again)}" in told
    assert "ZeroDivisionError: of mine" in told


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("nowhere:Body", "body nowhere:Body: it cannot be imported: ModuleNotFoundError"),
        (f"{__name__}:Unplugged", ":Unplugged: its driver breaks as it is made: OSError: no serial port"),
        ("builtins:dict", "it makes a dict, and no body"),
    ],
)
def test_what_is_no_body_is_refused(body: str, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        main(["--body", body])


def test_what_is_no_attack_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--only", "kindness"])

    assert "invalid choice: 'kindness'" in capsys.readouterr().err
