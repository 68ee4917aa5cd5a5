"""Command `engage check-perception`: hold a source of head poses to its laws, and tell where it breaks which."""

import asyncio
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.shell.options import Configured
from engage_hri.services.commandline.shell.outputs import print_format
from engage_hri.services.commandline.shell.process import DONE

if TYPE_CHECKING:
    from engage_hri.services.perception.testing.laws import Verdict

BROKEN = 1
"""Exit code if a law is broken, or none could be judged."""
KILLED = "killed, it is told in words, and looks again"


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="FILE.mcap, a recording of what any source has told; or what eyes look with: camera, film:PATH, "
            "landmarks:FILE, a name.",
        ),
    ]
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Lines of `from, until, person, x, y, z`: when a head faced which place of the robot's frame.",
        ),
    ] = None
    seconds: Annotated[float, typer.Option(min=1.0, help="For how long eyes look, at most.")] = 20.0
    json: Annotated[bool, typer.Option("--json", help="One JSON object for each law.")] = False

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        own = () if self.is_recording else (f"eyes.source={msgspec.json.encode(self.source).decode()}",)
        return (*super().overrides, *own)

    @property
    def is_recording(self) -> bool:
        return self.source.endswith(".mcap") and ":" not in self.source


def main(options: Options) -> int:
    """Check. Exit 1 if a law is broken or none can be judged, 2 if there is no such source."""
    verdicts: list[Verdict] = []
    for each in _judged(options):
        verdicts.append(each)
        if options.json:
            print_format(msgspec.json.encode(each._asdict()).decode())
        elif each.unjudged:
            typer.echo(f"not judged  {each.law}: {each.unjudged}")
        elif each.broken:
            typer.echo(f"BROKEN      {each.law}: {each.broken}\n            mostly: {each.advice}")
        else:
            typer.echo(f"holds       {each.law}")
    broken, unjudged = (
        sum(map(bool, each)) for each in zip(*((v.broken, v.unjudged) for v in verdicts), strict=True)
    )
    if not options.json:
        typer.echo(f"{len(verdicts) - broken - unjudged} laws hold, {broken} broken, {unjudged} not judged")
    return BROKEN if broken or unjudged == len(verdicts) else DONE


def _judged(options: Options) -> "Iterator[Verdict]":
    from engage_hri.services.perception.testing import gathering
    from engage_hri.services.perception.testing.laws import Verdict, judged

    truth = gathering.truth_of(options.truth) if options.truth else ()
    if options.is_recording:
        yield from judged(gathering.recorded(Path(options.source), truth))
        return
    config = options.load().eyes
    yield from judged(asyncio.run(gathering.seen(config, options.seconds, truth)))
    with suppress(InputRefused):
        yield Verdict(KILLED, *asyncio.run(gathering.killed_and_recovered(config)))
