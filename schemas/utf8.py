"""Decoding of UTF-8; other bytes are refused with their line. Text for people's eyes."""

from engage_hri.schemas.faults import Fault, InputRefused

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def utf8(data: bytes, source: str = "") -> str:
    """Decode the bytes of a file, without their byte order mark. Raises InputRefused with the line."""
    try:
        return data.removeprefix(BYTE_ORDER_MARK).decode()
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        reason = f"not UTF-8: byte 0x{error.object[error.start]:02x}, {error.reason}"
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
