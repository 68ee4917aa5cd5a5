"""Text that comes as bytes: UTF-8, or refused with the line."""

from engage_hri.schemas.faults import Fault, InputRefused

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def utf8(data: bytes, source: str = "") -> str:
    """The text in a file, without its byte order mark. Raises InputRefused."""
    try:
        return data.removeprefix(BYTE_ORDER_MARK).decode()
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        reason = f"not UTF-8: byte 0x{error.object[error.start]:02x}, {error.reason}"
        raise InputRefused(Fault(reason=reason, where=source, line=line, advice="save it as UTF-8")) from error


def is_utf8(text: str) -> bool:
    """Can it be written? Half a character cannot: so comes a command line that was not UTF-8."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
