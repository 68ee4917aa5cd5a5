"""JSON Schemas of everything that travels, for other languages: `python -m engage_hri.schemas.export [--check]`.

One file per message of the bus, one each for a block and a turn fragment, and `lines.json` for the lines of
`engage watch`. Draft 2020-12; quantities carry their unit as `description`. And the tool by which language models
speak, as an API takes it (`schemas/tool.py`).
"""

import argparse
import inspect
import sys
from pathlib import Path
from typing import Any, get_args

import msgspec

from engage_hri.schemas import lines, tool
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import MAJOR, Message
from engage_hri.schemas.units import Stamp

EXPORTED = Path(__file__).parent / "exported"


def exported_types() -> tuple[type[msgspec.Struct], ...]:
    return (Block, TurnFragment, *get_args(Message))


def schema(kind: Any, name: str = "") -> dict[str, Any]:
    """The JSON Schema of a struct, or of a named union of some, complete in itself."""
    reference, components = msgspec.json.schema_components((kind,), ref_template="#/$defs/{name}")
    for component in components.values():
        if "description" in component:
            component["description"] = inspect.cleandoc(component["description"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:engage:{MAJOR}:{name or kind.__name__}",
        **reference[0],
        "$defs": {name: components[name] for name in sorted(components)},
    }


def _schema_of_lines() -> dict[str, Any]:
    """That of their messages, but every key is there, and an instant is a number."""
    made = schema(lines.Told, "lines")
    for definition in made["$defs"].values():
        if "properties" in definition:
            definition["required"] = list(definition["properties"])
    made["$defs"][Stamp.__name__] = lines.INSTANT
    return made


def files() -> dict[str, bytes]:
    """What the folder should hold: name to content."""
    contents = {f"{kind.__name__}.json": schema(kind) for kind in exported_types()}
    contents["lines.json"] = _schema_of_lines()
    contents[tool.FILE] = tool.tool_definition()
    return {
        name: msgspec.json.format(msgspec.json.encode(content), indent=2) + b"\n"
        for name, content in contents.items()
    }


def stale(folder: Path = EXPORTED) -> list[str]:
    """Names of files that are missing, differ from the code, or belong to nothing any more."""
    expected = files()
    present = {path.name: path.read_bytes() for path in folder.glob("*.json")}
    return sorted(name for name in expected.keys() | present.keys() if expected.get(name) != present.get(name))


def write(folder: Path = EXPORTED) -> list[str]:
    """Make the folder hold exactly `files()`. Returns the names that changed."""
    changed = stale(folder)
    expected = files()
    folder.mkdir(exist_ok=True)
    for name in changed:
        if name in expected:
            (folder / name).write_bytes(expected[name])
        else:
            (folder / name).unlink()
    return changed


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m engage_hri.schemas.export", description=inspect.getdoc(sys.modules[__name__])
    )
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is stale")
    if parser.parse_args(arguments).check:
        names = stale()
        if names:
            print(f"stale: {', '.join(names)}; run python -m engage_hri.schemas.export", file=sys.stderr)
        return 1 if names else 0
    for name in write():
        print(name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
