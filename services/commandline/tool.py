"""`engage tool`: the definition of the tool by which a language model speaks through the robot."""

from pathlib import Path

import msgspec

from engage_hri.schemas.tool import Format, tool_definition
from engage_hri.services.commandline.process import DONE
from engage_hri.services.commandline.sources import read_world


def main(format: Format, world: Path | None) -> int:
    """world: its objects and people are the only ids that the schema allows."""
    made = tool_definition(format, None if world is None else read_world(world))
    print(msgspec.json.format(msgspec.json.encode(made), indent=2).decode())
    return DONE
