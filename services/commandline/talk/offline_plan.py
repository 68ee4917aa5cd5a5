"""Planning of the fragments of a file as generation would do it, without a bus and without moving."""

from collections.abc import Sequence

from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import Thing
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.runtime.virtual_time import run_virtual


class Unplanned(RunFailed):
    """A fragment cannot be performed. plans: of the fragments before it. choices: the tables of its references."""

    def __init__(self, fault: Fault, plans: list[FragmentPlan], choices: tuple[ReferenceChoice, ...]) -> None:
        super().__init__(fault)
        self.plans = plans
        self.choices = choices


def generated(things: Sequence[Thing], world: World, config: RobotConfig, source: str) -> list[FragmentPlan]:
    """Plan fragments one after the other, with the configured body at home before each. A block is its own plan.

    Raises InputRefused or Unplanned, as performing them would.
    """
    return run_virtual(_generated(things, world, config, source))


async def _generated(things: Sequence[Thing], world: World, config: RobotConfig, source: str) -> list[FragmentPlan]:
    from engage_hri.services.control.bases.drivers import made
    from engage_hri.services.control.contract.calibration import calibrated
    from engage_hri.services.generation.fragment_check import performable
    from engage_hri.services.generation.inhibitions import Leases
    from engage_hri.services.generation.pipeline import glance, planned, planning, targets
    from engage_hri.services.generation.policies import installed
    from engage_hri.services.generation.references.motions import distinct, from_here, from_here_told
    from engage_hri.services.generation.references.phrases import NO_DISCOURSE
    from engage_hri.services.generation.references.policy import Unreferable
    from engage_hri.services.generation.turns.robot_turns import RobotTurns

    body = made(config.control)
    calibration = calibrated(body, config.control.calibration)
    permits = Leases(config.generation).permits()
    turns = RobotTurns(config.robot, config.generation, installed(config.generation).turns)

    def estimated(items: Sequence[EstimateItem]) -> Sequence[Estimate]:
        return [calibration.stated(estimate) for estimate in body.rehearse(items, world)]

    plans = []
    discourse = NO_DISCOURSE
    for each in things:
        if isinstance(each, Block):
            plans.append(FragmentPlan(block=each))
            continue
        fragment, lost = performable(each, world, config.robot)
        turn = turns.accept(fragment, fragment.addressee)
        sequence = distinct(targets(fragment))
        glanced = glance(fragment, turn, config.generation)
        here = estimated(from_here(sequence, permits.only_hand, glance=glanced))
        motions = from_here_told(sequence, here, glanced)
        try:
            if not turn.backchannel:
                discourse = discourse.in_turn(turn.turn, turn.addressees)
            emitted = planned(
                planning(
                    fragment,
                    turn,
                    world,
                    body.capabilities,
                    motions,
                    permits,
                    config.generation,
                    discourse=discourse,
                ),
                estimated,
            )
            discourse = discourse.naming(fragment.id, [each.object for each in emitted.made])
            plans.append(replace(emitted, warnings=(*lost, *emitted.warnings)))
        except Unreferable as error:
            where = f"{source}: {fragment.id}: {error.fault.where}"
            fault = replace(error.fault, where=where, line=_line(fragment, error.fault.where))
            raise Unplanned(fault, plans, error.choices) from error
        turns.fragment_ended(fragment.id, complete=True, now=0.0)
    return plans


def _line(fragment: TurnFragment, behavior: str) -> int:
    return next((each.line for each in fragment.behaviors if each.id == behavior), 0)
