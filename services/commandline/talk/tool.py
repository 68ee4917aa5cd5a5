"""Command `engage tool`: print the tool by which a language model speaks through the robot."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from engage_hri.schemas.tool import MOST_IDS, MOST_LETTERS, Format, is_listed, tool_definition
from engage_hri.services.commandline.shell.outputs import complain, print_format
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.sources import read_world


@dataclass(frozen=True, kw_only=True)
class Options:
    format: Annotated[Format, typer.Option(help="Of the Messages, Responses, or Chat Completions API.")] = "anthropic"
    world: Annotated[
        Path | None, typer.Option(metavar="FILE", help="JSON of the entities: only their ids are allowed.")
    ] = None


def main(options: Options) -> int:
    world = None if options.world is None else read_world(options.world)
    made = tool_definition(options.format, world)
    if world is not None and not is_listed(world):
        complain(
            f"tool: ids are any text: the APIs take no list of more than {MOST_IDS} ids, or {MOST_LETTERS} letters."
            " What is no id is refused when performed"
        )
    print_format(msgspec.json.format(msgspec.json.encode(made), indent=2).decode())
    return DONE
