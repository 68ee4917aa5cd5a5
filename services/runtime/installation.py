"""Commands that install what a part of this package needs, as they work where this process runs.

`pip install 'engage-hri[console]'` is right for a package that comes from an index. In a checkout that is not the
package that runs, and who installed a wheel finds none by this name. So a checkout is installed once more with the
extra, and of an installed package the requirements of the extra are named, which are on every index. The python is
the one that runs: another `pip` on PATH would install for another one.
"""

import re
import shlex
import sys
from pathlib import Path

PACKAGE = "engage-hri"
_OF_AN_EXTRA = re.compile(r"""(?P<needed>[^;]+?)\s*;.*\bextra\s*==\s*["'](?P<extra>[\w-]+)["'].*""")


def extra_command(name: str) -> str:
    """Return the command that installs an extra of this package. name: as in pyproject.toml."""
    checkout = Path(__file__).resolve().parents[2]  # the links of docs/decisions/0011 are followed
    if (checkout / "pyproject.toml").is_file():
        return _pip("-e", f"{_from_here(checkout)}[{name}]")
    return packages_command(*(_needed_by(name) or [f"{PACKAGE}[{name}]"]))


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
