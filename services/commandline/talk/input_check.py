"""Checks of all files before anything moves. A problem is told as a warning, as the realizer would do."""

from collections.abc import Sequence
from pathlib import Path

from engage_hri.schemas.blocks import Block, WarningFeedback, WarningKind
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SyncRef, sites
from engage_hri.schemas.world import World
from engage_hri.services.commandline.shell.exit_codes import readable
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.commandline.shell.sources import InputFile, Thing, read_source


def read_all(files: Sequence[Path], outputs: Outputs) -> tuple[InputFile, ...]:
    """Read all files. Raises InputRefused for the first bad one, after its warning has gone to the feedback."""
    sources = []
    for path in files:
        try:
            sources.append(read_source(path))
        except InputRefused as error:
            _warn(outputs, error.block, error.fault)
            raise
    return tuple(sources)


def check(sources: Sequence[InputFile], world: World | None, robot: str, outputs: Outputs) -> None:
    """Check blocks for contradictions, and fragments against a world, if it is known. Raises InputRefused."""
    from engage_hri.services.generation.fragment_check import performable
    from engage_hri.services.realizer.plan.known import Known
    from engage_hri.services.realizer.plan.planner import plan_block
    from engage_hri.services.realizer.plan.relations import BlockRefused

    for source in sources:
        for thing in source.things:
            try:
                with source.naming_file():
                    if isinstance(thing, Block):
                        # The realizer will check that the other blocks are alive when this one comes.
                        plan_block(thing, known=Known(blocks=dict.fromkeys(_others(thing))))
                    elif world is not None:
                        performable(thing, world, robot)
            except InputRefused as error:
                refusal = error.__cause__
                kind = refusal.kind if isinstance(refusal, BlockRefused) else "PARSING_FAILURE"
                _warn(outputs, thing.id, error.fault, kind)
                raise


def lacks_people(thing: Thing, world: World, robot: str) -> bool:
    """True if a fragment or block speaks to somebody, or has a target that is not known, and the world has no people.

    robot: its actor id, which may be a target.
    """
    from engage_hri.services.generation import fragment_check

    if world.people:
        return False
    known = {robot, "", *(entity.id for entity in world.entities)}
    if any(getattr(behavior, "target", "") not in known for behavior in thing.behaviors):
        return True
    return isinstance(thing, TurnFragment) and fragment_check.lacks_people(thing, world)


def _others(block: Block) -> set[str]:
    """Ids of the other blocks to whose points a block refers."""
    return {SyncRef.parse(site.text).block for site in sites(block)} - {"", block.id}


def _warn(outputs: Outputs, block: str | None, fault: Fault, kind: WarningKind = "PARSING_FAILURE") -> None:
    outputs(WarningFeedback(block=block, kind=kind, message=readable(fault)), 0.0)
