"""What README.md and docs/*.md show: fenced blocks and the commands in their sentences. Pure.

How each is to be run stands on the page itself: the language of a block, the file name that the paragraph before it
gives, and `$` before a command whose output follows.
"""

import ast
import builtins
import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from textwrap import dedent
from typing import NamedTuple

FENCE = re.compile(r"^( *)```([^\n`]*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
FILE = re.compile(r"`([\w-]+\.(\w+))`")
COMMAND = re.compile(r"(?:\.venv/bin/)?(?:engage|python|pip|make) \S")
PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b(?!=)|[\w-]\|[\w-]|\.\.\.|…")
"""`FILE`, `text|json` or an ellipsis: nobody can type it as it is."""


class Block(NamedTuple):
    """A fenced block. line: of its first line of text. name: the file that it is, if the page says so."""

    page: str
    line: int
    language: str
    text: str
    name: str = ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


class Span(NamedTuple):
    """A command within a sentence or a table."""

    page: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


class Shown(NamedTuple):
    """A command and the output that a page shows of it. output None: none is shown."""

    command: str
    output: str | None = None


def blocks(page: str, text: str) -> list[Block]:
    found = []
    for fence in FENCE.finditer(text):
        language, line = fence[2].strip(), text.count("\n", 0, fence.start(3)) + 1
        before = text[: fence.start()].rstrip().rpartition("\n\n")[2]
        names = [name for name, kind in FILE.findall(before) if kind == language]
        found.append(Block(page, line, language, dedent(fence[3]), names[-1] if names else ""))
    return found


def spans(page: str, text: str) -> list[Span]:
    outside = FENCE.sub(lambda fence: "\n" * fence[0].count("\n"), text)
    return [
        Span(page, outside.count("\n", 0, span.start()) + 1, span[1])
        for span in SPAN.finditer(outside)
        if COMMAND.match(span[1])
    ]


def is_complete(command: str) -> bool:
    """Can it be typed as it stands?"""
    return not PLACEHOLDER.search(command)


def commands(block: Block) -> list[Shown]:
    """Of a `sh` block each command, of a `console` block each with its output."""
    if block.language == "sh":
        lines, found = block.text.splitlines(), []
        while lines:
            command, lines = _first(lines)
            if shlex.split(command, comments=True):
                found.append(Shown(command))
        return found
    starts = [match.start() for match in re.finditer(r"^\$ ", block.text, re.MULTILINE)]
    parts = [_first(block.text[start + 2 : end].splitlines()) for start, end in pairwise([*starts, len(block.text)])]
    return [Shown(command, "".join(f"{line}\n" for line in output)) for command, output in parts]


def _first(lines: Sequence[str]) -> tuple[str, list[str]]:
    """The first command, and what follows. It goes on after a backslash, and until its quotes are closed."""
    for end in range(1, len(lines) + 1):
        command = "\n".join(lines[:end])
        with suppress(ValueError):
            shlex.split(command, comments=True)
            if not command.endswith("\\"):
                return command, list(lines[end:])
    raise ValueError(f"no end of {lines[0]!r}")


def is_printed(shown: str, printed: str) -> bool:
    """Is the output what a page shows of it? `...` stands for any lines, and spaces at the end of a line for none."""
    parts = re.split(r"^\.\.\.\n", _stripped(shown), flags=re.MULTILINE)
    pattern = "(?:.*\n)*".join(map(re.escape, parts))
    return re.fullmatch(pattern, _stripped(printed)) is not None


def _stripped(text: str) -> str:
    return "".join(f"{line.rstrip()}\n" for line in text.splitlines())


def left_to_the_reader(code: str) -> set[str]:
    """The names that a snippet uses and does not make."""
    tree = ast.parse(code)
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name)]
    made = {node.id for node in names if not isinstance(node.ctx, ast.Load)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            made |= {(each.asname or each.name).split(".")[0] for each in node.names}
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            made.add(node.name)
    return {node.id for node in names} - made - set(dir(builtins))


def is_endless(code: str) -> bool:
    """Does it go on until Ctrl-C? Whatever goes through a name (a feed, a subscriber) does, as pages write it."""
    loops = (node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.For | ast.AsyncFor))
    return any(isinstance(loop.iter, ast.Name) and loop.iter.id in _opened(code) for loop in loops)


def _opened(code: str) -> set[str]:
    """Names of what a `with` opened or `declare_subscriber` returned."""
    return set(re.findall(r" as (\w+)", code)) | set(re.findall(r"(\w+) = \w+\.declare_subscriber", code))
