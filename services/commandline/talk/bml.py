"""Command `engage bml FILE`: print the BML that turn fragments become, or blocks in another dialect."""

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from engage_hri.schemas.blocks import Block, Dialect
from engage_hri.schemas.documents.dialects import core, in_dialect
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.services.commandline.shell.options import Configured, WorldFile
from engage_hri.services.commandline.shell.outputs import print_format
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.sources import read_source, read_world
from engage_hri.services.commandline.talk.offline_plan import generated

_XML_NAME = re.compile(r"[^\W\d][\w.-]*")


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A turn fragment or a BML block (XML), or JSON of one or several.")
    ]
    dialect: Annotated[Dialect, typer.Option(help="How to spell it.")] = "bml-1.0"
    core: Annotated[
        bool, typer.Option("--core", help="Without connection events and all else that only Engage knows.")
    ] = False
    world: WorldFile = None


def main(options: Options) -> int:
    config = options.load()
    source = read_source(options.file)
    around = read_world(options.world)
    documents, warnings = [], []
    with source.naming_file():
        plans = generated(source.things, around, config, str(source.path))
        blocks = {plan.block.id: plan.block for plan in plans}
        for plan in plans:
            block = in_dialect(core(plan.block) if options.core else plan.block, options.dialect, blocks)
            documents.append(encode_xml(block).decode())
            warnings += [*plan.warnings, *(each.message for each in block.unread), *_unusual_ids(block)]
    print_format("\n".join(documents).removesuffix("\n"))
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return DONE


def _unusual_ids(block: Block) -> Iterator[str]:
    """Warnings of ids that other readers of BML 1.0 may refuse."""
    if block.dialect == "bml-1.0":
        for id in (block.id, *(behavior.id for behavior in block.behaviors)):
            if not _XML_NAME.fullmatch(id):
                yield f"id {id!r} is no XML name: other realizers of BML 1.0 may refuse it"
