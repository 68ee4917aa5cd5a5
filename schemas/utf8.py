"""Decoding of text files; bytes that are no text are refused with their line. Text for people's eyes."""

import codecs

from engage_hri.schemas.faults import Fault, InputRefused

_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
"""Byte order marks with their encodings; that of UTF-32 begins with that of UTF-16."""


def begins_with(data: bytes) -> str:
    """Return the first visible ASCII character of a text in UTF-8, UTF-16 or UTF-32; empty if there is none."""
    mark = next((mark for mark in _MARKS if data.startswith(mark)), b"")
    start = data[:256].removeprefix(mark).replace(b"\0", b"").lstrip()
    return start[:1].decode("ascii", errors="replace")


def utf8(data: bytes, source: str = "") -> str:
    """Decode the bytes of a file: UTF-8, or UTF-16 or UTF-32 with a byte order mark, as some shells write it.

    Raises InputRefused with the line.
    """
    encoding = next((encoding for mark, encoding in _MARKS.items() if data.startswith(mark)), "utf-8")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].decode(encoding, errors="ignore").count("\n") + 1
        found = f"byte 0x{data[error.start]:02x}, {error.reason}"
        reason = f"not {encoding.upper().removesuffix('-SIG')}: {found}"
        raise InputRefused(Fault(reason=reason, where=source, line=line, advice="save it as UTF-8")) from error


def is_utf8(text: str) -> bool:
    """Tell whether a text can be encoded. Half a character cannot: a command line that is not UTF-8 has such."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def printable(text: str) -> str:
    """Return the text on one line, without what a terminal would obey: that is written as Python escapes it."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
