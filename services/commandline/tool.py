"""Command `engage tool`: print the tool by which a language model speaks through the robot."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from engage_hri.schemas.tool import Format, tool_definition
from engage_hri.services.commandline.process import DONE
from engage_hri.services.commandline.sources import read_world


@dataclass(frozen=True, kw_only=True)
class Options:
    format: Annotated[Format, typer.Option(help="Of the Messages, Responses, or Chat Completions API.")] = "anthropic"
    world: Annotated[
        Path | None, typer.Option(metavar="FILE", help="JSON of the entities: only their ids are allowed.")
    ] = None


def main(options: Options) -> int:
    made = tool_definition(options.format, None if options.world is None else read_world(options.world))
    print(msgspec.json.format(msgspec.json.encode(made), indent=2).decode())
    return DONE
