"""Drivers and services that installed packages offer, ours among them, by entry points of these groups.

    [project.entry-points."engage.bodies"]
    my-robot = "my_package.driver:MyRobot"

    [project.entry-points."engage.voices"]
    my-voice = "my_package.voice:MyVoice [sound]"      # it needs the extra `sound` of its package

    [project.entry-points."engage.services"]           # what stands in for people and the task beside a robot
    simulation = "my_package.people:simulate"

Python can list the entry points of all packages in one call, but one package whose list cannot be read breaks that
call for all others. So each package is asked by itself, and what is wrong with one is told to those who name it.
"""

import sys
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from engage_hri.services.runtime.installation import PACKAGE, extra_command, packages_command

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

GROUPS = BODIES, VOICES, SERVICES = "engage.bodies", "engage.voices", "engage.services"


class Offer(Struct, frozen=True):
    """A driver or service that a package offers.

    value: `package.module:Class`. extras: of the package, without which it cannot be imported.
    """

    name: str
    group: str
    package: str
    version: str
    value: str
    extras: tuple[str, ...] = ()

    @property
    def is_ours(self) -> bool:
        """True of what this package offers."""
        return self.package == PACKAGE

    def load(self) -> Any:
        """Import what is offered. Raises what its import raises."""
        where, _, name = self.value.partition(":")
        found: Any = import_module(where)
        for step in filter(None, name.split(".")):
            found = getattr(found, step)
        return found

    def advice(self, error: BaseException) -> str:
        """Say how to install what the import lacks; empty: it fails for another reason."""
        if not self.extras or not isinstance(error, ModuleNotFoundError):
            return ""
        if self.is_ours:
            return extra_command(self.extras[0])
        return packages_command(f"{self.package}[{','.join(self.extras)}]")


def offers(group: str) -> Sequence[Offer]:
    """List what installed packages offer in a group; two packages may offer one name."""
    return [each for each in _found(tuple(sys.path))[0] if each.group == group]


def unreadable() -> Sequence[str]:
    """Names of the packages that offer something, with entry points that cannot be read."""
    return _found(tuple(sys.path))[1]


@cache
def _found(path: tuple[str, ...]) -> tuple[Sequence[Offer], Sequence[str]]:
    """Look through all packages. path: where Python looks for them; a package that comes first hides a later one."""
    from importlib.metadata import distributions  # loads the parser of e-mail: 10 ms that not everybody needs

    found: dict[str, list[Offer]] = {}
    bad: list[str] = []
    for package in distributions(path=list(path)):
        written = package.read_text("entry_points.txt") or ""
        if not any(f"[{group}]" in written for group in GROUPS):
            continue
        name = _name(package)
        if name in found or name in bad:
            continue
        try:
            points = [each for each in package.entry_points if each.group in GROUPS]
            found[name] = [_offer(name, package.version, each) for each in points]
        except Exception:  # whatever a stranger's package has there
            bad.append(name)
    return [offer for each in found.values() for offer in each], bad


def _offer(package: str, version: str, point: "EntryPoint") -> Offer:
    value, _, extras = point.value.partition("[")  # `point.extras` takes a name with a hyphen for two
    needed = tuple(filter(None, (each.strip() for each in extras.rstrip("] ").split(","))))
    return Offer(point.name, point.group, package, version, value.strip(), needed)


def _name(package: "Distribution") -> str:
    """Name of a package; of one whose metadata cannot be read, the name of its folder."""
    try:
        return str(package.metadata["Name"])
    except Exception:
        return str(getattr(package, "_path", package))
