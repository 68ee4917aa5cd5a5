"""The whole system with the stochastic person: the task comes to its end, whatever they get wrong."""

from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.world import World
from engage_hri.services.generation.config import Condition
from engage_hri.services.tangram.collaboration.task import Goal
from engage_hri.services.tangram.people.stochastic import Habits
from engage_hri.services.tangram.table import tangram_table
from tests.scenario.playing import Record, play

ENDS = {"completed", "failed", "preempted", "withdrawn", "superseded"}


async def plays(seed: int, condition: Condition = "operational", habits: Habits | None = None) -> Record:
    return await play("stochastic", "object", seed, condition=condition, habits=habits, mode="task")


def placed(record: Record) -> int:
    """How many of the ten pieces are where they belong at the end."""
    return len(Goal(tangram_table()).placed(record.messages(World)[-1].objects))


def left_open(record: Record) -> list[str]:
    """Events that began ten seconds before the end and have not ended: a pair may wait for 4 s."""
    lives = record.events
    over = max(life[-1].at.seconds for life in lives.values())
    return [id for id, life in lives.items() if life[-1].state not in ENDS and life[0].at.seconds < over - 10.0]


def times_asked_again(record: Record) -> int:
    return sum(any(how in block for how in ("-fix", "-help", "-again")) for block in record.outcomes)


async def test_the_anchor_is_made_and_nothing_stays_open():
    record = await plays(1)

    assert "goodbye" in record.outcomes
    assert placed(record) == 10
    assert left_open(record) == []


async def test_who_has_a_piece_in_their_hand_is_not_asked_again_however_long_they_turn_it():
    slow = Habits(
        fits=(25.0, 30.0, 35.0), misplaces=0.0, confuses=0.0, confuses_shown=0.0, hears=1.0, answers_turn=1.0
    )
    record = await plays(1, habits=slow)

    assert placed(record) == 10
    assert times_asked_again(record) == 0


async def test_words_alone_are_enough():
    record = await plays(0, "degraded-generation")
    shown = [it for it in record.messages(ActionBegan) if it.actor == "robot" and it.action in ("look", "point")]

    assert "goodbye" in record.outcomes
    assert placed(record) == 10
    assert not any(set(it.targets) & {"human", *(piece.id for piece in tangram_table().pieces)} for it in shown)


async def test_who_gets_nearly_everything_wrong_is_asked_again_and_again():
    inept = Habits(hears=0.7, confuses=0.4, confuses_shown=0.4, misplaces=0.4, answers_turn=0.3)
    record = await plays(1, "degraded-generation", inept)

    assert times_asked_again(record) > 4
    assert "goodbye" in record.outcomes
    assert left_open(record) == []
