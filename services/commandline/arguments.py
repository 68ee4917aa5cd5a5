"""Arguments of a command, read into its class `Options`: the annotation of each field says what may be given.

    file: Annotated[Path, Argument(metavar="FILE")]
    sessions: Annotated[int, Option(metavar="N", min=1, help="In each condition.")] = 20

A field without a default must be given. A `bool` is a flag, a Literal a choice, and of a list there may be several.
"""

import argparse
import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NoReturn, TypeVar, Union, get_args, get_origin

from engage_hri.schemas.faults import Fault, InputRefused

HELP = ("-h", "--help")

Options = TypeVar("Options")


@dataclass(frozen=True, kw_only=True)
class Argument:
    """Annotation of a field that is given by its place.

    metavar: what stands for the value in the help. show_default: the default as the help tells it; True: as it is.
    """

    help: str = ""
    metavar: str = ""
    show_default: bool | str = True


class Option:
    """Annotation of a field that is given by a name: `--of-the-field`, unless there are `names`.

    min, max: of a number. hidden: not in the help. The others are those of an Argument.
    """

    def __init__(
        self, *names: str, help: str = "", metavar: str = "", show_default: bool | str = True,
        min: float | None = None, max: float | None = None, hidden: bool = False,
    ) -> None:  # fmt: skip
        self.names = names
        self.help = help
        self.metavar = metavar
        self.show_default = show_default
        self.min = min
        self.max = max
        self.hidden = hidden


class Reader(argparse.ArgumentParser):
    """Parser of one command. What it cannot read is refused as all bad input is."""

    def error(self, message: str) -> NoReturn:
        raise misused(self.prog, message)


def misused(command: str, reason: str) -> InputRefused:
    """Make the error for words that a command does not understand."""
    return InputRefused(Fault(reason=reason, where=command, advice=f"see {command} --help"))


def is_asked_for_help(words: Sequence[str]) -> bool:
    return any(word in HELP for word in words)


def reader(kind: type[Any], command: str, does: str) -> Reader:
    """Make the parser for a class `Options`. Its own fields come first, then those that it shares with others."""
    made = Reader(prog=command, description=does, add_help=False, allow_abbrev=False)
    for field in _fields(kind):
        value, *_, shown = get_args(field.type)
        _add(made, field.name, value, shown, field.default)
    made.add_argument(*HELP, action="store_true", help="Show this and exit.")
    return made


def names(kind: type[Any]) -> set[str]:
    """Return the names of all options of a class `Options`."""
    annotations = [(field.name, get_args(field.type)[-1]) for field in _fields(kind)]
    return {
        *HELP,
        *(each for name, shown in annotations if isinstance(shown, Option) for each in _names(name, shown)),
    }


def read(kind: type[Options], parser: Reader, words: Sequence[str]) -> Options:
    """Read the words that follow a command. Raises InputRefused."""
    given = vars(parser.parse_intermixed_args(words))
    del given["help"]
    return kind(**given)


def _fields(kind: type[Any]) -> list[Field[Any]]:
    by_name = {field.name: field for field in fields(kind)}
    return [by_name[name] for each in kind.__mro__ for name in inspect.get_annotations(each)]


def _names(field: str, shown: Option) -> tuple[str, ...]:
    return shown.names or (f"--{field.replace('_', '-')}",)


def _add(parser: Reader, name: str, kind: Any, shown: Option | Argument, default: Any) -> None:
    value, is_list = _value(kind)
    is_required = default is MISSING
    how: dict[str, Any] = {"default": None if is_required else default, "help": _help(shown, default)}
    if shown.metavar:
        how["metavar"] = shown.metavar
    if get_origin(value) is Literal:
        how |= {"choices": get_args(value), "metavar": shown.metavar or "|".join(get_args(value))}
    elif value is not bool:
        how["type"] = _number(value, shown) if value in (int, float) else value
    if isinstance(shown, Argument):
        if is_list:
            how["nargs"] = "+" if is_required else "*"
        elif not is_required:
            how["nargs"] = "?"
        parser.add_argument(name, **how)
        return
    if value is bool:
        how["action"] = "store_true"
    elif is_list:
        how["action"] = "append"
    if value is not bool and is_required:
        how["required"] = True
    parser.add_argument(*_names(name, shown), dest=name, **how)


def _value(kind: Any) -> tuple[Any, bool]:
    """Find the type of one value, and whether there may be several."""
    if isinstance(kind, UnionType) or get_origin(kind) is Union:
        [kind] = [each for each in get_args(kind) if each is not NoneType]
    is_list = get_origin(kind) is list
    if is_list:
        [kind] = get_args(kind)
    return (get_args(kind)[0] if get_origin(kind) is Annotated else kind), is_list


def _help(shown: Option | Argument, default: Any) -> str:
    if isinstance(shown, Option) and shown.hidden:
        return argparse.SUPPRESS
    text = shown.help
    if isinstance(shown.show_default, str):
        text += f" [default: {shown.show_default}]"
    elif shown.show_default and default not in (MISSING, None, "") and default is not False:
        text += f" [default: {default}]"
    return text.replace("%", "%%")


def _number(kind: Callable[[str], float], shown: Option | Argument) -> Callable[[str], float]:
    """Make the reader of a number that says within which bounds it must be."""
    least, most = (shown.min, shown.max) if isinstance(shown, Option) else (None, None)
    what = "a whole number" if kind is int else "a number"
    within = "" if least is None else f" from {least:g}" if most is None else f" from {least:g} to {most:g}"

    def read(text: str) -> float:
        with suppress(ValueError):
            value = kind(text)
            if (least is None or value >= least) and (most is None or value <= most):
                return value
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}{within}")

    return read
