"""Reader of a text that comes bit by bit: it finds what is for the ear, and leaves out what is for the eye alone.

The marks are those of CommonMark, with tables, footnotes and strikethrough as GitHub has them, and of HTML. A parser
of CommonMark reads a document as a whole: whether `*` begins an emphasis depends on how the paragraph ends. For a
voice that makes no difference, and it cannot wait: an asterisk beside a word is not said in either case. So what
stands beside a mark decides it. tests/text compares the letters with those that a parser finds. What is found are
pieces: words that are said, objects that are referred to, and what was left out.

    reader = Reader()
    pieces = [*reader.feed("See [the d", ids), *reader.feed("ocs](https://example.org).", ids), *reader.finish(ids)]

Reading is one table: for each first character the patterns that may match there, and what is done with a match. The
module `regex` tells of a pattern that it would match if more text came. Then the reader waits, and never otherwise.
No mark is longer than `LOOK`, so that reading takes time in proportion to the text, whatever it is.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from html import unescape
from string import digits
from typing import Literal, NamedTuple
from unicodedata import category

import regex
from msgspec import Struct

from engage_hri.schemas.advice import in_other_letters, meant
from engage_hri.services.text import patterns as mark
from engage_hri.services.text.patterns import ADDRESSED, LISTS

Kind = Literal["say", "symbol", "silent", "break", "refer", "left"]
Reason = Literal["", "address", "citation", "direction", "tag", "thought", "definition", "bracket", "case"]
"""Why something was left out, or said otherwise than it may have been meant. `bracket`: names no object, and is said
as words. `case`: names an object in other letters, and refers to it."""


class Piece(NamedTuple):
    """A piece of a text.

    kind: `say`: characters to be said. `symbol`: one that stands for others, which are not said as written.
    `silent`: an emoji, or another character without a sound. `break`: a paragraph, an item, a heading or a row ends;
    with the text `,`: a cell of a row. `refer`: the text is the id of an object. `left`: what is to be told.
    place: characters of the author's text before it. end: those up to its end.
    """

    kind: Kind
    text: str
    place: int
    end: int
    reason: Reason = ""
    certain: bool = False


_TOLD: Mapping[Reason, str] = {
    "thought": "thoughts were not said",
    "direction": "stage directions were not said",
    "citation": "citations were not said",
    "address": "addresses were not said in full",
    "definition": "definitions of links were not said",
    "tag": "tags were not said",
    "bracket": "brackets that are no reference were said as words",
    "case": "ids were written in other letters than the world has",
}
_MOST = 3
"""Examples in one line."""
_LONGEST = 48
"""Characters of one example."""


def problems(left: Iterable[Piece]) -> tuple[str, ...]:
    """Say in words what was left out of a text: one line a reason, with examples."""
    found: dict[Reason, dict[str, None]] = {}
    for each in left:
        if each.kind == "left":
            found.setdefault(each.reason, {})[_short(each.text)] = None
    return tuple(f"{told}: {_examples(list(found[reason]))}" for reason, told in _TOLD.items() if reason in found)


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _examples(texts: list[str]) -> str:
    more = f" and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
    return f"{', '.join(texts[:_MOST])}{more}"


_ANY = regex.compile(r"\[(?P<id>[^\s!\[\]]+)(?P<certain>!?)\](?=[^(])")


class Ids:
    """The ids of objects that a text may name. None: nobody knows the world, so that any word may be one."""

    def __init__(self, ids: Collection[str] | None) -> None:
        self.ids = frozenset(ids or ())
        self.is_unknown = ids is None
        named = rf"\[(?P<id>\L<ids>)(?P<certain>!?)\]{ADDRESSED}"
        self.exact = _ANY if ids is None else regex.compile(named, ids=self.ids)
        """Pattern of a bracket that names an object, `[id]` or `[id!]`; the longest id counts."""
        self.folded = regex.compile(named, regex.I | regex.F, ids=self.ids) if self.ids else self.exact
        """Pattern of one that does in other letters, maybe."""


LOOK = 4000
"""Characters that a mark may have from its start to its end."""
_WORDS = 80
"""Characters of the words in a bracket that are told."""
NO_IDS = Ids(())
_END = "\n\n"
"""Stands behind a text that is over, and before it: all but fences and elements ends at an empty line."""
_FRESH = frozenset(".!?…。！？:\n\"'”’»)")
"""Characters after which a sentence may begin."""
_CLOSING = ".,;:!?…)"
"""Characters that stand close to the word before them."""
Found = regex.Match[str]


class _Bracket(Struct):
    """An open bracket. is_index: of the word before it. words: in it so far."""

    is_index: bool
    is_image: bool
    words: str = ""


class Reader:
    """The state of reading, from one bit of the text to the next."""

    def __init__(self) -> None:
        self._text = _END
        """Text that is not decided, and the two characters before it."""
        self._at = len(_END)
        self._offset = -len(_END)
        """Characters of the author's text before `_text`."""
        self._last = ""
        """The last character that is said, but for white space; empty: nothing since a break."""
        self._is_line_start = True
        self._is_heading = self._is_list = self._has_stars = self._is_item = self._is_row = self._has_paragraph = (
            False
        )
        """What the line is. has_stars: within a list with the bullet `*`. is_item: right behind a bullet."""
        self._element = ""
        """The element with thoughts that has not been closed."""
        self._fence = ""
        """The fence that began a block of code."""
        self._open: list[_Bracket] = []
        self._was_index = False
        """True if the bracket that closed last was one: `array[0][1]`."""
        self._links = 0
        """Number of open brackets that can be no link, for one holds no other link."""
        self._found: list[Piece] = []
        self._ids = NO_IDS

    def feed(self, text: str, ids: Ids = NO_IDS) -> list[Piece]:
        """Take more of the text; returns the pieces that are certain now. ids: of the objects that there are now."""
        self._text += text
        return self._read(ids, is_over=False)

    def finish(self, ids: Ids = NO_IDS) -> list[Piece]:
        """Take the end of the text; returns all that is left of it."""
        end = self._offset + len(self._text)
        self._text += _END
        return [each for each in self._read(ids, is_over=True) if each.kind == "left" or each.place < end]

    @property
    def undecided(self) -> str:
        """The end of the text, of which more text must tell what it is."""
        return self._text[self._at :]

    def _read(self, ids: Ids, *, is_over: bool) -> list[Piece]:
        self._ids, self._found = ids, []
        while self._at < len(self._text):
            used = self._step(is_over=is_over)
            if used is None:
                break
            self._at += used
        done = self._at - len(_END)
        self._text, self._at, self._offset = self._text[done:], len(_END), self._offset + done
        return self._found

    def _step(self, *, is_over: bool) -> int | None:
        """Take the next mark or word; returns its length, or None if more text must tell.

        A mark that has letters is told if nothing comes of it.
        """
        until = min(len(self._text), self._at + LOOK)
        for pattern, take in self._rules():
            found = pattern.match(self._text, self._at, until, partial=not is_over)
            if found is None:
                continue
            if not found.partial:
                before, has_letters = len(self._found), not self._element and any(map(str.isalnum, found[0]))
                if take(self, found) is not False:
                    if has_letters and all(each.kind == "break" for each in self._found[before:]):
                        self._leave("address" if take is Reader._link else "tag", found[0].lstrip("]"))
                    return found.end() - self._at
            elif until - self._at < LOOK:
                return None
        self._is_line_start = self._is_line_start and self._text[self._at] == "\n"
        self._character(self._text[self._at], self._at)
        return 1

    def _rules(self) -> "Iterator[Rule]":
        first = self._text[self._at]
        if self._element or self._fence:
            yield from self._of_element(first) if self._element else self._of_fence(first)
            return
        if self._is_line_start:
            yield from _LINE.get(first, ())
            if first != "\n":
                self._is_line_start, self._is_row = False, first == "|"
        if first == "[":
            named = ((self._ids.exact, Reader._refer), (self._ids.folded, Reader._refer))
            yield from (*_INLINE[first], *named) if self._ids.is_unknown else (*named, *_INLINE[first])
            yield _OPENING, Reader._opens
            return
        yield from _INLINE.get(first, _PLAIN)

    # -- writing --------------------------------------------------------------------------------------------------

    def _say(self, text: str, at: int, size: int) -> None:
        """Say characters. at: their place in the text at hand. size: characters that they take up there."""
        self._piece("say" if len(text) == size else "symbol", text, at, size)
        self._note(text)
        if not text.isspace():
            self._last = text[-1]
            self._has_paragraph, self._is_item = True, False

    def _piece(self, kind: Kind, text: str, at: int, size: int) -> None:
        begin = self._offset + at
        self._found.append(Piece(kind, text, begin, begin + size))

    def _character(self, character: str, at: int, size: int = 1, *, is_literal: bool = False) -> None:
        """Say one character, or a space in place of an emoji. is_literal: it is no mark, whatever it looks like."""
        if mark.is_silent(character) and not character.isspace():
            self._piece("silent", "" if category(character) == "Cf" else character, at, size)
        elif is_literal and _PUNCTUATION.match(character):
            self._piece("symbol", character, at, size)
            self._last = character
        else:
            self._say(" " if character.isspace() else character, at, size)

    def _literally(self, begin: int, end: int) -> None:
        for at in range(begin, end):
            self._character(self._text[at], at, is_literal=True)

    def _break(self, found: Found, text: str = "") -> None:
        self._piece("break", text, found.start(), len(text))
        if not text:
            self._last = ""

    def _leave(self, reason: Reason, text: str) -> None:
        begin = self._offset + self._at
        self._found.append(Piece("left", text, begin, begin, reason))

    # -- lines ----------------------------------------------------------------------------------------------------

    def _skips(self, found: Found) -> None:
        """Take a mark that is not said."""

    def _spaces(self, found: Found) -> None:
        self._say(" ", found.start(), len(found[0]))

    def _begins_fence(self, found: Found) -> None:
        self._fence = found["fence"]
        self._break(found)

    def _begins_heading(self, found: Found) -> None:
        self._break(found)
        self._is_heading, self._is_line_start = True, False

    def _bullet(self, found: Found) -> None:
        self._break(found)
        self._is_list = self._is_item = True
        self._has_stars = found[0] == "*"

    def _number(self, found: Found) -> None:
        if found["number"] == "1" or self._is_list or not self._has_paragraph:
            self._break(found)
            self._is_list = True
        self._is_line_start = False
        self._says(found)

    def _newline(self, found: Found) -> None:
        is_blank = self._is_line_start
        self._say(" ", found.start(), 1)
        if self._is_heading or self._is_row or is_blank:
            self._break(found)
        if is_blank:
            self._is_list = self._has_paragraph = self._has_stars = False
            for each in self._open:
                self._leave("bracket", f"[{each.words.strip()}{meant(each.words.strip(), self._ids.ids)}")
            self._open.clear()
            self._links = 0
        self._is_heading = self._is_row = self._is_item = False
        self._is_line_start = True

    def _bar(self, found: Found) -> None:
        """Take a border of a cell: a pause, if words stand before it."""
        if self._is_row:
            self._break(found, ",")
        self._spaces(found)

    def _of_fence(self, first: str) -> "Iterator[Rule]":
        if self._is_line_start:
            yield regex.compile(rf"[ \t]*{self._fence}{self._fence[0]}*[ \t]*\n"), Reader._ends_fence
        yield (_NEWLINE, Reader._newline) if first == "\n" else (_LINE_OF_CODE, Reader._code_line)

    def _ends_fence(self, found: Found) -> None:
        self._fence = ""
        self._break(found)

    def _code_line(self, found: Found) -> None:
        self._is_line_start = False
        self._literally(*found.span())

    # -- within lines ---------------------------------------------------------------------------------------------

    def _says(self, found: Found) -> None:
        self._say(found[0], found.start(), len(found[0]))

    def _code(self, found: Found) -> None:
        self._literally(*found.span("code"))
        for each in self._ids.folded.finditer(f"{found['code']} "):
            self._leave("bracket", each[0])

    def _escaped(self, found: Found) -> None:
        self._literally(found.end() - 1, found.end())

    def _entity(self, found: Found) -> bool:
        character = unescape(found[0])
        for each in character if character != found[0] else "":
            self._character(each, found.start(), len(found[0]), is_literal=True)
        return character != found[0]

    def _address(self, found: Found) -> None:
        """Take an address such as `https://example.org/page`: its host is said, for a person can remember that."""
        begin, end = found.span("address")
        address = found["address"].lower()
        if address.startswith("mailto:") or ("@" in address and "/" not in address):
            begin += len("mailto:") * address.startswith("mailto:")
            self._literally(begin, begin + len(self._text[begin:end].partition("?")[0]))
        elif (host := _HOST.match(self._text, begin, end)) is not None:
            self._literally(*host.span("host"))
            self._leave("address", found["address"])

    def _sign(self, found: Found) -> None:
        before = self._text[found.start() - 1]
        if found[0] == "*" and self._has_stars and before.isspace() and not self._last.isdigit():
            self._break(found)  # XML makes one line of a list: `* star * moon`
        else:
            self._says(found)

    def _acted(self, found: Found) -> bool:
        is_fresh = not self._last or self._last in _FRESH
        if is_direction := is_fresh and not (found["small"] and found["other"]):
            self._directed(found)
        return is_direction

    def _directed(self, found: Found) -> None:
        self._leave("direction", found[0])

    def _cited(self, found: Found) -> None:
        self._leave("citation", found[0].partition("(")[0])
        self._was_index = False

    # -- brackets -------------------------------------------------------------------------------------------------

    def _is_index(self, at: int) -> bool:
        return _INDEX.match(self._text, at) is not None or (self._text[at - 1] == "]" and self._was_index)

    def _refer(self, found: Found) -> bool:
        id, is_other = found["id"], not self._ids.is_unknown and found["id"] not in self._ids.ids
        if is_other:
            id = in_other_letters(id, self._ids.ids)
        if not id or (self._ids.is_unknown and self._is_index(found.start())):
            return False
        if is_other:
            self._leave("case", self._text[found.start() : found.end("certain") + 1])
        begin = self._offset + found.start()
        self._found.append(Piece("refer", id, begin, begin + len(found[0]), certain=bool(found["certain"])))
        self._last, self._has_paragraph, self._is_item = "]", True, False
        return True

    def _defined(self, found: Found) -> None:
        self._leave("definition", f"[{found['label']}]")

    def _opens(self, found: Found) -> None:
        is_index = self._is_index(found.start())
        if is_index:
            self._spaces(found)
        self._open.append(_Bracket(is_index, is_image=_IMAGE.match(self._text, found.start() - 1) is not None))

    def _link(self, found: Found) -> bool:
        if (is_link := len(self._open) > self._links) and not self._pop().is_image:
            self._links = len(self._open)
        return is_link

    def _label(self, found: Found) -> bool:
        """Take `][label]`, unless it is an index or a reference of its own."""
        is_label = bool(self._open) and not self._open[-1].is_index
        if not self._ids.is_unknown and self._ids.exact.match(f"{found[0][1:]} ") is not None:
            is_label = False
        if is_label:
            self._pop()
        return is_label

    def _closes(self, found: Found) -> None:
        """Take `]` behind words that are no link."""
        if not self._open:
            self._spaces(found)
            return
        bracket = self._pop()
        words = bracket.words.strip()
        self._leave("bracket", f"[{words}]{meant(words, self._ids.ids)}")
        after = self._text[found.end()]
        if after.isalnum() or (bracket.is_index and after not in _CLOSING):
            self._spaces(found)

    def _pop(self) -> "_Bracket":
        bracket = self._open.pop()
        self._was_index = bracket.is_index
        self._links = min(self._links, len(self._open))
        self._note(bracket.words)
        return bracket

    def _note(self, words: str) -> None:
        if self._open and len(self._open[-1].words) < _WORDS:
            self._open[-1].words += words

    # -- elements -------------------------------------------------------------------------------------------------

    def _tag(self, found: Found) -> None:
        name = found["name"].rpartition(":")[2].lower()
        if name in mark.BLOCKS:
            self._spaces(found)
            self._break(found)
        is_thought = name in mark.THOUGHTS and not found[0].startswith("</") and not found[0].endswith("/>")
        self._element = name if is_thought else ""
        self._leave("thought" if is_thought else "tag", f"<{name}>" if is_thought else found[0])

    def _of_element(self, first: str) -> "Iterator[Rule]":
        if first == "<":
            yield regex.compile(rf"(?i)</(?:[\w-]+:)?{self._element}\s*>"), Reader._ends_element
        yield _CONTENT, Reader._skips

    def _ends_element(self, found: Found) -> None:
        self._element = ""


Take = Callable[[Reader, Found], bool | None]
"""What is done with a mark; False: it is none here."""
Rule = tuple["regex.Pattern[str]", Take]


def _table(*rules: tuple[str, str, Take]) -> dict[str, list[Rule]]:
    """Rules by the first characters of their marks, in order."""
    table: dict[str, list[Rule]] = {}
    for firsts, pattern, take in rules:
        compiled = regex.compile(
            pattern, **{name: words for name, words in LISTS.items() if rf"\L<{name}>" in pattern}
        )
        for first in firsts:
            table.setdefault(first, []).append((compiled, take))
    return table


_LINE = _table(
    (" \t", r"[ \t]", Reader._spaces),
    (">", ">", Reader._skips),
    ("`~", mark.FENCE, Reader._begins_fence),
    ("-_*=|:", mark.RULE, Reader._break),
    ("#", mark.HEADING, Reader._begins_heading),
    ("-+*", mark.BULLET, Reader._bullet),
    (digits, mark.NUMBER, Reader._number),
)
_INLINE = _table(
    ("\n", r"\n", Reader._newline),
    (" ", mark.BEFORE_UNSAID, Reader._skips),
    ("\\", rf"\\{mark.PUNCTUATION}", Reader._escaped),
    ("\\", r"\\(?=\n)", Reader._skips),
    ("&", mark.ENTITY, Reader._entity),
    ("`", mark.CODE, Reader._code),
    ("`", "`+(?=[^`])", Reader._skips),
    ("*_", mark.SIGN, Reader._sign),
    ("*_", mark.IN_STARS, Reader._acted),
    ("*", r"\*+(?=[^*])", Reader._skips),
    ("_", "_+(?=[^_])", Reader._skips),
    ("~", "~~+(?=[^~])", Reader._skips),
    ("#", mark.HEADING_ENDS, lambda reader, found: reader._is_heading),
    ("|", mark.ROWS, Reader._break),
    ("|", r"\|", Reader._bar),
    ("!", mark.IMAGE, Reader._skips),
    ("(", mark.IN_ROUND, Reader._directed),
    ("【", mark.SOURCE, Reader._cited),
    ("<", mark.COMMENT, Reader._skips),
    ("<", mark.TOKEN, Reader._skips),
    ("<", mark.HIDDEN, Reader._skips),
    ("<", mark.TAG, Reader._tag),
    ("<", mark.AUTOLINK, Reader._address),
    ("[", mark.TASK, lambda reader, found: reader._is_item),
    ("[", mark.DEFINITION, Reader._defined),
    ("[", mark.FOOTNOTE, Reader._cited),
    ("[", mark.CITATION, Reader._cited),
    ("[", mark.IN_SQUARE, Reader._directed),
    ("]", mark.LINK, Reader._link),
    ("]", mark.LABEL, Reader._label),
    ("]", r"\](?=[\s\S])", Reader._closes),
    ("hwfmtHWFMT", mark.ADDRESS, Reader._address),
    ("hwfmtHWFMT", mark.PLAIN, Reader._says),
)
_PLAIN = _table((".", mark.PLAIN, Reader._says))["."]
_OPENING, _NEWLINE, _LINE_OF_CODE, _CONTENT = map(regex.compile, (r"\[", r"\n", r"[^\n]+", r"<|[^<]+"))
_HOST, _INDEX, _IMAGE, _PUNCTUATION = map(regex.compile, (mark.HOST, mark.INDEX, mark.IMAGE, mark.PUNCTUATION))
