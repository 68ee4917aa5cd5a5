"""Two and a half hours of a party of five: nothing of recognition or of the people grows."""

from tests.recognition.kept import kinds
from tests.simulation.party_play import Play

EARLY, LATE = 1800.0, 9000.0


def test_a_long_party_keeps_no_more_than_a_short_one() -> None:
    play, sizes = Play(5, 1), []
    for end in (EARLY, LATE):
        while play.now < end:
            play.until(min(end, play.now + 60.0))
            for kept in (play.said, play.events, play.messages, play.questions):
                kept.clear()
            if play.party.deadline is None or play.party.deadline > end:
                break
        sizes.append(kinds(play.intake, play.party))
    early, late = sizes

    assert play.perceived > 30_000
    for kind, number in late.items():
        assert number <= 1.3 * early[kind] + 40, (kind, early[kind], number)
