"""Reader of a text that comes bit by bit: it finds what is for the ear, and leaves out what is for the eye alone.

The marks are those of CommonMark, with tables, footnotes and strikethrough as GitHub has them, and of HTML. A parser
of CommonMark reads a document as a whole: whether `*` begins an emphasis depends on how the paragraph ends. For a
voice that makes no difference, and it cannot wait: an asterisk beside a word is not said in either case. So what
stands beside a mark decides it, and text is held back only where letters depend on what comes: in `[`, `<`, a code
span, an address, and at the beginning of a line. tests/text compares the letters with those that a parser finds.

    reader = Reader()
    pieces = [*reader.feed("See [the d", ids), *reader.feed("ocs](https://example.org).", ids), *reader.finish(ids)]

Each step takes the text at one place and says how many characters it has used up, or `None` if more must be known.
No mark is longer than a bound, so that reading takes time in proportion to the text, whatever it is.
"""

import re
from collections.abc import Callable
from html import unescape

from engage_hri.services.text import patterns as mark
from engage_hri.services.text.acts import is_direction, may_be_direction
from engage_hri.services.text.brackets import Brackets
from engage_hri.services.text.pieces import Ids, Piece

NO_IDS = Ids(())
_SPACES = re.compile(r"[ \t]+")
_BLANK_LINE = re.compile(r"\n[ \t]*\n")


class Reader(Brackets):
    """The state of reading, from one bit of the text to the next."""

    def __init__(self) -> None:
        super().__init__()
        self._element = ""
        """The element of which the content is not said, and that has not been closed."""
        self._element_begins = 0
        self._fence = ""
        """The fence that began a block of code; empty: there is none."""
        self._is_heading = self._is_list = False
        self._has_stars = False
        """True within a list with the bullet `*`."""
        self._steps: dict[str, Callable[[str, int], int | None]] = {
            "\n": self._newline, "\\": self._backslash, "&": self._entity, "`": self._code, "*": self._star,
            "_": self._star, "~": self._tilde, "<": self._tag, "[": self._opens, "]": self._closes, "(": self._paren,
            "!": self._bang, "|": self._bar, "【": self._source, "#": self._hash,
        }  # fmt: skip

    def feed(self, text: str, ids: Ids = NO_IDS) -> list[Piece]:
        """Take more of the text; returns the pieces that are certain now. ids: of the objects that there are now."""
        return self._read(text, ids, is_over=False)

    def finish(self, ids: Ids = NO_IDS) -> list[Piece]:
        """Take the end of the text; returns all that is left of it."""
        return self._read("", ids, is_over=True)

    def _read(self, text: str, ids: Ids, *, is_over: bool) -> list[Piece]:
        self._ids, self._is_over, self._found = ids, is_over, []
        text = self._held + text
        at = 0
        while at < len(text):
            self._offset = self._begin - at
            used = self._step(text, at)
            if used is None:
                break
            self._begin += used
            at += used
            if used:
                self._second = text[at - 2] if used > 1 else self._before
                self._before = text[at - 1]
        self._held = text[at:]
        if is_over and self._element in mark.THOUGHTS:
            self._leave("thought", f"<{self._element}>")
            self._element = ""
        return self._found

    def _step(self, text: str, at: int) -> int | None:
        if self._element:
            return self._unsaid(text, at)
        if self._fence:
            return self._fenced(text, at)
        if self._is_line_start and (used := self._begin_line(text, at)) != 0:
            return used
        step = self._steps.get(text[at])
        if step is not None:
            return step(text, at)
        return self._words(text, at)

    # -- lines ----------------------------------------------------------------------------------------------------

    def _begin_line(self, text: str, at: int) -> int | None:
        """Take a mark at the beginning of a line; 0: there is none, and the line has begun."""
        if (spaces := _SPACES.match(text, at)) is not None:
            self._say(" ", at, len(spaces[0]))
            return len(spaces[0])
        first = text[at]
        if first == "\n":
            return 0
        line_ends = text.find("\n", at, at + mark.LOOK)
        is_whole = line_ends >= 0 or self._is_over
        if first == ">":
            return 1
        if (first in "`~" and text.startswith(first * 2, at)) or (first in "`~" and len(text) - at < 3):
            if not is_whole and len(text) - at < 3:
                return None if not text[at:].strip(first) else 0
            if (fence := mark.FENCE.match(text, at)) is not None:
                if not is_whole and len(text) - at < mark.LOOK:
                    return None
                self._fence = fence["fence"]
                self._break(at)
                return min(len(text), fence.end() + 1) - at
        if first in "-_*=|:" and (rule := self._rule(text, at, is_whole=is_whole)) != 0:
            return rule
        if first == "#" and (heading := self._heading(text, at)) != 0:
            return heading
        if (first in "-+*" or first.isdecimal()) and (item := self._item(text, at)) != 0:
            return item
        self._is_line_start = False
        if first == "|":
            self._is_row = True
        return 0

    def _rule(self, text: str, at: int, *, is_whole: bool) -> int | None:
        if (found := mark.RULE.match(text, at)) is not None and (is_whole or found.end() < len(text)):
            is_bullet = found[0].strip() == "-" and not self._has_paragraph
            if not is_bullet:
                self._break(at)
                return found.end() - at
        rest = text[at : at + mark.LOOK]
        if not is_whole and len(rest) < mark.LOOK and not rest.strip("-:| \t") and not rest.startswith("- "):
            return None
        if not is_whole and len(rest) < mark.LOOK and len(set(rest) - {" ", "\t"}) == 1 and rest[-1] in "-_*=":
            return None
        return 0

    def _heading(self, text: str, at: int) -> int | None:
        end = at + 1
        while end < len(text) and text[end] == "#":
            end += 1
        if end == len(text) and end - at <= 6 and not self._is_over:
            return None
        if (found := mark.HEADING.match(text, at)) is None:
            return 0
        self._break(at)
        self._is_heading, self._is_line_start = True, False
        return found.end() - at

    def _item(self, text: str, at: int) -> int | None:
        if (found := mark.ITEM.match(text, at)) is not None:
            if found["number"] is None:
                self._break(at)
                self._is_list = self._is_item = True
                self._has_stars = found[0] == "*"
                return found.end() - at
            if found["number"] == "1" or self._is_list or not self._has_paragraph:
                self._break(at)
                self._is_list = True
            self._is_line_start = False
            self._say(found[0], at, len(found[0]))
            return len(found[0])
        rest = text[at : at + 11]
        number = rest[:-1] if rest[-1] in ".)" else rest
        may_be = rest in "-+*" or (number.isdecimal() and len(number) < 10 and at + len(rest) == len(text))
        return None if may_be and not self._is_over else 0

    def _newline(self, text: str, at: int) -> int:
        is_blank = self._is_line_start
        self._say(" ", at, 1)
        if self._is_heading or self._is_row or is_blank:
            self._break(at)
        if is_blank:
            self._is_list = self._has_paragraph = self._has_stars = False
            self._open.clear()
            self._dead = 0
        self._is_heading = self._is_row = self._is_item = False
        self._is_line_start = True
        return 1

    def _hash(self, text: str, at: int) -> int | None:
        """Take `#`, which ends a heading as well as it begins one."""
        if self._is_heading and self._before in " \t":
            end = at
            while end < len(text) and text[end] in "# \t":
                end += 1
            if end == len(text) and not self._is_over and end - at < mark.LOOK:
                return None
            if end == len(text) or text[end] == "\n":
                return end - at
        return self._literal(text, at)

    def _fenced(self, text: str, at: int) -> int | None:
        line_ends = text.find("\n", at)
        if self._is_line_start:
            line = text[at:] if line_ends < 0 else text[at:line_ends]
            stripped = line.strip()
            if line_ends < 0 and not self._is_over and not stripped.strip(self._fence[0]) and len(line) < mark.LOOK:
                return None
            self._is_line_start = False
            if stripped.startswith(self._fence) and not stripped.strip(self._fence[0]):
                self._fence, self._is_line_start = "", True
                self._break(at)
                return len(line) + (line_ends >= 0)
        end = len(text) if line_ends < 0 else line_ends
        for place in range(at, end):
            self._character(text[place], place, is_literal=True)
        if line_ends >= 0:
            self._say(" ", end, 1)
            self._is_line_start = True
        return end - at + (line_ends >= 0)

    # -- within lines ---------------------------------------------------------------------------------------------

    def _words(self, text: str, at: int) -> int | None:
        if text[at] in "hwfmtHWFMT" and not self._before.isalnum() and self._before not in ("_", "@", "."):
            used = self._address(text, at)
            if used != 0:
                return used
        if (plain := mark.PLAIN.match(text, at)) is not None:
            self._say(plain[0], at, len(plain[0]))
            return len(plain[0])
        self._character(text[at], at)
        return 1

    def _address(self, text: str, at: int) -> int | None:
        """Take an address such as `https://example.org/page`: its host is said: a person can remember that."""
        begun = text[at : at + 8].lower()
        if not self._is_over and any(each.startswith(begun) for each in mark.SCHEMES):
            return None
        if not begun.startswith(mark.SCHEMES) or (found := mark.ADDRESS.match(text, at)) is None:
            return 0
        if found.end() == len(text) and not self._is_over and found.end() - at < 2 * mark.LOOK:
            return None
        address = found[0].rstrip(".,;:!?'_~&")
        while address.endswith(")") and address.count(")") > address.count("("):
            address = address[:-1].rstrip(".,;:!?'_~&")
        self._say_address(address, at)
        return len(address)

    def _say_address(self, address: str, at: int) -> None:
        is_mail = address.lower().startswith("mailto:") or ("@" in address and "/" not in address)
        begin = len("mailto:") if address.lower().startswith("mailto:") else 0
        host = mark.HOST.match(address)
        assert host is not None
        said = (begin, len(address.partition("?")[0])) if is_mail else host.span("host")
        for place in range(*said):
            self._character(address[place], at + place, is_literal=True)
        if not is_mail:
            self._leave("address", address)

    def _backslash(self, text: str, at: int) -> int | None:
        if at + 1 == len(text) and not self._is_over:
            return None
        after = text[at + 1 : at + 2]
        if after in mark.PUNCTUATION and after:
            self._character(after, at + 1, is_literal=True)
            return 2
        if after == "\n":
            return 1
        self._say("\\", at, 1)
        return 1

    def _entity(self, text: str, at: int) -> int | None:
        if (found := mark.ENTITY.match(text, at)) is not None and (meant := unescape(found[0])) != found[0]:
            for each in meant:
                self._character(each, at, len(found[0]), is_literal=True)
            return len(found[0])
        if not self._is_over and mark.ENTITY_BEGUN.match(text, at):
            return None
        return self._literal(text, at)

    def _code(self, text: str, at: int) -> int | None:
        end = at
        while end < len(text) and text[end] == "`":
            end += 1
        if end == len(text) and not self._is_over and end - at < mark.LOOK:
            return None
        run = text[at:end]
        limit = min(len(text), end + mark.LOOK)
        if (blank := _BLANK_LINE.search(text, end, limit)) is not None:
            limit = blank.start()
        close = end
        while (close := text.find(run, close, limit)) >= 0:
            after = close + len(run)
            if after == len(text) and not self._is_over:
                return None
            if text[after : after + 1] != "`":
                for place in range(end, close):
                    self._character(text[place], place, is_literal=True)
                return after - at
            while after < limit and text[after] == "`":
                after += 1
            close = after
        if not self._is_over and blank is None and len(text) - end < mark.LOOK:
            return None
        return end - at

    def _star(self, text: str, at: int) -> int | None:
        """Take a run of `*` or `_`: a sign if it stands between operands, a part of a name, or else a mark."""
        end = at
        while end < len(text) and text[end] == text[at]:
            end += 1
        if end == len(text) and not self._is_over and end - at < mark.LOOK:
            return None
        size, before, after = end - at, self._before, text[end : end + 1]
        is_word = before.isalnum() and after.isalnum()
        if text[at] == "_":
            is_sign = is_word
        else:
            is_calculated = size <= 2 and (before.isdigit() or after.isdigit() or self._is_operand)
            is_sign = (before.isspace() and after.isspace() and size <= 2) or (is_word and is_calculated)
            is_sign = is_sign or (before == ")" and after == "(" and size <= 2)
        if is_sign and self._has_stars and size == 1 and before.isspace() and not self._last.isdigit():
            # XML makes one line of a list: `* star * moon`.
            self._break(at)
            return size
        if is_sign:
            self._say(text[at:end], at, size)
            return size
        if size == 1 and self._is_fresh and after and not after.isspace() and not before.isalnum():
            return self._acted(text, at, end)
        return size

    def _acted(self, text: str, at: int, begin: int) -> int | None:
        """Take a stage direction such as `*waves*`; else the mark alone."""
        close = text.find(text[at], begin, begin + mark.BRACKET)
        if close < 0:
            is_held = not self._is_over and len(text) - begin < mark.BRACKET
            return None if is_held and may_be_direction(text[begin:], "*") else 1
        if is_direction(text[begin:close], "*"):
            rest = text[close + 1 : close + 1 + mark.BRACKET]
            if not rest.lstrip() and not self._is_over and "\n" not in rest and len(rest) < mark.BRACKET:
                return None
            if (not rest or rest[0].isspace() or rest[0] in ".,!…") and not rest.lstrip()[:1].islower():
                return self._directed(text, at, close)
        return 1

    def _tilde(self, text: str, at: int) -> int | None:
        if at + 1 == len(text) and not self._is_over:
            return None
        end = at
        while end < len(text) and text[end] == "~":
            end += 1
        if end == at + 1:
            return self._literal(text, at)
        return end - at

    def _paren(self, text: str, at: int) -> int | None:
        """Take `(`, with a stage direction such as `(sighs)` if there is one."""
        if not self._before.isalnum():
            close = text.find(")", at, at + mark.BRACKET)
            if close >= 0 and is_direction(text[at + 1 : close], "("):
                return self._directed(text, at, close)
            is_held = close < 0 and not self._is_over and len(text) - at < mark.BRACKET
            if is_held and may_be_direction(text[at + 1 :], "("):
                return None
        return self._literal(text, at)

    def _bang(self, text: str, at: int) -> int | None:
        """Take `!`, which is no exclamation before an image."""
        if at + 1 == len(text) and not self._is_over:
            return None
        if text.startswith("[", at + 1) and not self._before.isalnum():
            return 1
        return self._literal(text, at)

    def _bar(self, text: str, at: int) -> int:
        """Take a border of a cell: a pause, if words stand before it."""
        if self._is_row:
            place = self._offset + at
            self._found.append(Piece("break", ",", place, place + 1))
        self._say(" ", at, 1)
        return 1

    def _source(self, text: str, at: int) -> int | None:
        if (found := mark.SOURCE.match(text, at)) is not None:
            self._leave("citation", found[0])
            return len(found[0])
        if not self._is_over and mark.SOURCE_BEGUN.match(text, at):
            return None
        return self._literal(text, at)

    # -- tags -----------------------------------------------------------------------------------------------------

    def _tag(self, text: str, at: int) -> int | None:
        rest = text[at : at + mark.LOOK]
        if len(rest) == 1 and not self._is_over:
            return None
        if not (rest[1:2].isascii() and rest[1:2].isalpha()) and rest[1:2] not in ("/", "!", "?"):
            return self._literal(text, at)
        if rest[1] in "!?":
            return self._comment(text, at, rest)
        if (link := mark.AUTOLINK.match(rest)) is not None:
            self._say_address(link["address"], at + 1)
            return link.end()
        if (tag := mark.TAG.match(rest)) is not None:
            self._take_tag(tag, at)
            return tag.end()
        if not self._is_over and len(rest) < mark.LOOK:
            if mark.AUTOLINK_BEGUN.match(rest):
                return None
            if mark.TAG_BEGUN.match(rest) and not mark.SENTENCE_IN_TAG.match(rest):
                return None
        return self._literal(text, at)

    def _take_tag(self, tag: "re.Match[str]", at: int) -> None:
        name = (tag["name"] or tag["closed"]).rpartition(":")[2].lower()
        if name in mark.BLOCKS:
            self._say(" ", at, len(tag[0]))
            self._break(at)
        if name in mark.THOUGHTS or (tag["name"] and name in mark.UNSAID):
            if tag["name"] and not tag[0].endswith("/>"):
                self._element = name
            return
        self._leave("tag", tag[0])

    def _comment(self, text: str, at: int, rest: str) -> int | None:
        for opening, closing in (("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")):
            if rest.startswith(opening):
                if opening == "<!" and not rest[2:3].isalpha():
                    break
                close = rest.find(closing, len(opening))
                if close >= 0:
                    return close + len(closing)
                return None if not self._is_over and len(rest) < mark.LOOK else self._literal(text, at)
        if not self._is_over and any(each.startswith(rest) for each in ("<!--", "<![CDATA[")):
            return None
        return self._literal(text, at)

    def _unsaid(self, text: str, at: int) -> int | None:
        """Skip the content of an element up to its end."""
        closing = re.compile(rf"</(?:[\w-]+:)?{self._element}\s*>", re.IGNORECASE).search(text, at)
        if closing is None:
            keep = text.rfind("<", max(at, len(text) - mark.BRACKET))
            end = len(text) if keep < 0 or self._is_over else keep
            return end - at or None
        if self._element in mark.THOUGHTS:
            self._leave("thought", f"<{self._element}>")
        self._element = ""
        return closing.end() - at
