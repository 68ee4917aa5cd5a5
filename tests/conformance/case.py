"""A conformance case as data: BML in each dialect, and what a realizer that keeps the rule does with it.

    [[case]]
    rule = "The points of a synchronize are one instant."
    bml = '<gaze id="gaze-1" target="human"/> ...'      # the draft's spelling; or `blocks`, several of
                                                        # {id, bml, at, composition}
    expect = ["gaze-1:stroke == speech-1:start + 1"]    # `==`, `>=`, `<=` between sync references or numbers
    warnings = ["NO_SUCH_TARGET b:gaze-9"]              # exactly these; `b` alone is the block, `-` no block at all;
                                                        # `*` for any kind, if the rule names none
    outcome = "done"                                    # of each block: done, failed, interrupted, refused
    dropped = ["gaze-9"]
    settings = ["control.variability.overheated=['head']"]  # what is wrong with the body
    within = 0.05                                       # how near points must be that can only be predicted
    dialects = ["draft"]                                # by default all three

Spelled for BML 1.0, `stroke_start` becomes `strokeStart` and so on, the `stroke` of what is called `gaze-*` or
`posture-*` becomes `ready`, words stand in a `<text>`, and all points of a `<synchronize>` inside it. `{human}` and
such need no care: the world is that of the tangram table.
"""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple

TOGETHER = 0.001
"""Seconds that points of one instant may miss one another by."""
DIALECTS: dict[str, str] = {
    "draft": ' xmlns="org.mindmakers.bml"',
    "bare": "",
    "bml-1.0": ' xmlns="http://www.bml-initiative.org/bml/bml-1.0"',
    "prefixed": ' xmlns:bml="http://www.bml-initiative.org/bml/bml-1.0"',
}
"""By name, the declaration at the root."""


KEYS = frozenset(
    {"rule", "bml", "blocks", "expect", "warnings", "outcome", "dropped", "dialects", "settings", "within"}
)


class Written(NamedTuple):
    """A block as text. at: seconds from the start of the case."""

    id: str
    xml: str
    at: float


class Case(NamedTuple):
    rule: str
    dialect: str
    blocks: tuple[Written, ...]
    expect: tuple[str, ...]
    warnings: tuple[str, ...]
    outcome: tuple[str, ...]
    dropped: tuple[str, ...]
    settings: tuple[str, ...]
    within: float

    @property
    def spelling(self) -> Literal["draft", "bml-1.0"]:
        return "bml-1.0" if self.dialect in ("bml-1.0", "prefixed") else "draft"

    def __str__(self) -> str:
        return f"{self.rule} [{self.dialect}]"


def cases(folder: Path) -> Iterator[Case]:
    for path in sorted(folder.glob("*.toml")):
        for raw in tomllib.loads(path.read_text(encoding="utf-8"))["case"]:
            for dialect in raw.get("dialects", ["draft", "bare", "bml-1.0"]):
                yield _case(raw, dialect)


def _case(raw: dict[str, Any], dialect: str) -> Case:
    unknown = raw.keys() - KEYS
    assert not unknown, f"{raw['rule']}: {unknown}"
    blocks = tuple(_written(block, dialect) for block in raw.get("blocks", [raw]))
    outcome = raw.get("outcome", "done")
    outcomes = (outcome,) * len(blocks) if isinstance(outcome, str) else tuple(outcome)
    return Case(
        raw["rule"], dialect, blocks, tuple(raw.get("expect", ())), tuple(raw.get("warnings", ())), outcomes,
        tuple(raw.get("dropped", ())), tuple(raw.get("settings", ())), raw.get("within", TOGETHER),
    )  # fmt: skip


def _written(block: dict[str, Any], dialect: str) -> Written:
    id, content = block.get("id", "b"), block["bml"]
    if content.lstrip().startswith("<!") or content.lstrip().startswith("<?"):
        return Written(id, content, 0.0)
    if dialect in ("bml-1.0", "prefixed"):
        content = in_bml_1_0(content)
    prefix = "bml:" if dialect == "prefixed" else ""
    if prefix:
        content = re.sub(r"<(/?)(?=[a-zA-Z])(?!\w+:)", rf"<\1{prefix}", content)
    composition = f' composition="{block["composition"]}"' if "composition" in block else ""
    named = f' id="{id}"' if id else ""
    declared = f'{DIALECTS[dialect]} xmlns:ebml="edu.wpi.ebml"'
    return Written(id, f"<{prefix}bml{named}{composition}{declared}>{content}</{prefix}bml>", block.get("at", 0.0))


def in_bml_1_0(content: str) -> str:
    content = re.sub(
        r"(<speech [^>]*[^/]>)(?!\s*<text)(.*?)(</speech>)", r"\1<text>\2</text>\3", content, flags=re.DOTALL
    )
    content = re.sub(r'<synchronize ref="([^"]*)">', r'<synchronize><sync ref="\1"/>', content)
    content = re.sub(r"\bstroke_start\b", "strokeStart", content)
    content = re.sub(r"\bstroke_end\b", "strokeEnd", content)
    content = re.sub(r"\b((?:gaze|posture)-\d\s*:\s*)stroke\b", r"\1ready", content)
    return re.sub(r'(<(?:gaze|posture) [^>]*?)\bstroke="', r'\1ready="', content)
