"""Command `engage router`: passes on what the processes of several machines send one another."""

import sys
from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.services.commandline.process import DONE, forever, run_until_signal


@dataclass(frozen=True, kw_only=True)
class Options:
    listen: Annotated[
        list[str],
        typer.Option(
            metavar="ENDPOINT", help="Where others connect: tcp/0.0.0.0:7447; may be repeated.", show_default=False
        ),
    ]
    connect: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", help="Another router; may be repeated.")
    ] = None


def main(options: Options) -> int:
    """Route until a signal."""
    run_until_signal(_route(options))
    return DONE


async def _route(options: Options) -> None:
    from engage_hri.services.bus.zenoh.router import routing

    def tell(line: str) -> None:
        print(line, flush=True)

    async with routing(options.listen, options.connect or (), tell):
        print(f"router is ready at {', '.join(options.listen)}", file=sys.stderr, flush=True)
        await forever()
