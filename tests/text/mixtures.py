"""Random texts with marks and references, and what of them is to be said: the oracle of the text front end.

The plain text comes from markdown-it-py, a parser of CommonMark that reads the document as a whole. What is listed in
docs/language-models.md as unspoken does not stand in the text that it is given; so nothing here knows how our reader
decides.
"""

from random import Random
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.token import Token

OBJECTS = ("cup", "blue square", "cup!", "a[b]", "x1", "Blue-Box")
_PARSER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
_WORDS = [
    "one",
    "two",
    "three",
    "Four",
    "five,",
    "six.",
    "Seven",
    "eight!",
    "nine?",
    "ten",
    "it's",
    "e.g.",
    "3.5",
    "the",
    "Größe",
    "方块",
    "мир",
    "snake_case",
    "C#",
    "#1",
    "x_1",
]


class Mixture(NamedTuple):
    """A text, the one that the oracle reads, and the objects that are named, in order."""

    text: str
    plain: str
    named: tuple[str, ...]


def letters(text: str) -> str:
    return "".join(each for each in text if each.isalnum())


def plain_text(markdown: str) -> str:
    """The text of a document, with the numbers of its items."""
    return "".join(_texts(_PARSER.parse(markdown)))


def _texts(tokens: list[Token]) -> list[str]:
    found: list[str] = []
    for token in tokens:
        if token.type == "list_item_open" and token.info:
            found.append(f" {token.info} ")
        elif token.type in ("text", "code_inline", "fence", "code_block"):
            found.append(token.content)
        elif token.type == "image":
            found += _texts(token.children or [])
        elif token.children:
            found += _texts(token.children)
        found.append(" " if token.block or token.type in ("softbreak", "hardbreak") else "")
    return found


class Maker:
    """Maker of mixtures. Each part returns what is written, and what the oracle is to see of it."""

    def __init__(self, random: Random, *, with_references: bool = True) -> None:
        self.random = random
        self.with_references = with_references
        self.named: list[str] = []

    def mixture(self) -> Mixture:
        self.named = []
        blocks = [self.block() for _ in range(self.random.randint(1, 6))]
        return Mixture("\n\n".join(a for a, _ in blocks), "\n\n".join(b for _, b in blocks), tuple(self.named))

    def words(self, most: int = 5) -> tuple[str, str]:
        text = " ".join(self.random.choices(_WORDS, k=self.random.randint(1, most)))
        return text, text

    def wrapped(self, before: str, after: str) -> tuple[str, str]:
        written, seen = self.inline(2)
        return f"{before}{written}{after}", f"{before}{seen}{after}"

    def atom(self) -> tuple[str, str]:
        pick = self.random.random()
        if pick < 0.40:
            return self.words()
        simple = [
            ("5 * 3", "5 * 3"), ("a < b", "a < b"), ("5 - 3", "5 - 3"), ("3 > 2", "3 > 2"), ("2^3", "2^3"),
            ("~5", "~5"),
            ("[1]", ""), ("[^2]", ""), ("【1†source】", ""), ("[2, 3]", ""), ("[laughs]", ""), ("(sighs)", ""),
            ("[smiles warmly]", ""), ("😊", ""), ("👍🏽", ""), ("<think>so I think\n\nthat</think>", ""),
            ("https://www.example.com/a/b?c=d", "example.com"), ("ann@example.org", "ann@example.org"),
            ("<https://example.net/x>", "example.net"), ("array[0]", "array 0"), ("[sic]", "sic"), ("[x]", "x"),
            ("<b>", ""), ("</b>", ""), ('<speed ratio="1.05"/>', ""), ("caf&eacute;", "café"), ("&amp;", "&"),
            ("\\*", "\\*"), ("\\[sic\\]", "\\[sic\\]"), ("H<sub>2</sub>O", "H2O"), ("2 ** 8", "2 ** 8"),
        ]  # fmt: skip
        if pick < 0.65:
            return self.random.choice(simple)
        if pick < 0.75 and self.with_references:
            id = self.random.choice(OBJECTS)
            self.named.append(id)
            return f"[{id}{'!' if self.random.random() < 0.2 and id != 'cup' else ''}]", ""
        if pick < 0.85:
            mark = self.random.choice(["*", "**", "***", "_", "__", "~~"])
            return self.wrapped(mark, mark)
        if pick < 0.92:
            code = self.random.choice(
                [
                    "ls -l",
                    "a*b*c",
                    "x[0]",
                    "<b>",
                    "[laughs]",
                    "f(x)",
                    "**no**",
                    "https://example.org/a?b",
                    "www.x.org/y",
                ]
            )
            return f"`{code}`", f"`{code}`"
        words, seen = self.words(3)
        return self.random.choice(
            [(f"[{words}](https://example.com/p)", f"[{seen}](/u)"), (f"![{words}](a.png)", f"![{seen}](/u)"),
             (f"[{words}](<a b> 'title')", f"[{seen}](/u)"),
             (f"[![{words}](a.png)](https://example.com/p)", f"[![{seen}](/u)](/u)"),
             (f"[{words} ![{words}](a.png)](/u 'title') ", f"[{seen} ![{seen}](/u)](/u) ")]
        )  # fmt: skip

    def inline(self, most: int = 6) -> tuple[str, str]:
        parts = [self.words(2), *(self.atom() for _ in range(self.random.randint(0, most))), self.words(2)]
        return " ".join(a for a, _ in parts), " ".join(b for _, b in parts)

    def block(self) -> tuple[str, str]:
        kind = self.random.randint(0, 8)
        if kind == 0:
            return self.wrapped("#" * self.random.randint(1, 6) + " ", self.random.choice(["", " ##"]))
        if kind == 1:
            bullet = self.random.choice("-*+")
            items = [self.inline(2) for _ in range(self.random.randint(1, 4))]
            return tuple("\n".join(f"{bullet} {each[at]}" for each in items) for at in (0, 1))  # type: ignore[return-value]
        if kind == 2:
            items = [self.inline(2) for _ in range(self.random.randint(1, 4))]
            return tuple("\n".join(f"{n}. {each[at]}" for n, each in enumerate(items, 1)) for at in (0, 1))  # type: ignore[return-value]
        if kind == 3:
            return self.wrapped("> ", "")
        if kind == 4:
            code = "\n".join(self.random.choices(["x = [1]", "if a < b:", "# no heading", "**y**", "", "<b>"], k=3))
            fence = self.random.choice(["```python", "~~~", "````"])
            text = f"{fence}\n{code}\n{fence[:3] if fence != '````' else fence}"
            return text, text
        if kind == 5:
            cells = [self.words(2) for _ in range(4)]
            table = "| {} | {} |\n|:--|---|\n| {} | {} |".format(*(a for a, _ in cells))
            return table, table
        if kind == 6:
            a, b = self.inline(3), self.inline(3)
            return f"{a[0]}\n{b[0]}", f"{a[1]}\n{b[1]}"
        if kind == 7:
            return self.wrapped("", "\n===")
        return self.inline()
