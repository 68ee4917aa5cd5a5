"""What is known of a person's head, in words."""

from engage_hri.schemas.recognition import HeadHabit, Statistics, SureLook, WindowStatistics
from engage_hri.services.console.wording import statistics
from tests.recognition.observations import stamp


def test_where_a_head_points_is_said_behind_the_statistics() -> None:
    look = SureLook(head=(0.0, 0.0), aim=(-2.1, 4.0), spread=(3.0, 5.0))
    head = HeadHabit(offset=(-2.1, 4.0), behind=(0.1, 0.3), deviation=(2.0, 3.0), looks=(look,) * 6)
    nothing = WindowStatistics()
    told = Statistics(actor="ann", at=stamp(1.0), session=nothing, recent=nothing, head=head)

    assert statistics(told).endswith("; head 2.1 degrees left, 4.0 down of what is looked at, by 6 looks")
