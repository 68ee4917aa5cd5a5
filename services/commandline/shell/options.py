"""Options that several commands share, each with its name, type, default and help.

A command's file has a class `Options` that inherits from these groups and adds the command's own options.
"""

import os
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from msgspec import json

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.text import is_utf8

if TYPE_CHECKING:
    from engage_hri.services.bus.config import BusConfig
    from engage_hri.services.bus.interface import Hub
    from engage_hri.services.commandline.shell.settings import RobotConfig
    from engage_hri.services.runtime.configuration import Kind

Resolution = Annotated[
    Literal["table", "object"] | None, typer.Option(help="How finely perception tells what people look at.")
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit 2 if there was any warning.")]
VirtualTime = Annotated[bool, typer.Option("--virtual-time", help="As fast as it goes, on a clock that jumps.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Port = Annotated[int, typer.Option(metavar="PORT", min=0, max=65535, help="Port of the page; 0: any that is free.")]
Kiosk = Annotated[
    bool, typer.Option("--kiosk", help="For an open day: the page begins anew for each next visitor by itself.")
]
WorldFile = Annotated[
    Path | None,
    typer.Option("--world", metavar="FILE", help="JSON of the entities; without it a table with ten pieces."),
]


def strict_refusal(warnings: int) -> InputRefused:
    """Error with which `--strict` fails."""
    return InputRefused(Fault(reason=f"{warnings} warning{'s' * (warnings > 1)}; --strict allows none"))


def simulation_settings(seed: int | None, human: str | None, resolution: str | None) -> tuple[str, ...]:
    """Translate options of the simulation to settings of the configuration."""
    chosen = {
        "control.variability.seed": seed,
        "simulation.seed": seed,
        "simulation.human": human,
        "recognition.gaze_resolution": resolution,
    }
    return tuple(f"{key}={value}" for key, value in chosen.items() if value is not None)


@dataclass(frozen=True, kw_only=True)
class Configured:
    """Options for the configuration of the services, and for the log."""

    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="FILE", help="TOML; see docs/configuration.md.", show_default=False),
    ] = None
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="One setting, stronger than the file: realizer.stall=1."),
    ] = None
    log: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Add a line for each block, fragment, connection event and peer to FILE."),
    ] = None
    log_level: Annotated[
        list[str] | None,
        typer.Option(metavar="[SOURCE=]LEVEL", help="debug, info, warning or error; of one service: realizer=debug."),
    ] = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings that follow from all options, as `key=value`; a later one is stronger."""
        return tuple(self.settings or ())

    def load(self) -> "RobotConfig":
        """Read the configuration of a robot: the file, and the stronger options. Raises InputRefused."""
        from engage_hri.services.commandline.shell.settings import RobotConfig

        return self.read(RobotConfig)

    def read(self, kind: "type[Kind]", *, defaults: Iterable[str] = ()) -> "Kind":
        """Read a configuration of this kind. Sections that a robot does without may be there. Raises InputRefused."""
        from engage_hri.services.commandline.shell.settings import ELSEWHERE
        from engage_hri.services.runtime.configuration import read

        return read(
            kind, self.config, settings=self.overrides, defaults=defaults, elsewhere=ELSEWHERE, variables=os.environ
        )


@dataclass(frozen=True, kw_only=True)
class Embodied(Configured):
    """Options for the robot's body."""

    body: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[PARTS=]BODY",
            help="The robot's body: a name, FILE.py:CLASS or package.module:CLASS; head,face=BODY takes only these "
            "parts of it. May be repeated. See docs/control.md.",
            show_default="simulated",
        ),
    ] = None
    voice: Annotated[
        str | None, typer.Option(metavar="BODY", help="The robot's voice, in place of the one of its body.")
    ] = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        given = {"body": self.body, "voice": self.voice}
        own = [f"control.{key}={json.encode(value).decode()}" for key, value in given.items() if value]
        return (*super().overrides, *own)


@dataclass(frozen=True, kw_only=True)
class Hearing(Configured):
    """Options for the robot's ears, and eyes where they run."""

    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="SOURCE",
            help="What hearing hears: page, the microphones of the pages of windows; a program that records "
            "(arecord); a WAV file. What eyes see: camera; film:PATH; landmarks:RECORDING. What pieces are seen "
            "in: camera; film:PATH.",
            show_default=False,
        ),
    ] = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        own = (f"{self.sense}.source={json.encode(self.source).decode()}",) if self.source else ()
        return (*super().overrides, *own)

    @property
    def sense(self) -> str:
        """Section of the service for which the source is."""
        return "hearing"


@dataclass(frozen=True, kw_only=True)
class Connected(Configured):
    """Options for the robot and the bus. Without endpoints the bus is that of this machine."""

    mode: Annotated[
        Literal["auto", "peer", "client"] | None,
        typer.Option(help="client of a router, or peer; auto: client if an endpoint is on another machine.",
                     show_default="auto"),
    ] = None  # fmt: skip

    robot: Annotated[
        str | None, typer.Option(metavar="NAME", help="The robot's namespace on the bus.", show_default="robot")
    ] = None
    connect: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint to connect to; may be repeated.")
    ] = None

    keys: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Keys made by `engage keys`.", show_default=False)
    ] = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        keys = None if self.keys is None else str(self.keys)
        given = {"robot": self.robot, "mode": self.mode, "connect": self.connect, "keys": keys}
        for option, value in given.items():
            if value and not all(map(is_utf8, [value] if isinstance(value, str) else value)):
                raise InputRefused(Fault(reason=f"{option} {value!r} is not UTF-8"))
        own = [f"bus.{key}={json.encode(value).decode()}" for key, value in given.items() if value is not None]
        return (*super().overrides, *own)

    async def open(
        self,
        bus: "BusConfig",
        holder: str,
        listen: Sequence[str] = (),
        beside: "Hub | None" = None,
        patience: float = inf,
    ) -> "Hub":
        """Open the Zenoh hub. Raises EngageError if an endpoint is bad or taken.

        holder: whose keys to take, where the folder of keys is that of several. beside: another hub of this process.
        patience: seconds in which somebody has to be reached, for a command that asks once.
        """
        from engage_hri.services.bus.keyring import read_keys
        from engage_hri.services.bus.zenoh.hub import open_hub

        keys = read_keys(bus.keys, holder) if bus.keys else None
        return await open_hub(
            bus.robot, connect=bus.connect, listen=listen, mode=bus.mode, keys=keys, beside=beside, patience=patience
        )

    @asynccontextmanager
    async def hubs(self, bus: "BusConfig", names: Iterable[str], beside: "Hub") -> AsyncIterator[dict[str, "Hub"]]:
        """Hubs of services of this process: `beside`, which is one of it; with keys each has its own."""
        async with AsyncExitStack() as stack:
            opened = {}
            for name in names:
                opened[name] = beside
                if bus.keys:
                    opened[name] = await stack.enter_async_context(await self.open(bus, name, beside=beside))
            yield opened


@dataclass(frozen=True, kw_only=True)
class Listening(Connected):
    """Options for a process to which others may connect."""

    listen: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint to listen on; may be repeated.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class Shown:
    """Options for a window: where it may be looked at from."""

    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Where to listen; others than this machine see it all.")
    ] = "127.0.0.1"
    called: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A further name in the address of the page, as that of a proxy; may be given again."
        ),
    ] = None
    https: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Speak TLS, with the certificate and the key in this file, which is made if there is none, or in "
            "the folder of a router's keys: browsers give a microphone to https, and to this machine, only.",
            show_default=False,
        ),
    ] = None
    port: Port = 0
    token_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File with the token of the address, made if there is none: then the address stays the same when "
            "the window is started again, and its pages take part as before.",
            show_default=False,
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class Simulated(Configured):
    """Options for the simulation."""

    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Of all chance in the simulation.")] = None
    human: Annotated[
        Literal["appendix-b", "misplacing", "listening", "stochastic", "attentive"] | None,
        typer.Option(help="How the simulated human behaves: docs/commands.md tells of each.", show_default=False),
    ] = None
    resolution: Resolution = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options; `--set` is stronger than the options of the simulation."""
        return (*simulation_settings(self.seed, self.human, self.resolution), *super().overrides)


@dataclass(frozen=True, kw_only=True)
class Written:
    """Options for the files that are written, and for printing."""

    events: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write connection events as JSON lines; - for standard output."),
    ] = None
    feedback: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the blocks' feedback as JSON lines; - for standard output."),
    ] = None
    quiet: Quiet = False
