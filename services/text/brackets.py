"""Brackets of a text: references to objects, links, citations, stage directions, or words."""

import re

from engage_hri.schemas.speakable import UNSPACED
from engage_hri.schemas.suggestion import suggestion
from engage_hri.services.text import patterns as mark
from engage_hri.services.text.acts import is_direction, may_be_direction
from engage_hri.services.text.patterns import is_silent
from engage_hri.services.text.pieces import Ids, Piece, Reason

_GUESS = re.compile(r"(?P<id>[^\s!]+)(?P<certain>!?)\Z")
"""What is taken for a reference where nobody knows the world."""
_UNSPACED = re.compile(f"[{UNSPACED}]")
_FRESH = frozenset(".!?…。！？:\n")


class _Opened:
    """An open bracket. is_index: a word stands before it. text: the words in it, as far as they are told."""

    __slots__ = ("is_index", "text")

    def __init__(self, *, is_index: bool) -> None:
        self.is_index = is_index
        self.text = ""


class Brackets:
    """The part of the reader that writes pieces, and knows brackets."""

    def __init__(self) -> None:
        self._held = ""
        """Text that is not decided."""
        self._begin = 0
        """Characters of the author's text before it."""
        self._offset = 0
        self._before = "\n"
        """The character before, as it is written."""
        self._last = ""
        """The last character that is said, but for white space."""
        self._second = "\n"
        """The character before that one."""
        self._is_line_start = True
        self._is_item = self._is_row = self._has_paragraph = False
        self._ids = Ids(())
        self._is_over = False
        self._found: list[Piece] = []
        self._open: list[_Opened] = []
        self._was_index = False
        """True if the bracket that closed last had a word before it: `array[0][1]`."""
        self._dead = 0
        """Number of open brackets that can be no link, for a link holds no other link."""

    # -- writing --------------------------------------------------------------------------------------------------

    def _say(self, text: str, at: int, size: int) -> None:
        """Say characters. at: their place in the text at hand. size: characters that they take up there."""
        begin = self._offset + at
        self._found.append(Piece("say" if len(text) == size else "symbol", text, begin, begin + size))
        if self._open and len(self._open[-1].text) < mark.BRACKET:
            self._open[-1].text += text
        if not text.isspace():
            self._last = text[-1]
            self._has_paragraph, self._is_item = True, False

    def _character(self, character: str, at: int, size: int = 1, *, is_literal: bool = False) -> None:
        """Say one character, or a space in place of an emoji. is_literal: it is no mark, whatever it looks like."""
        begin = self._offset + at
        if is_silent(character):
            self._found.append(Piece("silent", character, begin, begin + size))
            return
        text = " " if character.isspace() else character
        if is_literal and text in mark.PUNCTUATION:
            self._found.append(Piece("symbol", text, begin, begin + size))
            self._last = text
        else:
            self._say(text, at, size)

    def _literal(self, text: str, at: int) -> int:
        self._say(text[at], at, 1)
        return 1

    def _break(self, at: int) -> None:
        place = self._offset + at
        self._found.append(Piece("break", "", place, place))
        self._last = ""

    def _leave(self, reason: Reason, text: str) -> None:
        self._found.append(Piece("left", text, self._begin, self._begin, reason))

    def _directed(self, text: str, at: int, close: int) -> int:
        self._leave("direction", text[at : close + 1])
        return close + 1 - at

    @property
    def _is_fresh(self) -> bool:
        """True if a sentence may begin here."""
        return not self._last or self._last in _FRESH or self._last in "\"'”’»)"

    @property
    def _is_in_word(self) -> bool:
        """True if the character before belongs to a word of a script with spaces."""
        return self._before.isalnum() and not _UNSPACED.match(self._before)

    @property
    def _is_operand(self) -> bool:
        """True if a single letter stands before: `a*b`."""
        return not self._second.isalnum()

    # -- brackets -------------------------------------------------------------------------------------------------

    def _opens(self, text: str, at: int) -> int | None:
        """Take `[`, with what it means if that is no words: a reference, a citation, a direction, a definition."""
        named = self._ids.named(text, at + 1)
        may_be_longer = not self._is_over and self._ids.may_name(text, at + 1)
        if may_be_longer:
            return None
        if named is not None:
            id, is_certain, end = named
            if not text.startswith(id, at + 1):
                self._leave("case", text[at:end])
            return self._refer(id, at, end, certain=is_certain)
        is_index = self._is_in_word or self._before == "_" or (self._before == "]" and self._was_index)
        inside = mark.INSIDE.match(text, at)
        if inside is None:
            return None if self._waits_for_bracket(text, at, is_index=is_index) else self._push(at, is_index=is_index)
        end, content = inside.end(), inside["inside"]
        after = text[end : end + 1]
        is_line_start = self._before == "\n" or self._is_item
        if not after and not self._is_over:
            return None
        if self._is_item and content in ("x", "X", " ") and after.isspace():
            return end - at  # a task that is done, or not
        if is_line_start and after == ":" and (used := self._defined(text, end, content)) != 0:
            return None if used is None else end - at + used
        if mark.FOOTNOTE.match(content):
            self._leave("citation", inside[0])
            return end - at + (is_line_start and after == ":")
        if mark.CITATION.match(content) and not is_index:
            return self._citation(text, at, end)
        if after != "(" and not is_index and is_direction(content, "["):
            return self._directed(text, at, end - 1)
        if self._ids.is_unknown and not is_index and after != "(" and (guess := _GUESS.match(content)) is not None:
            return self._refer(guess["id"], at, end, certain=bool(guess["certain"]))
        return self._push(at, is_index=is_index)

    def _refer(self, id: str, at: int, end: int, *, certain: bool) -> int:
        self._found.append(Piece("refer", id, self._offset + at, self._offset + end, certain=certain))
        self._last, self._has_paragraph, self._is_item = "]", True, False
        return end - at

    def _citation(self, text: str, at: int, end: int) -> int | None:
        """Take a citation, with its address if it is a link."""
        rest = text[end : end + mark.LOOK]
        link = mark.LINK.match(rest)
        if link is None and not self._is_over and len(rest) < mark.LOOK and mark.LINK_BEGUN.match(rest):
            return None
        self._leave("citation", text[at:end])
        self._was_index = False
        return end - at + (link.end() if link is not None else 0)

    def _waits_for_bracket(self, text: str, at: int, *, is_index: bool) -> bool:
        """Tell whether what is known of the inside of a bracket may become more than words."""
        inside = text[at + 1 : at + 2 + mark.BRACKET]
        if self._is_over or len(inside) > mark.BRACKET or any(each in "[]\n" for each in inside):
            return False
        is_line_start = self._before == "\n" or self._is_item
        if not inside or is_line_start or inside[0] == "^" or inside[0].isdigit():
            return True
        if self._ids.is_unknown and not is_index and not any(map(str.isspace, inside)):
            return True
        return not is_index and may_be_direction(inside, "[")

    def _push(self, at: int, *, is_index: bool) -> int:
        if is_index:
            self._say(" ", at, 1)
        self._open.append(_Opened(is_index=is_index))
        return 1

    def _defined(self, text: str, end: int, content: str) -> int | None:
        """Take the rest of a definition such as `[1]: https://example.org`; 0: there is none."""
        rest = text[end : end + mark.LOOK]
        if "\n" not in rest[1:] and not self._is_over and len(rest) < mark.LOOK:
            return None
        found = mark.DEFINITION.match(rest)
        if found is None or content.startswith("^") or not content.strip():
            return 0
        self._leave("definition", f"[{content}]")
        return found.end()

    def _closes(self, text: str, at: int) -> int | None:
        """Take `]`, with the address if what stood in the brackets is a link."""
        if not self._open:
            self._say(" ", at, 1)
            return 1
        after = text[at + 1 : at + 2]
        if not after and not self._is_over:
            return None
        opened = self._open[-1]
        rest = text[at + 1 : at + 1 + mark.LOOK]
        if after == "(" and len(self._open) > self._dead:
            link = mark.LINK.match(rest)
            if link is not None:
                self._pop()
                self._dead = len(self._open)
                return 1 + link.end()
            if not self._is_over and len(rest) < mark.LOOK and mark.LINK_BEGUN.match(rest):
                return None
        if after == "[" and not opened.is_index:
            label = mark.INSIDE.match(rest)
            if self._ids.named(rest, 1) is None:
                if label is not None:
                    self._pop()
                    return 1 + label.end()
                if not self._is_over and len(rest) <= mark.BRACKET and not any(each in "[]\n" for each in rest[1:]):
                    return None
        self._pop()
        words = opened.text.strip()
        hint = suggestion(words, self._ids.ids) if self._ids.ids else ""
        self._leave("bracket", f"[{words}]{f' ({hint})' if hint.startswith('did you mean') else ''}")
        if opened.is_index or after.isalnum():
            self._say(" ", at, 1)
        return 1

    def _pop(self) -> None:
        popped = self._open.pop()
        inner, self._was_index = popped.text, popped.is_index
        self._dead = min(self._dead, len(self._open))
        if self._open and len(self._open[-1].text) < mark.BRACKET:
            self._open[-1].text += inner
