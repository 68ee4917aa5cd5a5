"""How a refusal reads on standard error: one line, `file:line: reason (advice)`."""

from pathlib import Path

from engage_hri.schemas.faults import Fault


def readable(fault: Fault, source: Path | str = "") -> str:
    """`turn.xml:14: block-1: gaze-9: reason (advice)`. source: the file it is about, if known."""
    file, rest = _split(fault.where, str(source))
    place = f"{file}:{fault.line}" if fault.line else file
    text = ": ".join(part for part in (place, rest, fault.reason) if part)
    text = f"{text} ({fault.advice})" if fault.advice else text
    return " ".join(text.split()).encode(errors="backslashreplace").decode()  # a file name need not be UTF-8


def _split(where: str, source: str) -> tuple[str, str]:
    """The file and what stands behind it. The line number goes between the two."""
    if source:
        return source, where.removeprefix(source).removeprefix(": ")
    file, _, rest = where.partition(": ")
    return file, rest
