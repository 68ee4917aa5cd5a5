"""Blocks in the making, and references in them."""

from collections.abc import Sequence
from random import Random
from xml.sax.saxutils import quoteattr

from msgspec import Struct, field

from tests.judge import reading

OFFSETS = (-1.0, -0.5, -0.2, 0.0, 0.0, 0.0, 0.0, 0.3, 0.5, 1.0)


class Element(Struct):
    """A behavior in the making. attributes: in order; `inner`: what stands between its tags."""

    tag: str
    id: str
    points: tuple[str, ...]
    main: str
    attributes: dict[str, str] = field(default_factory=dict)
    inner: str = ""
    required: bool = False

    def xml(self) -> str:
        written = "".join(f" {name}={quoteattr(text)}" for name, text in self.attributes.items())
        required = ' required="true"' if self.required else ""
        return f"<{self.tag} id={quoteattr(self.id)}{written}{required}>{self.inner}</{self.tag}>"


class Made(Struct):
    """A block in the making, with what others may refer to."""

    id: str
    dialect: str
    composition: str
    elements: list[Element]
    constraints: list[str]

    def xml(self) -> str:
        space = f' xmlns="{reading.BML_1_0}"' if self.dialect == "bml-1.0" else ' xmlns="org.mindmakers.bml"'
        composed = f' composition="{self.composition}"' if self.composition != "MERGE" else ""
        content = "\n  ".join((*(each.xml() for each in self.elements), *self.constraints))
        return f'<bml id="{self.id}"{space}{composed}>\n  {content}\n</bml>'


def offset(chance: Random, point: str, offsets: Sequence[float] = OFFSETS) -> str:
    offset = chance.choice(offsets)
    spaced = " " if offset and chance.random() < 0.1 else ""
    return f"{point}{spaced}{'+' if offset > 0 else '-'}{spaced}{abs(offset)}" if offset else point
