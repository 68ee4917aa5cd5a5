"""Reading of BML blocks and EBML turn fragments in XML, in every dialect. Errors have the line and an advice.

Dialects: the thesis' draft (namespace `org.mindmakers.bml`), the same without a namespace, BML 1.0. A turn fragment
is an `ebml:ebml` (namespace `edu.wpi.ebml`) around the elements of any of these. One block in two dialects is decoded
to equal structs, but for `dialect` and the names of sync points, which stay as written (see `canonical_sync` of
schemas/behavior_types.py); in fragments they are those of the draft.

Blocks are written by people, and read leniently: an unknown part is left out and noted in `Block.unread`, an unknown
behavior becomes `Unknown`; the realizer warns of both. Fragments are written by programs, and read strictly; but what
is of another namespace is left out of either, and noted. Text behind a reference in a fragment is speech:
`<ebml:reference .../>, and then`.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Set
from functools import cached_property
from itertools import chain, count
from typing import Any

import msgspec
from lxml import etree

from engage_hri.schemas import behaviors as of
from engage_hri.schemas import vocabulary
from engage_hri.schemas.advice import allowed, meant
from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.blocks import Block, Unread, WarningKind
from engage_hri.schemas.check import check
from engage_hri.schemas.documents import xml_grammar as grammar
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.documents.xml_grammar import AnyStruct, fields
from engage_hri.schemas.documents.xml_source import (
    BML_1_0,
    CORE,
    EBML,
    READ,
    Source,
    attributes,
    bml_children,
    children_named,
    foreign_attributes,
    local_name,
    prefixed_name,
    split,
)  # fmt: skip
from engage_hri.schemas.documents.xml_speech import MARKS, language, spoken
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SYNC_NAMES, disambiguated, in_draft_spelling

__all__ = ["decode_xml", "encode_xml"]

MOST = 100
"""Notes of one kind that are told: each takes time to make, and is a warning on the bus."""
_STRAY = "{urn:engage}stray"
"""Tag of the elements that are about to be removed."""


def decode_xml(data: bytes | str, source: str = "") -> Block | TurnFragment:
    """Read a block or fragment. Raises InputRefused with `source`, line, reason and advice."""
    document = _Document(Source(data, source))
    thing = document.read()
    check(thing, source, line=document.line)
    return thing


class _Document:
    """Reader of one document, with the behaviors, constraints and notes that it has found so far."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._speaks_1_0 = False
        self._is_strict = False
        self._is_draft = False
        self._behaviors: list[of.Behavior] = []
        self._constraints: list[of.Constraint] = []
        self._notes = Notes()
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
        self._note_attributes(root)
        self._note_foreign(root, foreign_attributes(root))
        raw = {"composition": plain.get("composition"), "character_id": plain.get("characterId")}
        self._is_draft = namespace != BML_1_0
        raw["dialect"] = "draft" if self._is_draft else "bml-1.0"
        return disambiguated(self._converted(root, raw | self._content(root), Block))

    def _fragment(self, root: etree._Element) -> TurnFragment:
        self._is_strict = True
        raw = self._own_fields(root, TurnFragment)
        self._note_foreign(root, foreign_attributes(root))
        fragment = disambiguated(self._converted(root, raw | self._content(root), TurnFragment))
        return in_draft_spelling(fragment, "bml-1.0") if self._speaks_1_0 else fragment

    def _content(self, root: etree._Element) -> dict[str, Any]:
        self._walk(root, required=False)
        content = {"behaviors": self._behaviors, "constraints": self._constraints, "unread": self._notes.told()}
        return {"id": self._id(root), **content}

    def _id(self, element: etree._Element) -> str:
        if id := element.get("id"):
            return id
        raise self._source.refusal(f"<{local_name(element)}> has no id", element, advice='add id="..."')

    def _leave_out(
        self,
        reason: str,
        element: etree._Element,
        behavior: str = "",
        *,
        required: bool = False,
        advice: str = "",
        kind: WarningKind = "PARSING_FAILURE",
    ) -> None:
        """Note a part that is not understood. Raises InputRefused in a fragment, and for a required part."""
        if self._is_strict or required:
            raise self._source.refusal(reason, element, advice=advice)
        self._note(reason, element, behavior, kind)

    def _note(
        self, reason: str, at: etree._Element | int, behavior: str = "", kind: WarningKind = "PARSING_FAILURE"
    ) -> None:
        """at: an element, or a line."""
        line = at if isinstance(at, int) else self._source.line(at)
        self._notes.add(f"line {line}: {reason}; it is ignored", behavior, kind)

    def _note_attributes(
        self, element: etree._Element, behavior: str = "", kind: type[of.Behavior] | None = None
    ) -> list[of.Timing]:
        """Note unknown attributes. kind: of a behavior, in which an attribute that names a sync point is timing."""
        plain, local = attributes(element), local_name(element)
        timing, ignored = list[of.Timing](), list[str]()
        for name in grammar.unknown_attributes(plain, local, kind):
            if kind and grammar.is_reference(plain[name]):
                timing.append(of.Timing(name, plain[name]))
            elif vocabulary.definition(local, name):
                ignored.append(name)
            else:
                is_full = self._notes.is_full("PARSING_FAILURE")  # What was meant takes time to find.
                near = "" if is_full else meant(name, grammar.known_attributes(local, kind) - plain.keys())
                self._note(f"<{local}> has no attribute {name!r}{near}", element, behavior)
        if ignored:
            self._note(vocabulary.ignored(local, ignored), element, behavior, "DEGRADED")
        return timing

    def _note_foreign(self, element: etree._Element, parts: Iterable[str], behavior: str = "") -> None:
        """Note what other namespaces add to an element: all in one note."""
        if added := ", ".join(dict.fromkeys(parts)):
            reason = f"what another namespace adds to <{local_name(element)}> is not supported: {added}"
            self._note(reason, element, behavior, "CUSTOM_ATTRIBUTE_NOT_SUPPORTED")

    def _walk(self, parent: etree._Element, *, required: bool) -> None:
        """Read the content of a document, or of a <required> in it."""
        behind = [child for child in parent if child.tail and child.tail.strip() and not self._speaks_on(child)]
        text = (parent.text or "").strip()
        if words := " ".join([*([text] if text else ()), *(str(child.tail).strip() for child in behind)]):
            line = self._source.line_of_text(parent if text else behind[0], is_behind=not text)
            self._note(f"text {words[:40]!r} outside of speech", line)
        for element in parent:
            namespace, local = split(str(element.tag))
            if namespace not in READ:
                self._custom(element, namespace, required)
                continue
            self._speaks_1_0 |= namespace == BML_1_0
            if local in ("description", "participant"):
                continue
            if local == "reference" and namespace in ("", EBML) and not self._is_strict:
                advice = "send it to generation as a turn fragment: <ebml:ebml>"
                raise self._source.refusal("a block can't hold an object reference", element, advice=advice)
            if local == "required":
                self._note_attributes(element)
                self._note_foreign(element, foreign_attributes(element))
                self._walk(element, required=True)
            elif local == "constraint":
                self._constraints.append(self._constraint(element, required))
            elif grammar.behavior_type(namespace, local, is_strict=self._is_strict):
                self._behaviors.append(self._behavior(element, local, required))
                if self._speaks_on(element) and (words := " ".join((element.tail or "").split())):
                    self._behaviors.append(self._after_reference(element, words, required))
            elif self._is_strict or not element.get("id"):
                advice = f"known: {', '.join(grammar.STANDARD)}, constraint"
                kind: WarningKind = "BEHAVIOR_TYPE_NOT_SUPPORTED"
                reason = vocabulary.unperformed(local)
                self._leave_out(reason, element, required=required, advice=advice, kind=kind)
            else:
                self._behaviors.append(self._unknown(element, local, required))

    def _speaks_on(self, element: etree._Element) -> bool:
        """Tell whether the text behind an element is speech, as it is behind a reference in a fragment."""
        namespace, local = split(str(element.tag))
        return self._is_strict and local == "reference" and namespace in ("", EBML)

    def _after_reference(self, element: etree._Element, words: str, required: bool) -> of.Speech:
        reference, line = element.get("id"), self._source.line(element)
        wishes = chain([f"{reference}-text"], (f"{reference}-text-{number}" for number in count(2)))
        id = next(wish for wish in wishes if wish not in self._ids)
        timing = (of.Timing("start", f"{reference}:end"),)
        spoken_in = language(self._source, element)
        return of.Speech(id=id, text=words, language=spoken_in, timing=timing, required=required, line=line)

    @cached_property
    def _ids(self) -> Set[str | None]:
        """Ids that the author has given."""
        return {each.get("id") for each in self._source.root.iter()}

    def _unknown(self, element: etree._Element, name: str, required: bool, **said: str) -> of.Unknown:
        is_required = required or fields(attributes(element)).get("required")
        raw = {"id": self._id(element), "element": name, "required": is_required, **said}
        return self._converted(element, raw, of.Unknown)

    def _custom(self, element: etree._Element, namespace: str, required: bool) -> None:
        """Take in a behavior of another namespace. Without an id, and in a fragment, there is but a note of it."""
        name = prefixed_name(element)
        if not self._is_strict and element.get("id"):
            self._behaviors.append(self._unknown(element, name, required, namespace=namespace))
            return
        reason = f"<{name}> is of namespace {namespace!r}, of which nothing is performed"
        kind: WarningKind = "CUSTOM_BEHAVIOR_NOT_SUPPORTED"
        if required:
            raise self._source.refusal(reason, element, advice="take it out of what is required")
        self._note(reason, element, element.get("id", ""), kind)

    def _behavior(self, element: etree._Element, local: str, required: bool) -> of.Behavior:
        row, plain = TYPES[local], attributes(element)
        self._note_foreign(element, grammar.foreign_parts(element), self._id(element))
        raw = fields(plain) if row.is_standard else self._own_fields(element, row.kind)
        raw |= {"id": self._id(element)} | ({"required": True} if required else {})
        timing = [of.Timing(name, value) for name, value in plain.items() if name in SYNC_NAMES]
        if local == "speech":
            timing += self._speech(element, raw)
        else:
            self._only(element, raw["id"])
            timing += _ties(element)
        self._parts(element, local, raw)
        for field, value in grammar.of_drafts(plain, local):
            raw[field] = raw.get(field) or value
        if local == "head" and str(raw.get("amount", "")).strip().startswith("-"):
            reason = f"the sign of amount {raw['amount']!r}: a head begins on its own side"
            self._note(reason, element, raw["id"], "DEGRADED")
            raw["amount"] = str(raw["amount"]).strip().removeprefix("-")
        if local == "emit":
            said = ((child.text or child.get("id") or "").strip() for child in children_named(element, "event"))
            raw.setdefault("event", next(said, None))
        if local == "reference":
            raw["options"] = self._options(element, raw)
        kind = grammar.kind_of(local, plain.get("type", "").upper(), raw)
        if self._is_draft and (lacks := grammar.lacking(plain, local, raw, kind)):
            return self._unknown(element, local, required, lacks=lacks)
        if row.is_standard:
            timing += self._note_attributes(element, raw["id"], kind)
        return self._converted(element, raw | {"timing": timing}, kind)

    def _speech(self, element: etree._Element, raw: dict[str, Any]) -> list[of.Timing]:
        self._leave_out_strays(element, raw["id"])
        self._choose(element, raw["id"])
        said = spoken(self._source, element, raw["id"])
        raw["text"], raw["marks"] = said.text, said.marks
        raw["language"] = raw.get("language") or language(self._source, element)
        if said.is_attribute:
            del element.attrib["text"]  # It has been read.
        raw["markup"] = said.markup or raw.get("markup", "")
        children = list(bml_children(element))
        has_text = any(name == "text" for _, _, name in children)
        for child, _, name in children:
            if name == "text":
                self._note_attributes(child, raw["id"])
            elif has_text and name not in ("description", "timing"):
                self._leave_out(f"unknown element <{name}> beside <text>", child, raw["id"])
        return [*_ties(element), *said.timing]

    def _choose(self, speech: etree._Element, id: str) -> None:
        """Let a speech say the first of its alternatives."""
        found = [each for each in speech.iter(etree.Element) if local_name(each) == "alternative"]
        first = {each.getparent(): each for each in reversed(found)}
        if others := [each for each in found if each is not first[each.getparent()]]:
            self._note("only the first <alternative> is said: another", others[0], id, "DEGRADED")
            for each in others:
                each.tag = _STRAY
            etree.strip_elements(speech, _STRAY, with_tail=False)
        etree.strip_tags(speech, "{*}alternative")

    def _leave_out_strays(self, speech: etree._Element, id: str) -> None:
        """Leave out elements that a <speech> cannot hold: other behaviors, and anything inside a mark."""
        for stray in list(grammar.behaviors_inside(speech, is_strict=self._is_strict)):
            local = local_name(stray)
            advice = f'put it beside the speech; a mark says when: start="{id}:m1"'
            self._leave_out(f"unknown element <{local}> in <speech>", stray, id, advice=advice)
            stray.tag = _STRAY
        etree.strip_elements(speech, _STRAY, with_tail=False)
        noted: set[tuple[str, str]] = set()
        for each in speech.iter():
            if (local := local_name(each)) in MARKS:
                self._only(each, id)
                unknown = list(grammar.unknown_attributes(attributes(each), local, None))
                for name in unknown:
                    if (local, name) not in noted:  # one note for all the marks of a speech
                        self._note(f"<{local}> has no attribute {name!r}", each, id)
                noted.update((local, name) for name in unknown)

    def _parts(self, element: etree._Element, local: str, raw: dict[str, Any]) -> None:
        """Read the elements inside a face (its expressions) or a posture (a stance and its poses)."""
        found: list[dict[str, Any]] = []
        elements = [
            (child, name)
            for child, _, name in bml_children(element)
            if name in grammar.PARTS.keys() & grammar.CHILDREN.get(local, ())
        ]
        for child, name in elements:
            self._note_attributes(child, raw["id"])
            parts = {field: child.get(each) for each, field in grammar.PARTS[name].items()}
            if name != "stance":
                found.append({field: value for field, value in parts.items() if value is not None})
            elif "stance" in raw:
                reason, is_required = f"more than one <{name}> in a posture", grammar.says_yes(raw.get("required"))
                self._leave_out(reason, child, raw["id"], required=is_required, advice="one element for each")
            else:
                raw["stance"] = parts["stance"] or ""
        if len(found) == 1:
            raw.update(found[0])
        elif found:
            kind = of.Expression if TYPES[local].family == "face" else of.PartPose
            children = [child for child, name in elements if name != "stance"]
            parts_of = "expressions" if kind is of.Expression else "poses"
            raw[parts_of] = [
                msgspec.to_builtins(self._converted(child, each, kind))
                for child, each in zip(children, found, strict=True)
            ]

    def _options(self, element: etree._Element, raw: dict[str, Any]) -> list[of.SpeechOption] | None:
        """Phrases of a reference; None if the author leaves them to generation."""
        options = [
            self._converted(child, self._own_fields(child, of.SpeechOption), of.SpeechOption)
            for child in children_named(element, "speechOption")
        ]
        if not grammar.says_yes(raw.pop("propose", "")):
            return options
        if options:
            raise self._source.refusal("phrases are to be proposed, and offered", element, advice="leave out one")
        return None

    def _constraint(self, element: etree._Element, required: bool) -> of.Constraint:
        self._note_attributes(element)
        self._note_foreign(element, grammar.foreign_parts(element))
        required = required or grammar.says_yes(fields(attributes(element)).get("required"))
        operators = []
        for child, _, local in bml_children(element):
            if local == "description":
                continue
            if local not in grammar.OPERATORS:
                advice = f"known: {', '.join(grammar.OPERATORS)}"
                reason = f"unknown element <{local}> in a constraint"
                self._leave_out(reason, child, required=required, advice=advice)
                continue
            self._only(child)
            self._note_attributes(child)
            for sync in children_named(child, "sync"):
                if "ref" not in sync.attrib:
                    raise self._source.refusal("<sync> without ref", sync, advice='<sync ref="behavior:sync"/>')
                self._note_attributes(sync)
            operators.append(self._converted(child, {"ref": child.get("ref")}, grammar.OPERATORS[local]))
        raw = {"id": element.get("id"), "operators": operators, "required": required}
        return self._converted(element, raw, of.Constraint)

    def _own_fields(self, element: etree._Element, kind: type[msgspec.Struct]) -> dict[str, Any]:
        """Read the attributes of an EBML element as fields. Raises InputRefused for an unknown attribute."""
        plain = attributes(element)
        raw = fields({name: value for name, value in plain.items() if name not in SYNC_NAMES})
        known = {*kind.__struct_fields__, "character_id", "propose" if kind is of.Reference else "id"}
        for name in sorted(raw.keys() - known):
            reason = f"<{local_name(element)}> has no attribute {grammar.attribute(name)!r}"
            known_names = (grammar.attribute(each) for each in grammar.attribute_fields(kind) if each != "required")
            raise self._source.refusal(reason, element, advice=f"known: {', '.join(known_names)}")
        return raw

    def _only(self, element: etree._Element, behavior: str = "") -> None:
        """Note the elements inside this one that stand in the wrong place. Raises InputRefused in a fragment."""
        for child, name, holder in grammar.misplaced(element):
            known = ", ".join(sorted(grammar.CHILDREN.get(holder, ()))) or "nothing"
            advice = f"<{holder}> holds {known}: put <{name}> beside it"
            self._leave_out(f"unknown element <{name}> in <{holder}>", child, behavior, advice=advice)

    def _converted(self, element: etree._Element, raw: Mapping[str, Any], kind: type[AnyStruct]) -> AnyStruct:
        """Make the struct of an element. Raises InputRefused with the bad attribute. raw: None: not given."""
        try:
            lines = {"line": self._source.line(element)}
            return grammar.converted({**raw, **grammar.lists(element, kind), **lines}, kind)
        except msgspec.ValidationError as error:
            reason, _, path = str(error).partition(" - at `$")
            field = path.strip(".`")
            missing = re.fullmatch("Object missing required field `(.*)`", reason)
            lacks = grammar.attribute(missing[1]) if missing else ""
            what = f"no {lacks}" if missing else f"{grammar.attribute(field)}: {reason}"
            name = f"<{local_name(element)}" + (f" id={raw['id']!r}>" if raw.get("id") else ">")
            advice = f'add {lacks}="..."' if missing else allowed(error, kind)
            raise self._source.refusal(f"{name}: {what}", element, advice=advice) from error


def _ties(element: etree._Element) -> list[of.Timing]:
    children = (child for child in element if split(str(child.tag)) == (EBML, "timing"))
    return [of.Timing(child.get("sync", ""), child.get("ref", "")) for child in children]


class Notes:
    """Notes of one document, as they come."""

    def __init__(self) -> None:
        self._kept: list[Unread] = []
        self._count = Counter[WarningKind]()

    def is_full(self, kind: WarningKind) -> bool:
        """Tell whether the next note of this kind is only counted, and needs no words."""
        return self._count[kind] >= MOST

    def add(self, message: str, behavior: str, kind: WarningKind) -> None:
        if not self.is_full(kind):
            self._kept.append(Unread(message=message, behavior=behavior, kind=kind))
        self._count[kind] += 1

    def told(self) -> list[Unread]:
        """All notes, with one for each kind of which there are more."""
        more = [(kind, number - MOST) for kind, number in self._count.items() if number > MOST]
        return self._kept + [
            Unread(message=f"{number} more {'part is' if number == 1 else 'parts are'} ignored", kind=kind)
            for kind, number in more
        ]
