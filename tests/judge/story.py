"""A story: what a client asks of the robot, and when. Written to files, and read again from them."""

import json
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas.world import Entity, World

DeedKind = Literal["perform", "cancel", "interrupt"]

WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="cup", kind="object", position=(0.55, 0.15, 0.73), radius=0.03),
        Entity(id="box", kind="object", position=(0.50, -0.20, 0.73), radius=0.03),
        Entity(id="lamp", kind="object", position=(0.80, 0.45, 1.00), radius=0.05),
    )
)
"""Everything that stories look and point at; it never moves."""


class Deed(Struct, frozen=True, omit_defaults=True):
    """Something that the client does.

    at: seconds from the beginning. block: id of the block. xml: of a block to perform. follows: blocks of the same
    turn. behavior: the one to interrupt.
    """

    at: float
    kind: DeedKind
    block: str
    xml: str = ""
    behavior: str = ""
    follows: tuple[str, ...] = ()


class Story(Struct, frozen=True, omit_defaults=True):
    """Deeds in order of time.

    faults: of the simulated body, as `[control.variability]` has them; empty: none. lies: `lying.Lies`; empty: none.
    """

    deeds: tuple[Deed, ...]
    faults: dict[str, Any] = {}
    lies: dict[str, Any] = {}
    seed: str = ""

    @property
    def blocks(self) -> tuple[Deed, ...]:
        return tuple(deed for deed in self.deeds if deed.kind == "perform")

    @property
    def is_disturbed(self) -> bool:
        """True if something is ended from outside, so that nobody could have foreseen all times."""
        return any(deed.kind != "perform" or 'composition="REPLACE"' in deed.xml for deed in self.deeds)


def write(story: Story, folder: Path) -> None:
    """Write `story.json`, and each block to a file of its own as somebody would give it to `engage play`."""
    folder.mkdir(parents=True, exist_ok=True)
    for deed in story.blocks:
        (folder / f"{deed.block}.xml").write_text(deed.xml + "\n", encoding="utf-8")
    plain = msgspec.to_builtins(story)
    for deed in plain["deeds"]:
        if "xml" in deed:
            deed["xml"] = f"{deed['block']}.xml"
    (folder / "story.json").write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")


def read(folder: Path) -> Story:
    plain = json.loads((folder / "story.json").read_text(encoding="utf-8"))
    for deed in plain["deeds"]:
        if "xml" in deed:
            deed["xml"] = (folder / deed["xml"]).read_text(encoding="utf-8").rstrip("\n")
    return msgspec.convert(plain, Story)
