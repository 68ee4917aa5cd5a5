"""Checks of a client's input before it is sent: a fragment in any form, a request as its server will read it."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import read, read_call
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import decode, published
from engage_hri.schemas.requests import Request
from engage_hri.schemas.tool import EXAMPLE

FragmentSource = TurnFragment | str | bytes | Path | dict[str, Any]
"""A fragment, or EBML or JSON that describes one (a language model's tool input, too), or the file it stands in."""
BlockSource = Block | str | bytes | Path | dict[str, Any]
"""A block, or BML or JSON that describes one, or the file it stands in."""


def fragment_in(source: FragmentSource, unnamed: str) -> TurnFragment:
    """Read a fragment. unnamed: the id for one without an id. Raises InputRefused with file, line or JSON path."""
    if isinstance(source, TurnFragment):
        return source
    things, place = _things(source, unnamed)
    match things:
        case (TurnFragment() as fragment,):
            return fragment
        case (Block(),):
            raise InputRefused(Fault(reason="a BML block, not a turn fragment", where=place, advice="use `realize`"))
    raise InputRefused(Fault(reason=f"{len(things)} things, not one turn fragment", where=place))


def block_in(source: BlockSource, unnamed: str) -> Block:
    """Read a block. unnamed: the id for one without an id. Raises InputRefused with file, line or JSON path."""
    if isinstance(source, Block):
        return source
    things, place = _things(source, unnamed)
    match things:
        case (Block() as block,):
            return block
        case (TurnFragment(),):
            raise InputRefused(Fault(reason="a turn fragment, not a BML block", where=place, advice="use `perform`"))
    raise InputRefused(Fault(reason=f"{len(things)} things, not one block", where=place))


def _things(source: str | bytes | Path | dict[str, Any], unnamed: str) -> tuple[Sequence[TurnFragment | Block], str]:
    """Everything that input describes, and the file that it is from."""
    match source:
        case Path():
            try:
                data, place = source.read_bytes(), str(source)
            except OSError as error:
                raise InputRefused(Fault(reason=error.strerror or str(error), where=str(source))) from error
        case str():
            data, place = _encoded(source.encode), ""
        case bytes():
            data, place = source, ""
        case dict():
            data, place = _encoded(lambda: msgspec.json.encode(source)), ""
        case _:
            reason = f"{type(source).__name__!r} is nothing that can be read"
            raise InputRefused(
                Fault(reason=reason, advice="a fragment or block, its text, a Path, or JSON as a dict")
            )
    if isinstance(source, str) and not source.lstrip("\ufeff \t\r\n").startswith(("<", "{", "[")):
        is_path = source.endswith((".xml", ".json", ".bml", ".ebml"))
        advice = f"the content of a file is read from Path({source!r})" if is_path else f"words are said by {EXAMPLE}"
        raise InputRefused(Fault(reason="neither XML nor JSON", where=source[:80], advice=advice))
    return read(data, place, unnamed), place


def call_in(call: Any, unnamed: str) -> TurnFragment:
    """Read a language model's tool call, decoded or not. Raises InputRefused with the JSON path."""
    data = call if isinstance(call, str | bytes) else _encoded(lambda: msgspec.json.encode(call))
    return read_call(data, unnamed)


R = TypeVar("R", bound=Request)
V = TypeVar("V")


def checked(key: str, request: R) -> R:
    """Check that the server can read the request: a struct takes values of any type. Raises InputRefused.

    key: where it is sent.
    """
    unsendable = (UnicodeEncodeError, OverflowError, TypeError, ValueError, RecursionError, msgspec.MsgspecError)
    with raised_as(InputRefused, unsendable, request.id):
        decode(*published(key, request))  # type: ignore[arg-type]
    return request


def taken(value: Any, kind: Any, where: str) -> Any:
    """Return a value as readers of messages take it: of this type, and within its bounds. Raises InputRefused."""
    try:
        if isinstance(value, bytes | bytearray | memoryview):  # JSON would make text of them
            raise TypeError("these are bytes")
        return msgspec.json.decode(msgspec.json.encode(value), type=kind)
    except (UnicodeEncodeError, TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise InputRefused(Fault(reason=f"{shown(value)} is refused: {error}", where=where)) from error


def listed(values: Iterable[V], where: str) -> tuple[V, ...]:
    """Return several values as a tuple. Raises InputRefused: they are no collection."""
    try:
        return tuple(values)
    except TypeError as error:
        raise InputRefused(Fault(reason=f"{shown(values)} is no list", where=where)) from error


def shown(value: object) -> str:
    """Show the beginning of a value, also of one that cannot be shown."""
    try:
        return f"{value!r:.60}"
    except Exception:  # it is too deep, or its class has an error
        return f"a value of type {type(value).__name__!r}"


def _encoded(encode: Callable[[], bytes]) -> bytes:
    """Encode input. Raises InputRefused for half a character, and for values that JSON does not have."""
    try:
        return encode()
    except (UnicodeEncodeError, TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise InputRefused(Fault(reason=str(error), advice="text in Unicode, or what JSON can hold")) from error
