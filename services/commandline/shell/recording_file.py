"""Recordings that commands are given: the extra that they need, and what to say of one that is not whole."""

from pathlib import Path
from typing import TYPE_CHECKING

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.failing_output import complain
from engage_hri.services.runtime.installation import extra_command

if TYPE_CHECKING:
    from engage_hri.services.recording.reading import Recording


def needed() -> None:
    """Check that recordings can be read and written. Raises InputRefused."""
    try:
        import mcap.records  # noqa: F401
        import zstandard  # noqa: F401
    except ImportError as error:
        fault = Fault(reason=f"recordings need mcap: {error}", advice=extra_command("record"))
        raise InputRefused(fault) from error


def opened(path: Path) -> "Recording":
    """Open a recording, and say on standard error what it lacks. Raises InputRefused."""
    needed()
    from engage_hri.services.recording.disk import read

    recording = read(path)
    if recording.has_all_data and not recording.is_whole:
        whole = f"its data is there, {len(recording)} messages"
        complain(f"{path}: the index at its end is damaged, or more stands behind it; {whole}")
    if not recording.has_all_data:
        behind = f", {recording.lost_bytes} bytes behind them are not" if recording.lost_bytes else ""
        complain(
            f"{path}: its end is missing or damaged; {len(recording)} messages until {recording.duration:.2f} s"
            f" are whole{behind}"
        )
    if recording.repaired:
        complain(f"{path}: it is a copy of a recording that lacked something: {recording.repaired}")
    for place in recording.damaged:
        complain(f"{path}: damaged at byte {place.offset}: {place.reason}")
    if recording.losses.total:
        complain(f"{path}: {recording.losses.total} messages are missing, as its recorder says")
    return recording
