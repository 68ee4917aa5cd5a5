"""BML blocks and EBML turn fragments from XML, in every dialect, and back. Errors say which line and what to do.

Dialects: the thesis' draft (namespace `org.mindmakers.bml`), the same without a namespace, BML 1.0. Turn
fragments are an `ebml:ebml` (namespace `edu.wpi.ebml`) around the elements of any of these. What other
namespaces hold is ignored. Two spellings of one block decode to equal structs, but for their `dialect` and the
names of sync points, which stay as written (`schemas.syncref.canonical_sync`); in fragments these are the draft's.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
from lxml import etree

from schemas import behaviors as of
from schemas.blocks import Block
from schemas.check import check
from schemas.fragments import TurnFragment
from schemas.references import disambiguated, in_draft_spelling
from schemas.syncref import SYNC_POINTS
from schemas.xml_encode import encode_xml
from schemas.xml_source import BML_1_0, CORE, EBML, Source, split
from schemas.xml_speech import spoken

__all__ = ["decode_xml", "encode_xml"]

AnyStruct = TypeVar("AnyStruct", bound=msgspec.Struct)

CORE_BEHAVIORS: dict[str, type[of.Behavior]] = {
    str(kind.__struct_config__.tag): kind
    for kind in (
        of.Gaze, of.GazeShift, of.Pointing, of.Gesture, of.Head, of.HeadDirectionShift, of.Face, of.FaceLexeme,
        of.FaceFacs, of.FaceShift, of.Posture, of.PostureShift, of.Pose, of.Locomotion, of.Speech, of.Wait, of.Emit,
    )
}  # fmt: skip
EXTENSIONS: dict[str, type[of.Behavior]] = {
    "reference": of.Reference,
    "event": of.Event,
    "turn": of.TurnSignal,
}
SYNC_ATTRIBUTES = frozenset({*SYNC_POINTS, "strokeStart", "strokeEnd", "attackPeak"})
OPERATORS: dict[str, type[of.Synchronize | of.Before | of.After]] = {
    "synchronize": of.Synchronize,
    "before": of.Before,
    "after": of.After,
}
CHILDREN = {
    "face": {"lexeme", "facs"}, "faceShift": {"lexeme", "facs"}, "posture": {"stance", "pose"},
    "postureShift": {"stance", "pose"}, "emit": {"event"}, "reference": {"speechOption"},
    "event": {"object", "anchor"}, "speechOption": {"distractor"}, "synchronize": {"sync"}, "before": {"sync"},
    "after": {"sync"},
}  # fmt: skip
_NOT_ATTRIBUTES = frozenset(
    {"line", "timing", "required", "behaviors", "constraints", "options", "distractors", "objects", "anchors"}
)
_HANDS = {"left": "LEFT_HAND", "right": "RIGHT_HAND", "both": "BOTH_HANDS"}


def decode_xml(data: bytes | str, source: str = "") -> Block | TurnFragment:
    """The block or fragment in `data`. Raises InputRefused with `source`, line, reason and advice."""
    document = _Document(Source(data, source))
    thing = document.read()
    check(thing, source)
    return thing


class _Document:
    def __init__(self, source: Source) -> None:
        self._source = source
        self._speaks_1_0 = False

    def read(self) -> Block | TurnFragment:
        root = self._source.root
        namespace, local = split(str(root.tag))
        if local == "ebml" and namespace in ("", EBML):
            return self._fragment(root)
        if local == "bml" and namespace in CORE:
            return self._block(root, namespace)
        advice = f'expected <bml> (namespace org.mindmakers.bml, {BML_1_0} or none) or <ebml> (namespace "{EBML}")'
        raise self._source.refusal(
            f"<{local}> of namespace {namespace!r} is neither BML nor EBML", root, advice=advice
        )

    def _block(self, root: etree._Element, namespace: str) -> Block:
        plain = _attributes(root)
        behaviors, constraints = self._content(root, in_fragment=False)
        raw = {
            "id": self._id(root),
            "behaviors": behaviors,
            "constraints": constraints,
            "composition": plain.get("composition", "MERGE").upper(),
            "dialect": "bml-1.0" if namespace == BML_1_0 else "draft",
        }
        return disambiguated(self._convert(root, raw, Block))

    def _fragment(self, root: etree._Element) -> TurnFragment:
        raw = self._own_fields(root, TurnFragment)
        behaviors, constraints = self._content(root, in_fragment=True)
        raw |= {"id": self._id(root), "behaviors": behaviors, "constraints": constraints}
        raw["accept"] = str(raw.get("accept", "")).split()
        fragment = disambiguated(self._convert(root, raw, TurnFragment))
        return in_draft_spelling(fragment, "bml-1.0") if self._speaks_1_0 else fragment

    def _id(self, element: etree._Element) -> str:
        if id := element.get("id"):
            return id
        local = split(str(element.tag))[1]
        raise self._source.refusal(f"<{local}> has no id", element, advice='add id="..."')

    def _content(
        self, parent: etree._Element, *, in_fragment: bool, required: bool = False
    ) -> tuple[list[of.Behavior], list[of.Constraint]]:
        behaviors: list[of.Behavior] = []
        constraints: list[of.Constraint] = []
        for element, namespace, local in _ours(parent):
            self._speaks_1_0 |= namespace == BML_1_0
            if local in ("description", "participant"):
                continue
            if local == "required":
                more, further = self._content(element, in_fragment=in_fragment, required=True)
                behaviors += more
                constraints += further
            elif local == "constraint":
                constraints.append(self._constraint(element, required))
            elif local in CORE_BEHAVIORS and namespace != EBML:
                behaviors.append(self._behavior(element, local, CORE_BEHAVIORS[local], required))
            elif local in EXTENSIONS and namespace in ("", EBML):
                if local == "reference" and not in_fragment:
                    advice = "send it to generation as a turn fragment: <ebml:ebml>"
                    raise self._source.refusal("a block can't hold an object reference", element, advice=advice)
                behaviors.append(self._behavior(element, local, EXTENSIONS[local], required))
            else:
                # Issue 3: in a plain block this becomes a warning (BEHAVIOR_TYPE_NOT_SUPPORTED) and the rest runs.
                advice = f"known: {', '.join(sorted(CORE_BEHAVIORS))}, constraint"
                raise self._source.refusal(f"unknown element <{local}>", element, advice=advice)
        return behaviors, constraints

    def _behavior(self, element: etree._Element, local: str, kind: type[of.Behavior], required: bool) -> of.Behavior:
        plain = _attributes(element)
        raw: dict[str, Any] = _fields(plain)
        if local in EXTENSIONS:
            raw = self._own_fields(element, kind)
        raw["id"] = self._id(element)
        raw["line"] = self._source.line(element)
        if required:
            raw["required"] = True
        timing = [of.Timing(name, value) for name, value in plain.items() if name in SYNC_ATTRIBUTES]
        if local != "speech":
            self._only(element, local)
            timing += [
                of.Timing(child.get("sync", ""), child.get("ref", ""))
                for child, namespace, name in _ours(element)
                if (namespace, name) == (EBML, "timing")
            ]
        match local:
            case "gesture" | "pointing":
                raw["mode"] = _hand(plain.get("mode") or plain.get("hand"))
                if plain.get("type", "").upper() == "POINT":
                    kind = of.Pointing
                elif kind is of.Gesture and "lexeme" not in plain and "type" in plain:
                    raw["lexeme"] = plain["type"].upper()
            case "head":
                raw = _head(raw)
            case "face" | "faceShift":
                kind = self._face(element, plain, raw, kind)
            case "posture" | "postureShift":
                self._posture(element, raw)
            case "emit":
                raw.setdefault("event", _event_of(element))
            case "speech":
                timing += self._speech(element, raw)
            case "reference":
                raw["options"] = [self._option(child) for child, _, name in _ours(element) if name == "speechOption"]
            case "event":
                raw["accept"] = str(raw.get("accept", "")).split()
                raw["objects"] = [child.get("id", "") for child, _, name in _ours(element) if name == "object"]
                raw["anchors"] = [child.get("ref", "") for child, _, name in _ours(element) if name == "anchor"]
        raw["timing"] = timing
        return self._convert(element, {name: value for name, value in raw.items() if value is not None}, kind)

    def _speech(self, element: etree._Element, raw: dict[str, Any]) -> list[of.Timing]:
        said = spoken(self._source, element, raw["id"])
        raw["text"], raw["marks"] = said.text, said.marks
        raw["markup"] = said.markup or raw.get("markup", "")
        ties = [
            of.Timing(child.get("sync", ""), child.get("ref", ""))
            for child in element
            if split(str(child.tag)) == (EBML, "timing")
        ]
        return [*ties, *said.timing]

    def _face(
        self, element: etree._Element, plain: dict[str, str], raw: dict[str, Any], kind: type[of.Behavior]
    ) -> type[of.Behavior]:
        parts = [child for child, _, name in _ours(element) if name in ("lexeme", "facs")]
        if len(parts) > 1:
            raise self._source.refusal("more than one expression in a face", parts[1], advice="one element for each")
        for part in parts:
            raw |= _fields(_attributes(part)) | {"id": raw["id"]}
        if kind is of.FaceShift:
            return kind
        if "au" in raw or plain.get("type", "").upper() == "FACS":
            return of.FaceFacs
        if "lexeme" not in raw and "type" in plain:
            raw["lexeme"] = plain["type"].upper()
        return of.FaceLexeme if "lexeme" in raw else kind

    def _posture(self, element: etree._Element, raw: dict[str, Any]) -> None:
        for child, _, name in _ours(element):
            if name == "stance":
                raw["stance"] = child.get("type", "")
            elif name == "pose":
                raw["part"], raw["lexeme"] = child.get("part", ""), child.get("lexeme", "")

    def _option(self, element: etree._Element) -> of.SpeechOption:
        self._only(element, "speechOption")
        raw = self._own_fields(element, of.SpeechOption)
        raw["line"] = self._source.line(element)
        raw["distractors"] = [child.get("object", "") for child, _, _ in _ours(element)]
        return self._convert(element, raw, of.SpeechOption)

    def _constraint(self, element: etree._Element, required: bool) -> of.Constraint:
        operators = []
        for child, _, local in _ours(element):
            if local not in OPERATORS:
                advice = f"known: {', '.join(OPERATORS)}"
                raise self._source.refusal(f"unknown element <{local}> in a constraint", child, advice=advice)
            self._only(child, local)
            raw: dict[str, Any] = {"syncs": [self._ref(sync) for sync, _, _ in _ours(child)]}
            if (ref := child.get("ref")) is not None:
                raw["ref"] = ref
            raw["line"] = self._source.line(child)
            operators.append(self._convert(child, raw, OPERATORS[local]))
        raw = {"id": element.get("id", ""), "operators": operators, "line": self._source.line(element)}
        raw["required"] = required or _fields(_attributes(element)).get("required", False)
        return self._convert(element, raw, of.Constraint)

    def _own_fields(self, element: etree._Element, kind: type[msgspec.Struct]) -> dict[str, Any]:
        """Of an EBML element, whose every attribute we know. Raises InputRefused for one that we don't."""
        plain = _attributes(element)
        raw: dict[str, Any] = _fields({name: value for name, value in plain.items() if name not in SYNC_ATTRIBUTES})
        if "min_reliability" in raw:
            raw["minimum_reliability"] = raw.pop("min_reliability")
        for name in raw.keys() - set(kind.__struct_fields__) - {"character_id"}:
            local = split(str(element.tag))[1]
            known = ", ".join(_camel(field) for field in kind.__struct_fields__ if field not in _NOT_ATTRIBUTES)
            raise self._source.refusal(
                f"<{local}> has no attribute {_camel(name)!r}", element, advice=f"known: {known}"
            )
        return raw

    def _ref(self, sync: etree._Element) -> str:
        if (ref := sync.get("ref")) is None:
            raise self._source.refusal("<sync> without ref", sync, advice='<sync ref="behavior:sync"/>')
        return ref

    def _only(self, element: etree._Element, local: str) -> None:
        """Refuse children that the element can't have."""
        known = CHILDREN.get(local, set())
        for child, _, name in _ours(element):
            if name not in known and name not in ("description", "timing"):
                raise self._source.refusal(f"unknown element <{name}> in <{local}>", child)

    def _convert(self, element: etree._Element, raw: dict[str, Any], kind: type[AnyStruct]) -> AnyStruct:
        """Texts to the types of the struct. Raises InputRefused with the attribute that is wrong."""
        try:
            # BML has attributes called `type`; the struct's own says which element it is.
            return msgspec.convert({**_numbers(raw, kind), "type": kind.__struct_config__.tag}, kind, strict=False)
        except msgspec.ValidationError as error:
            reason, _, path = str(error).partition(" - at `$")
            field = path.strip(".`")
            local = split(str(element.tag))[1]
            missing = re.fullmatch("Object missing required field `(.*)`", reason)
            what = f"no {_camel(missing[1])}" if missing else f"{_camel(field)}: {reason}"
            name = f"<{local} id={raw['id']!r}>" if raw.get("id") else f"<{local}>"
            advice = _allowed(kind, field)
            raise self._source.refusal(f"{name}: {what}", element, advice=advice) from error


@cache
def _hints(kind: type[msgspec.Struct]) -> dict[str, Any]:
    return get_type_hints(kind)


def _numbers(raw: dict[str, Any], kind: type[msgspec.Struct]) -> dict[str, Any]:
    """Numbers as XML may write them (`.5`, `+2`), which JSON may not."""
    decimals = [name for name, hint in _hints(kind).items() if float in (hint, *get_args(hint))]
    numbers = {}
    for name in decimals:
        with suppress(ValueError):
            if isinstance(text := raw.get(name), str):
                numbers[name] = float(text)
    return raw | numbers


def _allowed(kind: type[msgspec.Struct], field: str) -> str:
    """The values of a field that has only a few, as advice."""
    hint = _hints(kind).get(field)
    choices = [str(value) for value in get_args(hint) if isinstance(value, str | int)]
    return f"one of {', '.join(choices)}" if choices else ""


def _ours(parent: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """The children that are BML or EBML, with namespace and local name."""
    for child in parent:
        namespace, local = split(str(child.tag))
        if namespace in CORE or namespace == EBML:
            yield child, namespace, local


def _attributes(element: etree._Element) -> dict[str, str]:
    """The attributes that are BML's or EBML's, by local name."""
    found = {}
    for name, value in element.items():
        namespace, local = split(str(name))
        undeclared = ":" in local
        if (namespace in CORE or namespace == EBML) and not undeclared:
            found[local] = str(value)
    return found


def _fields(plain: dict[str, str]) -> dict[str, Any]:
    """offsetAngle, offset-angle -> offset_angle. `line` is ours to say."""
    snake = {re.sub("(?<=[a-z])([A-Z])", r"_\1", name).replace("-", "_").lower(): plain[name] for name in plain}
    return {name: value for name, value in snake.items() if name not in ("line", "timing", "marks")}


def _camel(field: str) -> str:
    if field == "minimum_reliability":
        return "minReliability"
    return re.sub("_([a-z])", lambda match: match[1].upper(), field)


def _hand(name: str | None) -> str | None:
    return None if name is None else _HANDS.get(name.lower(), name)


def _head(raw: dict[str, Any]) -> dict[str, Any]:
    """`type="NOD"` or `action="rotation" rotation="nod"` of the drafts."""
    spelled = [str(raw[name]).upper() for name in ("rotation", "type", "action") if name in raw]
    drafts = [name for name in spelled if name != "ROTATION"]
    if "lexeme" not in raw and drafts:
        raw["lexeme"] = drafts[0]
    if "repeats" in raw:
        raw.setdefault("repetition", raw["repeats"])
    return raw


def _event_of(element: etree._Element) -> str | None:
    for child, _, name in _ours(element):
        if name == "event":
            return (child.text or child.get("id") or "").strip()
    return None
