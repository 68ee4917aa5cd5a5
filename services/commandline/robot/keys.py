"""Command `engage keys`: certificates of all that take part, for how long, and the rules of who may do what."""

import json
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.services.bus.config import BusConfig
from engage_hri.services.commandline.shell.outputs import print_format
from engage_hri.services.commandline.shell.process import DONE, FAILED
from engage_hri.services.runtime.installation import extra_command


@dataclass(frozen=True, kw_only=True)
class Options:
    do: Annotated[
        Literal["init", "add", "renew", "revoke", "show", "acl"],
        typer.Argument(metavar="init|add|renew|revoke|show|acl", show_default=False),
    ]
    folder: Annotated[Path, typer.Argument(help="Folder of the keys.", show_default=False)]
    holders: Annotated[
        list[str] | None,
        typer.Argument(metavar="[HOLDER]...", help="init, add: ROLE=NAME; renew, revoke: NAME.", show_default=False),
    ] = None
    robot: Annotated[str, typer.Option(metavar="NAME", help="init: the robot's namespace on the bus.")] = "robot"
    host: Annotated[
        list[str] | None,
        typer.Option(metavar="HOST", help="init: name or address of the router; may be repeated.",
                     show_default="this machine only"),
    ] = None  # fmt: skip
    days: Annotated[int, typer.Option(min=1, max=3650, help="Days for which certificates are valid.")] = 365


def main(options: Options) -> int:
    """Make or show keys. Exit 3 if `show` finds a certificate that has expired, and was not revoked."""
    if find_spec("cryptography") is None:
        advice = f"{extra_command('keys')}; only the machine where keys are made needs it"
        raise InputRefused(Fault(reason="the package `cryptography` is missing", where="engage keys", advice=advice))
    try:
        return _done(options)
    except OSError as error:
        where, reason = str(error.filename or options.folder), error.strerror or str(error)
        advice = "FOLDER has to be a folder that can be read and written"
        raise InputRefused(Fault(reason=reason, where=where, advice=advice)) from error


def _done(options: Options) -> int:
    from engage_hri.services.bus import certificates

    folder, named = options.folder, options.holders or []
    if folder.exists() and not folder.is_dir():
        raise InputRefused(
            Fault(reason="this is no folder", where=str(folder), advice="keys are in a folder: name that")
        )
    match options.do:
        case "init":
            _check_robot(options.robot)
            certificates.initialize(folder, options.robot, _pairs(named), options.host or (), options.days)
            _tell(f"keys are in {folder}; whoever reads {folder / certificates.SECRET} can make more")
        case "add":
            certificates.add(folder, _pairs(_some(named)), options.days)
            _tell("done; give the routers their folder anew, and start them again")
        case "renew":
            certificates.renew(folder, named, options.days)
            _tell("done; give each its folder anew, and start it again")
        case "revoke":
            certificates.revoke(folder, _some(named))
            _tell("done; give the routers their folder anew, and start them again")
        case "show":
            return _show(folder)
        case "acl":
            from engage_hri.services.bus.zenoh.rules import access_control

            print_format(json.dumps({"access_control": access_control(certificates.let_in(folder))}, indent=1))
    return DONE


def _show(folder: Path) -> int:
    from engage_hri.services.bus.certificates import shown

    now, code = datetime.now(UTC), DONE
    for each in shown(folder):
        is_over = each.until <= now
        if is_over and not each.is_revoked:
            code = FAILED
        state = f"{'EXPIRED' if is_over else f'{(each.until - now).days} days'}{', REVOKED' * each.is_revoked}"
        print(f"{each.name:<16} {each.common_name:<40} {each.until:%Y-%m-%d %H:%M}Z  {state}")
    return code


def _pairs(given: list[str]) -> list[tuple[str, str]]:
    """Read `ROLE=NAME`. Raises InputRefused."""
    for text in given:
        if "=" not in text:
            raise InputRefused(Fault(reason=f"{text!r} is no holder", advice="ROLE=NAME: manager=alice"))
    return [(role, name) for role, _, name in (text.partition("=") for text in given)]


def _some(given: list[str]) -> list[str]:
    if not given:
        raise InputRefused(Fault(reason="nobody is named", where="engage keys"))
    return given


def _check_robot(robot: str) -> None:
    with raised_as(InputRefused, ValueError, "--robot"):
        BusConfig(robot=robot)


def _tell(text: str) -> None:
    print(text, file=sys.stderr)
