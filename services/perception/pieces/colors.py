"""Knowledge of a task before a picture is seen: its table, which its file tells, and the colors of its pieces."""

from pathlib import Path

import msgspec

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.tables import TaskTable
from engage_hri.services.runtime.installation import TABLES, offers

Palette = dict[str, tuple[float, float, float]]
"""Red, green and blue of each color, and of the table, under the same light."""
TABLE = "table"


def task_table(task: str) -> TaskTable:
    """Read the table of a task. task: as in the settings. Raises InputRefused."""
    known = {offer.name: offer for offer in offers(TABLES)}
    if task in known:
        table: TaskTable = known[task].load()()
        return table
    advice = suggestion(task, [*known]) or f"a file, or one of {', '.join(sorted(known))}"
    with raised_as(InputRefused, OSError, f"pieces.task: {task}", advice=advice):
        text = Path(task).read_bytes()
    with raised_as(InputRefused, msgspec.DecodeError, task, advice="docs/pieces.md shows such a file"):
        return msgspec.toml.decode(text, type=TaskTable)


def read_palette(path: str, table: TaskTable) -> Palette:
    """Read the colors of the pieces of a table. Raises InputRefused: there is no such file, or it lacks one."""
    advice = "lay out the pieces as the task begins, and: engage calibrate colors"
    with raised_as(InputRefused, OSError, f"pieces.colors: {path}", advice=advice):
        text = Path(path).read_bytes()
    with raised_as(InputRefused, msgspec.DecodeError, path, advice=advice):
        palette: Palette = msgspec.toml.decode(text, type=Palette)
    needed = {TABLE, *(form.color for form in table.pieces)}
    if missing := sorted(needed - palette.keys()):
        raise InputRefused(Fault(reason=f"it has no color {', '.join(missing)}", where=path, advice=advice))
    return {name: palette[name] for name in sorted(needed)}


def written_palette(palette: Palette) -> str:
    """Write colors as a file."""
    rows = (
        f"{msgspec.json.encode(name).decode()} = [{', '.join(f'{v:.0f}' for v in palette[name])}]" for name in palette
    )
    return "\n".join(["# red, green and blue, 0..255, under one light: engage calibrate colors", *rows, ""])
