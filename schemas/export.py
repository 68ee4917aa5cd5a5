"""JSON Schemas of everything that travels, for other languages: `python -m engage_hri.schemas.export`.

`exported/engage.json` is one bundle, draft 2020-12, with a definition for each struct under `$defs`: all messages of
the bus, blocks and turn fragments, and the lines of `engage watch` (`Line`). The bundle as a whole describes any
message. A definition is named by `engage.json#/$defs/PerformFragment`, or in a validator that has loaded the bundle
by `urn:engage:1#PerformFragment`. Each definition has an `$anchor`, but no `$id`: in a definition with its own `$id`,
`#/$defs/...` would mean another place. Quantities have their unit as `description`.

Beside the bundle stands the tool by which language models speak, as an API takes it (`schemas/tool.py`).
"""

import inspect
from pathlib import Path
from typing import Any

import msgspec

from engage_hri.schemas import messages, tool
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import MAJOR, Message
from engage_hri.schemas.units import Stamp

EXPORTED = Path(__file__).parent / "exported"
BUNDLE = "engage.json"
"""Name of the file in the folder of exported schemas."""
ID = f"urn:engage:{MAJOR}"


def bundle() -> dict[str, Any]:
    """The JSON Schema of any message, with a definition for every struct that people or programs write or read."""
    roots = (Message, Block, TurnFragment)
    (message, *_), components = msgspec.json.schema_components(roots, ref_template="#/$defs/{name}")
    components |= _lines()
    for name, component in components.items():
        component["$anchor"] = name
        if "description" in component:
            component["description"] = inspect.cleandoc(component["description"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": ID,
        "title": f"Engage, protocol {MAJOR}: any message of the bus",
        **message,
        "$defs": {name: components[name] for name in sorted(components)},
    }


def _lines() -> dict[str, Any]:
    """Definitions of `Line`: like the messages, but every key is required, and an instant is a number."""
    (line,), components = msgspec.json.schema_components((messages.LineMessage,), ref_template="#/$defs/{name}Line")
    for component in components.values():
        if "properties" in component:
            component["required"] = list(component["properties"])
    components[Stamp.__name__] = dict(messages.INSTANT)
    made = {f"{name}Line": component for name, component in components.items()}
    return made | {"Line": {"description": "One line of `engage watch --json`.", **line}}


def files() -> dict[str, bytes]:
    """Contents that the folder should have, by file name."""
    return {
        BUNDLE: _written(bundle(), 4).encode() + b"\n",
        tool.FILE: _written(tool.tool_definition(), 9).encode() + b"\n",
    }


def _written(node: Any, depth: int, indent: str = "\n") -> str:
    """JSON with a line for each member down to `depth`, so that each field is one line of the bundle."""
    if depth == 0 or not isinstance(node, dict):
        return msgspec.json.encode(node).decode()
    inner = f"{indent}  "
    members = (f'{inner}"{name}": {_written(each, depth - 1, inner)}' for name, each in node.items())
    return f"{{{','.join(members)}{indent}}}"


def stale(folder: Path = EXPORTED) -> list[str]:
    """Names of the files that are missing, differ from the code, or are left over."""
    expected = files()
    present = {path.name: path.read_bytes() for path in folder.glob("*.json")}
    return sorted(name for name in expected.keys() | present.keys() if expected.get(name) != present.get(name))


def write(folder: Path = EXPORTED) -> list[str]:
    """Make the folder hold exactly `files()`. Returns the names of the changed files."""
    changed, expected = stale(folder), files()
    for name in changed:
        if name in expected:
            (folder / name).write_bytes(expected[name])
        else:
            (folder / name).unlink()
    return changed


if __name__ == "__main__":
    for name in write():
        print(name)
