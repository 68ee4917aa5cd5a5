"""Command `engage router`: passes on what the processes of several machines send one another."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from select import PIPE_BUF, select
from typing import Annotated

import typer

from engage_hri.schemas.access import ROUTER
from engage_hri.services.bus.keyring import Keys, read_keys
from engage_hri.services.commandline.patient import LOG, Patient, beneath, complain
from engage_hri.services.commandline.process import DONE, forever, run_until_signal
from engage_hri.services.runtime.configuration import bus_config

ZENOH_THREADS = "(rx: (worker_threads: 32))"
"""Threads of Zenoh that receive; it has two. One is busy for up to 10 s with closing the link of a machine that was
cut off, and while all are, the router hears nobody, of no robot."""


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
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Keys made by `engage keys`: strangers are refused, and all have a role.",
            show_default="open to all",
        ),
    ] = None  # fmt: skip


def main(options: Options) -> int:
    """Route until a signal."""
    os.environ.setdefault("ZENOH_RUNTIME", ZENOH_THREADS)  # read when the first session opens
    folder = bus_config(keys=str(options.keys or "")).keys
    run_until_signal(_route(options, read_keys(folder, ROUTER) if folder else None))
    return DONE


def _without_waiting(data: bytes) -> int | None:
    """Write to standard output if its reader takes it: one who stops reading must not stop the router."""
    # That of Python at this moment: with keys Zenoh's log goes where it went at first.
    output = beneath(sys.stdout)
    return output.write(data[:PIPE_BUF]) if select([], [output.fileno()], [], 0)[1] else None


async def _route(options: Options, keys: Keys | None) -> None:
    from engage_hri.services.bus.zenoh.router import routing

    told = Patient("standard output", _without_waiting, LOG.warning)

    def tell(line: str) -> None:
        told.write(f"{line}\n")

    async with routing(options.listen, options.connect or (), tell, keys):
        complain(f"router is ready at {', '.join(options.listen)}")
        await forever()
