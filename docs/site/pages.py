"""A page as it stands in the tree, made fit for the site: what a forge shows by itself is put into words or links."""

import re
from collections.abc import Callable, Collection
from pathlib import PurePosixPath
from posixpath import relpath

from messages import anchor

FENCE = re.compile(r"^( *)(```+)([^\n`]*)\n(.*?)^\1\2$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\([^)]*\)")
MENTION = re.compile(r"(?<![\w/.`])`?((?:docs/)(?:decisions/)?[\w-]+\.md|docs/decisions/\d{4})`?(?![\w/])")
ABOUT_MESSAGES = re.compile(r"\[`(\w+)`\]\(((?:\w+/|\.\./)*)protocol\.md#messages\)")
STEP = re.compile(r"^ *(\S+) --> (\S+)(?: *: *(.*))?$", re.MULTILINE)


def for_site(page: str, text: str, pages: Collection[str]) -> str:
    """page, pages: paths from the root of the repository. Raises LookupError where one that is named is missing."""
    parts, last = [], 0
    for fence in FENCE.finditer(text):
        parts += [_prose(page, text[last : fence.start()], pages), _fence(fence)]
        last = fence.end()
    return "".join([*parts, _prose(page, text[last:], pages)])


def _fence(fence: re.Match[str]) -> str:
    if fence[3].strip() != "mermaid":
        return fence[0]
    steps = STEP.findall(fence[4])
    if not fence[4].startswith("stateDiagram") or len(steps) != fence[4].strip().count("\n"):
        raise LookupError(f"a mermaid diagram that is no list of transitions: {fence[4][:80]!r}")
    rows = [f"| {_state(start)} | {_told(label)} | {_state(end)} |" for start, end, label in steps if start != "[*]"]
    beginning = [f"It begins in `{end}`.\n" for start, end, _ in steps if start == "[*]"]
    return "\n".join(
        [*beginning, "| state | what happens / what is told of it | next state |", "|---|---|---|", *rows]
    )


def _state(name: str) -> str:
    return f"`{name}`"


def _told(label: str) -> str:
    if not label:
        return ""
    happens, _, told = label.partition(" / ")
    return ", ".join(f"`{word}`" for word in happens.split(", ")) + (told and f" / {told}")


def _prose(page: str, text: str, pages: Collection[str]) -> str:
    text = ABOUT_MESSAGES.sub(lambda link: f"[`{link[1]}`]({link[2]}messages.md#{anchor(link[1])})", text)
    return _outside(LINK, text, lambda prose: MENTION.sub(lambda found: _link(page, found[1], pages), prose))


def _outside(kept: re.Pattern[str], text: str, change: Callable[[str], str]) -> str:
    parts, last = [], 0
    for match in kept.finditer(text):
        parts += [change(text[last : match.start()]), match[0]]
        last = match.end()
    return "".join([*parts, change(text[last:])])


def _link(page: str, named: str, pages: Collection[str]) -> str:
    full = [each for each in pages if each == named or re.match(rf"{named}-.*\.md$", each)]
    if not full:
        raise LookupError(f"{page}: no page {named}")
    target = relpath(full[0], PurePosixPath(page).parent.as_posix())
    return f"[{PurePosixPath(named).name}]({target})"
