"""How the words of a command line become the options of a command."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.app import COMMANDS, command
from engage_hri.services.commandline.arguments import Argument, Option, names, read, reader
from tests.cli.command import Engage


@dataclass(frozen=True, kw_only=True)
class Shared:
    level: Annotated[list[str] | None, Option("--log-level", metavar="LEVEL", show_default="info")] = None
    quiet: Annotated[bool, Option("--quiet", "-q", help="100 % silent.")] = False


@dataclass(frozen=True, kw_only=True)
class Options(Shared):
    files: Annotated[list[Path], Argument(metavar="FILE")]
    out_there: Annotated[Path, Option()]
    count: Annotated[int, Option(min=1, max=9)] = 3
    spread: Annotated[Seconds | None, Option(min=0)] = None
    human: Annotated[Literal["kind", "rude"], Option(help="Manners.")] = "kind"
    fast: Annotated[bool, Option("--fast", "-f")] = False
    secret: Annotated[bool, Option("--secret", hidden=True)] = False


def given(*words: str) -> Options:
    return read(Options, reader(Options, "engage try", "Try."), words)


def test_what_is_not_given_has_its_default():
    assert given("a.xml", "--out-there", "b") == Options(files=[Path("a.xml")], out_there=Path("b"))


def test_options_may_stand_anywhere_and_be_written_in_all_ways():
    words = ("a", "--out-there=x", "-qf", "b", "--count", "9", "c", "--spread=0.5", "--human", "rude", "--secret")

    assert given(*words) == Options(
        files=[Path("a"), Path("b"), Path("c")], out_there=Path("x"), quiet=True, fast=True, count=9, spread=0.5,
        human="rude", secret=True,
    )  # fmt: skip


def test_a_list_is_what_was_given_in_that_order():
    assert given("a", "--out-there", "-", "--log-level", "debug", "--log-level", "x=info").level == [
        "debug",
        "x=info",
    ]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["a"], "the following arguments are required: --out-there"),
        (["--out-there", "b"], "required: FILE"),
        (["a", "--out-there"], "--out-there: expected one argument"),
        (["a", "--out-there", "b", "--quie"], "unrecognized arguments: --quie"),
        (["a", "--out-there", "b", "--count", "0"], "--count: '0' is not a whole number from 1 to 9"),
        (["a", "--out-there", "b", "--count", "10"], "--count: '10' is not a whole number from 1 to 9"),
        (["a", "--out-there", "b", "--count", "2.5"], "--count: '2.5' is not a whole number from 1 to 9"),
        (["a", "--out-there", "b", "--spread", "nan"], "--spread: 'nan' is not a number from 0"),
        (["a", "--out-there", "b", "--spread=-1"], "--spread: '-1' is not a number from 0"),
        (["a", "--out-there", "b", "--human", "x"], "--human: invalid choice: 'x' (choose from"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_option_and_the_reason(words: list[str], reason: str):
    with pytest.raises(InputRefused) as refused:
        given(*words)

    fault = refused.value.fault
    assert reason in fault.reason
    assert (fault.where, fault.advice) == ("engage try", "see engage try --help")


def test_the_help_tells_each_option_but_the_hidden_ones_its_own_first():
    text = " ".join(reader(Options, "engage try", "Try.").format_help().split())

    assert "usage: engage try --out-there OUT_THERE [--count COUNT]" in text
    assert "--human kind|rude Manners. [default: kind]" in text
    assert "--log-level LEVEL [default: info]" in text
    assert "--quiet, -q 100 % silent." in text
    assert "secret" not in text
    assert text.index("--fast") < text.index("--log-level")


def test_the_names_are_those_that_can_be_typed():
    assert names(Options) == {
        "--out-there", "--count", "--spread", "--human", "--fast", "-f", "--secret", "--log-level", "--quiet", "-q",
        "--help", "-h",
    }  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_a_help_that_names_its_options(engage: Engage, name: str):
    result = engage(name, "--help")

    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"usage: engage {name}")
    hidden = {"--attended"}
    assert all(option in result.out for option in names(command(name).Options) - hidden)


def test_the_list_of_all_commands_is_the_help_and_what_comes_without_any(engage: Engage):
    asked, nothing = engage("--help"), engage()

    assert (asked.code, nothing.code, asked.err, nothing.err) == (0, 2, "", "")
    assert asked.out == nothing.out
    for name, does in COMMANDS.items():
        assert (f"\n  {name} " in asked.out) is bool(does)


def test_an_option_that_no_command_takes_is_refused(engage: Engage):
    result = engage("--fast", "demo")

    assert (result.code, result.out) == (2, "")
    assert result.err == "engage: there is no option '--fast' (see engage --help)\n"
