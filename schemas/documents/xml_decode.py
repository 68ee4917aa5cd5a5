"""BML blocks and EBML turn fragments from XML, in every dialect, and back. Errors say which line and what to do.

Dialects: the thesis' draft (namespace `org.mindmakers.bml`), the same without a namespace, BML 1.0. Turn
fragments are an `ebml:ebml` (namespace `edu.wpi.ebml`) around the elements of any of these. What other
namespaces hold is ignored. Two spellings of one block decode to equal structs, but for their `dialect` and the
names of sync points, which stay as written (`canonical_sync` of schemas/syncref.py); in fragments they are those
of the draft.

A block is read leniently: what is unknown in it is left out and noted in `Block.unread`, an unknown behavior
becomes `Unknown`; the realizer warns of both. A fragment is read strictly: it is a program's, not an author's. What
stands behind a reference in it is speech: `<ebml:reference .../>, and then`.
"""

from itertools import chain, count
from typing import Any

import msgspec
from lxml import etree

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.blocks import Block, Unread
from engage_hri.schemas.check import check
from engage_hri.schemas.documents.xml_elements import (
    CHILDREN,
    CORE_BEHAVIORS,
    EXTENSIONS,
    OPERATORS,
    behaviors_inside,
    misplaced,
    take_out,
)
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.documents.xml_names import (
    SYNC_ATTRIBUTES,
    attributes,
    camel,
    converted,
    fields,
    hand,
    head,
    is_reference,
    known_attributes,
    ours,
    unknown_attributes,
)
from engage_hri.schemas.documents.xml_source import BML_1_0, CORE, EBML, Source, split
from engage_hri.schemas.documents.xml_speech import MARKS, spoken
from engage_hri.schemas.feedback import WarningKind
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import disambiguated, in_draft_spelling

__all__ = ["decode_xml", "encode_xml"]


def decode_xml(data: bytes | str, source: str = "") -> Block | TurnFragment:
    """The block or fragment in `data`. Raises InputRefused with `source`, line, reason and advice."""
    document = _Document(Source(data, source))
    thing = document.read()
    check(thing, source, line=document.line)
    return thing


class _Document:
    def __init__(self, source: Source) -> None:
        self._source = source
        self._speaks_1_0 = False
        self._is_strict = False
        self._unread: list[Unread] = []
        self.line = source.line(source.root)

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
        plain = attributes(root)
        self._note_attributes(root, "bml")
        behaviors, constraints = self._content(root)
        raw = {
            "id": self._id(root),
            "behaviors": behaviors,
            "constraints": constraints,
            "composition": plain.get("composition", "MERGE").strip().upper(),
            "dialect": "bml-1.0" if namespace == BML_1_0 else "draft",
            "character_id": plain.get("characterId", ""),
            "unread": self._unread,
        }
        return disambiguated(converted(self._source, root, raw, Block))

    def _fragment(self, root: etree._Element) -> TurnFragment:
        self._is_strict = True
        raw = self._own_fields(root, TurnFragment)
        behaviors, constraints = self._content(root)
        raw |= {"id": self._id(root), "behaviors": behaviors, "constraints": constraints}
        raw |= {"accept": str(raw.get("accept", "")).split(), "unread": self._unread, "line": self.line}
        fragment = disambiguated(converted(self._source, root, raw, TurnFragment))
        return in_draft_spelling(fragment, "bml-1.0") if self._speaks_1_0 else fragment

    def _id(self, element: etree._Element) -> str:
        if id := element.get("id"):
            return id
        local = split(str(element.tag))[1]
        raise self._source.refusal(f"<{local}> has no id", element, advice='add id="..."')

    def _leave_out(
        self,
        reason: str,
        element: etree._Element,
        behavior: str = "",
        *,
        kind: WarningKind = "PARSING_FAILURE",
        required: bool = False,
        advice: str = "",
    ) -> None:
        """Note what is not understood. Raises InputRefused where nothing may be left out."""
        if self._is_strict or required:
            raise self._source.refusal(reason, element, advice=advice)
        self._note(reason, element, behavior, kind)

    def _note(
        self, reason: str, element: etree._Element, behavior: str, kind: WarningKind = "PARSING_FAILURE"
    ) -> None:
        message = f"line {self._source.line(element)}: {reason}; it is ignored"
        self._unread.append(Unread(message=message, behavior=behavior, kind=kind))

    def _note_attributes(self, element: etree._Element, local: str, behavior: str = "") -> None:
        """Of an element that is no behavior."""
        for name in unknown_attributes(attributes(element), local, None):
            self._note(f"<{local}> has no attribute {name!r}", element, behavior)

    def _content(
        self, parent: etree._Element, *, required: bool = False
    ) -> tuple[list[of.Behavior], list[of.Constraint]]:
        behaviors: list[of.Behavior] = []
        constraints: list[of.Constraint] = []
        texts = [parent.text, *(child.tail for child in parent if not self._speaks_on(child))]
        if words := " ".join(text.strip() for text in texts if text and text.strip()):
            self._note(f"text {words[:40]!r} outside of speech", parent, "")
        for element, namespace, local in ours(parent):
            self._speaks_1_0 |= namespace == BML_1_0
            if local in ("description", "participant"):
                continue
            if local == "reference" and namespace in ("", EBML) and not self._is_strict:
                advice = "send it to generation as a turn fragment: <ebml:ebml>"
                raise self._source.refusal("a block can't hold an object reference", element, advice=advice)
            if local == "required":
                self._note_attributes(element, local)
                more, further = self._content(element, required=True)
                behaviors += more
                constraints += further
            elif local == "constraint":
                constraints.append(self._constraint(element, required))
            elif local in CORE_BEHAVIORS and namespace != EBML:
                behaviors.append(self._behavior(element, local, CORE_BEHAVIORS[local], required))
            elif local in EXTENSIONS and (namespace == EBML or (not namespace and self._is_strict)):
                behaviors.append(self._behavior(element, local, EXTENSIONS[local], required))
                if self._speaks_on(element) and (words := " ".join((element.tail or "").split())):
                    behaviors.append(self._after_reference(element, words, required))
            elif self._is_strict or not element.get("id"):
                advice = f"known: {', '.join(sorted(CORE_BEHAVIORS))}, constraint"
                kind: WarningKind = "BEHAVIOR_TYPE_NOT_SUPPORTED"
                self._leave_out(f"unknown element <{local}>", element, kind=kind, required=required, advice=advice)
            else:
                behaviors.append(self._unknown(element, local, required))
        return behaviors, constraints

    def _speaks_on(self, element: etree._Element) -> bool:
        """Is the text behind it said? A comma or a full stop belongs to the phrase; it is no speech by itself."""
        namespace, local = split(str(element.tag))
        return self._is_strict and local == "reference" and namespace in ("", EBML)

    def _after_reference(self, element: etree._Element, words: str, required: bool) -> of.Speech:
        reference, line = element.get("id"), self._source.line(element)
        taken = {each.get("id") for each in self._source.root.iter()}
        wishes = chain([f"{reference}-text"], (f"{reference}-text-{number}" for number in count(2)))
        id = next(wish for wish in wishes if wish not in taken)
        timing = (of.Timing("start", f"{reference}:end"),)
        return of.Speech(id=id, text=words, timing=timing, required=required, line=line)

    def _unknown(self, element: etree._Element, local: str, required: bool) -> of.Unknown:
        raw = {"id": self._id(element), "element": local, "line": self._source.line(element)}
        raw["required"] = required or fields(attributes(element)).get("required", False)
        return converted(self._source, element, raw, of.Unknown)

    def _behavior(self, element: etree._Element, local: str, kind: type[of.Behavior], required: bool) -> of.Behavior:
        plain = attributes(element)
        raw: dict[str, Any] = fields(plain)
        if local in EXTENSIONS:
            raw = self._own_fields(element, kind)
        raw["id"] = self._id(element)
        raw["line"] = self._source.line(element)
        if required:
            raw["required"] = True
        timing = [of.Timing(name, value) for name, value in plain.items() if name in SYNC_ATTRIBUTES]
        if local != "speech":
            self._only(element, raw["id"])
            timing += [
                of.Timing(child.get("sync", ""), child.get("ref", ""))
                for child, namespace, name in ours(element)
                if (namespace, name) == (EBML, "timing")
            ]
        match local:
            case "gesture" | "pointing":
                raw["mode"] = hand(plain.get("mode") or plain.get("hand"))
                if plain.get("type", "").upper() == "POINT":
                    kind = of.Pointing
                elif kind is of.Gesture and "lexeme" not in plain and "type" in plain:
                    raw["lexeme"] = plain["type"].upper()
            case "head":
                raw = head(raw)
            case "face" | "faceShift":
                kind = self._face(element, plain, raw, kind)
            case "posture" | "postureShift":
                self._posture(element, raw)
            case "emit":
                raw.setdefault("event", _event_of(element))
            case "speech":
                timing += self._speech(element, raw)
            case "reference":
                raw["options"] = self._options(element, raw)
            case "event":
                raw["accept"] = str(raw.get("accept", "")).split()
                raw["objects"] = [child.get("id", "") for child, _, name in ours(element) if name == "object"]
                raw["anchors"] = [child.get("ref", "") for child, _, name in ours(element) if name == "anchor"]
        if local not in EXTENSIONS:
            timing += self._unread_attributes(element, plain, local, kind)
        raw["timing"] = timing
        if "side" in raw:
            raw["side"] = raw["side"].upper()
        raw = {name: value for name, value in raw.items() if value is not None}
        return converted(self._source, element, raw, kind)

    def _unread_attributes(
        self, element: etree._Element, plain: dict[str, str], local: str, kind: type[of.Behavior]
    ) -> list[of.Timing]:
        """Note the attributes that nobody reads. What names a sync point was meant as timing, and is returned."""
        timing = []
        for name in unknown_attributes(plain, local, kind):
            if is_reference(plain[name]):
                timing.append(of.Timing(name, plain[name]))
            else:
                self._note(f"<{local}> has no attribute {name!r}", element, plain["id"])
        return timing

    def _speech(self, element: etree._Element, raw: dict[str, Any]) -> list[of.Timing]:
        self._leave_out_strays(element, raw["id"])
        said = spoken(self._source, element, raw["id"])
        raw["text"], raw["marks"] = said.text, said.marks
        raw["markup"] = said.markup or raw.get("markup", "")
        children = list(ours(element))
        has_text = any(name == "text" for _, _, name in children)
        for child, _, name in children:
            if name == "text":
                self._note_attributes(child, name, raw["id"])
            elif has_text and name not in ("description", "timing"):
                self._leave_out(f"unknown element <{name}> beside <text>", child, raw["id"])
        ties = [
            of.Timing(child.get("sync", ""), child.get("ref", ""))
            for child in element
            if split(str(child.tag)) == (EBML, "timing")
        ]
        return [*ties, *said.timing]

    def _leave_out_strays(self, speech: etree._Element, id: str) -> None:
        """Behaviors are neither words nor markup for the voice, and marks are empty."""
        for stray in list(behaviors_inside(speech, is_strict=self._is_strict)):
            local = split(str(stray.tag))[1]
            advice = f'put it beside the speech; a mark says when: start="{id}:m1"'
            self._leave_out(f"unknown element <{local}> in <speech>", stray, id, advice=advice)
            take_out(stray)
        for each in speech.iter():
            if split(str(each.tag))[1] in MARKS:
                self._only(each, id)

    def _face(
        self, element: etree._Element, plain: dict[str, str], raw: dict[str, Any], kind: type[of.Behavior]
    ) -> type[of.Behavior]:
        parts = [child for child, _, name in ours(element) if name in ("lexeme", "facs")]
        for part in parts[1:]:
            reason = "more than one expression in a face"
            self._leave_out(reason, part, raw["id"], required=_is_true(raw), advice="one element for each")
        for part in parts[:1]:
            self._note_attributes(part, split(str(part.tag))[1], raw["id"])
            raw |= {name: part.get(name) for name in ("lexeme", "au", "side", "amount") if name in part.attrib}
        if kind is of.FaceShift:
            return kind
        if "au" in raw or plain.get("type", "").upper() == "FACS":
            return of.FaceFacs
        if "lexeme" not in raw and "type" in plain:
            raw["lexeme"] = plain["type"].upper()
        return of.FaceLexeme if "lexeme" in raw else kind

    def _posture(self, element: etree._Element, raw: dict[str, Any]) -> None:
        seen = set()
        for child, _, name in ours(element):
            if name in seen:
                reason = f"more than one <{name}> in a posture"
                self._leave_out(reason, child, raw["id"], required=_is_true(raw), advice="one element for each")
            elif name in ("stance", "pose"):
                seen.add(name)
                self._note_attributes(child, name, raw["id"])
                read = {"stance": "type"} if name == "stance" else {"part": "part", "lexeme": "lexeme"}
                raw |= {field: child.get(attribute, "") for field, attribute in read.items()}

    def _options(self, element: etree._Element, raw: dict[str, Any]) -> list[of.SpeechOption] | None:
        """None where the author leaves the phrases to generation."""
        options = [self._option(child) for child, _, name in ours(element) if name == "speechOption"]
        if not _says_yes(raw.pop("propose", "")):
            return options
        if options:
            raise self._source.refusal("phrases are to be proposed, and offered", element, advice="leave out one")
        return None

    def _option(self, element: etree._Element) -> of.SpeechOption:
        raw = self._own_fields(element, of.SpeechOption)
        raw["line"] = self._source.line(element)
        raw["distractors"] = [child.get("object", "") for child, _, _ in ours(element)]
        return converted(self._source, element, raw, of.SpeechOption)

    def _constraint(self, element: etree._Element, required: bool) -> of.Constraint:
        self._note_attributes(element, "constraint")
        required = required or _is_true(fields(attributes(element)))
        operators = []
        for child, _, local in ours(element):
            if local == "description":
                continue
            if local not in OPERATORS:
                advice = f"known: {', '.join(OPERATORS)}"
                reason = f"unknown element <{local}> in a constraint"
                self._leave_out(reason, child, required=required, advice=advice)
                continue
            self._only(child)
            self._note_attributes(child, local)
            raw: dict[str, Any] = {"syncs": [self._ref(sync) for sync, _, name in ours(child) if name == "sync"]}
            if (ref := child.get("ref")) is not None:
                raw["ref"] = ref
            raw["line"] = self._source.line(child)
            operators.append(converted(self._source, child, raw, OPERATORS[local]))
        raw = {"id": element.get("id", ""), "operators": operators, "line": self._source.line(element)}
        return converted(self._source, element, raw | {"required": required}, of.Constraint)

    def _own_fields(self, element: etree._Element, kind: type[msgspec.Struct]) -> dict[str, Any]:
        """Of an EBML element, whose every attribute we know. Raises InputRefused for one that we don't."""
        plain = attributes(element)
        raw: dict[str, Any] = fields({name: value for name, value in plain.items() if name not in SYNC_ATTRIBUTES})
        if "min_reliability" in raw:
            raw["minimum_reliability"] = raw.pop("min_reliability")
        known = {*kind.__struct_fields__, "character_id", "propose" if kind is of.Reference else "id"}
        for name in raw.keys() - known:
            local = split(str(element.tag))[1]
            raise self._source.refusal(
                f"<{local}> has no attribute {camel(name)!r}", element, advice=f"known: {known_attributes(kind)}"
            )
        return raw

    def _ref(self, sync: etree._Element) -> str:
        if (ref := sync.get("ref")) is None:
            raise self._source.refusal("<sync> without ref", sync, advice='<sync ref="behavior:sync"/>')
        self._note_attributes(sync, "sync")
        return ref

    def _only(self, element: etree._Element, behavior: str = "") -> None:
        """Note what the element, or one in it, can't hold. Raises InputRefused in a fragment."""
        for child, name, holder in misplaced(element):
            known = ", ".join(sorted(CHILDREN.get(holder, ()))) or "nothing"
            advice = f"<{holder}> holds {known}: put <{name}> beside it"
            self._leave_out(f"unknown element <{name}> in <{holder}>", child, behavior, advice=advice)


def _is_true(raw: dict[str, Any]) -> bool:
    return _says_yes(raw.get("required", ""))


def _says_yes(value: object) -> bool:
    return str(value).strip().lower() in ("true", "1")


def _event_of(element: etree._Element) -> str | None:
    for child, _, name in ours(element):
        if name == "event":
            return (child.text or child.get("id") or "").strip()
    return None
