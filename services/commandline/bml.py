"""`engage bml FILE`: turn fragments as the BML they become, blocks in another dialect. Nothing moves."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from engage_hri.schemas.blocks import Block, Dialect
from engage_hri.schemas.documents.dialects import core, spelled
from engage_hri.schemas.documents.xml_decode import encode_xml
from engage_hri.services.commandline.generating import generated
from engage_hri.services.commandline.process import DONE
from engage_hri.services.commandline.run import Where
from engage_hri.services.commandline.sources import read_source, read_world

_XML_NAME = re.compile(r"[^\W\d][\w.-]*")


def main(path: Path, dialect: Dialect, only_core: bool, world: Path | None, where: Where) -> int:
    config = where.load()
    source = read_source(path)
    around = read_world(world)
    documents, warnings = [], []
    with source.blamed():
        plans = generated(source.things, around, config, str(path))
        blocks = {plan.block.id: plan.block for plan in plans}
        for plan in plans:
            block = spelled(core(plan.block) if only_core else plan.block, dialect, blocks)
            documents.append(encode_xml(block).decode())
            warnings += [*plan.warnings, *(each.message for each in block.unread), *_unusual_ids(block)]
    print("\n".join(documents), end="")
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return DONE


def _unusual_ids(block: Block) -> Iterator[str]:
    if block.dialect == "bml-1.0":
        for id in (block.id, *(behavior.id for behavior in block.behaviors)):
            if not _XML_NAME.fullmatch(id):
                yield f"id {id!r} is no XML name: other realizers of BML 1.0 may refuse it"
