"""Blocks and fragments from JSON, and back; `read` takes XML as well. Errors carry the JSON path.

The form is that of the structs, as in the exported schemas, or that of a language model's tool call
(schemas/tool.py).
Unknown keys are refused: a misspelled `turn_status` must not silently become a full turn.
"""

import json
import re
from collections import Counter
from typing import Any, TypeVar

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.access import LARGEST
from engage_hri.schemas.advice import allowed
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.check import validated
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_grammar import snake
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.text import begins_with, is_utf8, utf8
from engage_hri.schemas.tool import CALL, from_tool, is_tool_input

T = TypeVar("T", Block, TurnFragment)

UNNAMED = "fragment"
ENCODED = 3
"""Times that a call may be encoded as a string."""
_FENCE = re.compile(r"\s*```\w*\s*\n(?P<text>.*?)\n?\s*```\s*", re.DOTALL)
_FRAGMENT_ONLY = frozenset(TurnFragment.__struct_fields__) - frozenset(Block.__struct_fields__)


def encode_json(thing: Block | TurnFragment) -> bytes:
    return msgspec.json.format(msgspec.json.encode(thing), indent=2)


def decode_json(data: bytes | str, source: str = "", unnamed: str = UNNAMED) -> Block | TurnFragment:
    """Read one block or fragment. Raises InputRefused with source, JSON path, reason and advice.

    Without `type` it is a fragment if it has a field that only fragments have, or holds a reference.
    unnamed: the id for a language model's tool call, which has none.
    """
    return _thing(_parsed(data, source), source, "$", unnamed)


def read(data: bytes, source: str = "", unnamed: str = UNNAMED) -> tuple[Block | TurnFragment, ...]:
    """Read a file: one XML document, one JSON object, or a JSON array of several. Raises InputRefused.

    unnamed: the id for a language model's tool call, which has none; of several `<unnamed>-1`, `<unnamed>-2`...
    """
    start = begins_with(data)
    if start == "<":
        return (decode_xml(data, source),)
    if start not in ("{", "["):
        advice = "BML or EBML (XML), or the same as JSON"
        raise InputRefused(Fault(reason="neither XML nor JSON" if start else "empty", where=source, advice=advice))
    parsed = _parsed(data, source)
    if not isinstance(parsed, list):
        return (_thing(parsed, source, "$", unnamed),)
    return tuple(_thing(item, source, f"$[{index}]", f"{unnamed}-{index + 1}") for index, item in enumerate(parsed))


def read_call(data: bytes | str, id: str) -> TurnFragment:
    """Read a language model's tool call, as models write it. Raises InputRefused in words of the tool.

    A text in a fence of Markdown is the text, and a JSON string in place of an object or of the parts is the JSON
    that it holds: neither can mean anything else.
    """
    try:
        call = _parsed(_unfenced(data), "")
        for _ in range(ENCODED):
            call = _parsed(_unfenced(call), "") if isinstance(call, str) else call
        if isinstance(call, dict) and isinstance(parts := call.get("parts"), str) and parts.lstrip().startswith("["):
            call = {**call, "parts": _parsed(parts, "")}
    except InputRefused as error:
        fault = error.fault
        if "truncated" in fault.reason:
            empty = not data.strip()
            reason = "an empty call" if empty else "the call is truncated: its JSON ends before it is complete"
            raise InputRefused(replace(fault, reason=reason, advice=CALL)) from error
        raise InputRefused(replace(fault, advice=CALL)) from error
    if not isinstance(call, dict):
        raise _refusal(f"a call is an object, and this is {type(call).__name__}", "$", "", CALL)
    return from_tool(call, id)


def _unfenced(text: bytes | str) -> bytes | str:
    """The text within a fence of Markdown; without one, all of it."""
    decoded = utf8(text) if isinstance(text, bytes) else text
    return found["text"] if (found := _FENCE.fullmatch(decoded)) else decoded


def _parsed(data: bytes | str, source: str) -> Any:
    if len(data) > LARGEST:
        reason = f"{len(data)} bytes; at most {LARGEST} are read"
        raise InputRefused(Fault(reason=reason, where=source, advice="split it into several blocks"))
    # msgspec refuses text that is not UTF-8 as well, but as another error, and without the place.
    text = utf8(data, source) if isinstance(data, bytes) else data.removeprefix("\ufeff")
    if not is_utf8(text):
        raise InputRefused(Fault(reason="half a character (a surrogate without its other half)", where=source))
    raw = text.encode()
    try:
        parsed = msgspec.json.decode(raw)
        # msgspec silently keeps the last of two equal keys: half of the document would be performed.
        json.loads(raw, object_pairs_hook=_each_once, parse_int=str, parse_float=str)
        return parsed
    except RecursionError as error:
        raise InputRefused(Fault(reason="nested too deep", where=source)) from error
    except _Doubled as error:
        raise InputRefused(Fault(reason=str(error), where=source, advice="an object has each key once")) from error
    except msgspec.DecodeError as error:
        line = _line(raw, error)
        raise InputRefused(Fault(reason=str(error), where=source, line=line, advice="a JSON object")) from error


class _Doubled(Exception):
    pass


def _each_once(pairs: list[tuple[str, Any]]) -> None:
    for key, times in Counter(key for key, _ in pairs).items():
        if times > 1:
            raise _Doubled(f"key {key!r} stands {times} times in one object")


def _line(raw: bytes, error: msgspec.DecodeError) -> int:
    """Line of an error: that of the byte which msgspec names, or the last one of a truncated document; else 0."""
    byte = str(len(raw)) if "truncated" in str(error) else str(error).rpartition("(byte ")[2].rstrip(")")
    return raw.count(b"\n", 0, int(byte)) + 1 if byte.isdigit() else 0


def _thing(parsed: Any, source: str, path: str, unnamed: str) -> Block | TurnFragment:
    if not isinstance(parsed, dict):
        raise _refusal(f"expected an object, found {type(parsed).__name__}", path, source)
    if is_tool_input(parsed):
        return from_tool(parsed, unnamed, source, path)
    kind = parsed.get("type") or ("fragment" if _looks_like_fragment(parsed) else "block")
    if kind == "fragment":
        return _converted(parsed, TurnFragment, source, path)
    if kind == "block":
        return _converted(parsed, Block, source, path)
    raise _refusal(f"unknown type {kind!r}", f"{path}.type", source, 'use "fragment" or "block"')


def _looks_like_fragment(parsed: dict[str, Any]) -> bool:
    behaviors = parsed.get("behaviors")
    refers = isinstance(behaviors, list) and any(
        isinstance(each, dict) and each.get("type") == "reference" for each in behaviors
    )
    return refers or not _FRAGMENT_ONLY.isdisjoint(map(snake, parsed))


def _converted(parsed: dict[str, Any], kind: type[T], source: str, path: str) -> T:
    """Make the struct. Raises InputRefused that names the block or fragment, if its id can be read."""
    try:
        return _struct(parsed, kind, source, path)
    except InputRefused as error:
        id = parsed.get("id")
        raise InputRefused(error.fault, id if isinstance(id, str) and id else None) from error


def _struct(parsed: dict[str, Any], kind: type[T], source: str, path: str) -> T:
    try:
        thing = msgspec.convert({**parsed, "type": kind.__struct_config__.tag}, kind)
    except msgspec.ValidationError as error:
        reason, _, where = str(error).partition(" - at `$")
        told = allowed(error, kind) if reason.startswith("Invalid enum value") else ""
        raise _refusal(reason, f"{path}{where.rstrip('`')}", source, told or "see docs/protocol.md") from error
    except RecursionError as error:
        raise _refusal("nested too deep", path, source) from error
    _refuse_unknown_keys(parsed, thing, path, source)
    return validated(thing, source, prefix=path, paths=True)


def _refuse_unknown_keys(parsed: Any, decoded: Any, path: str, source: str) -> None:
    if isinstance(decoded, Struct) and isinstance(parsed, dict):
        fields = dict(zip(decoded.__struct_encode_fields__, decoded.__struct_fields__, strict=True))
        for key, value in parsed.items():
            if key in fields:
                _refuse_unknown_keys(value, getattr(decoded, fields[key]), f"{path}.{key}", source)
            elif key != decoded.__struct_config__.tag_field:
                advice = f"did you mean {snake(key)!r}?" if snake(key) in fields else f"known: {', '.join(fields)}"
                raise _refusal(f"unknown key {key!r}", f"{path}.{key}", source, advice)
    elif isinstance(decoded, tuple) and isinstance(parsed, list):
        for index, (value, item) in enumerate(zip(parsed, decoded, strict=True)):
            _refuse_unknown_keys(value, item, f"{path}[{index}]", source)


def _refusal(reason: str, path: str, source: str, advice: str = "") -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{source}: {path}" if source else path, advice=advice))
