"""What is asked of a server while it is not there: nothing of it is on the bus, where it would come late."""

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, RequestRefused
from engage_hri.services.requests.asking import Asking, Patience, PublishCommand, TellEnd
from tests.bus.performer import block


def asking_one_that_has_gone() -> Asking:
    asking = Asking("client", "life", Patience())
    asking.server_there("realizer", "1", 0.0)
    assert asking.server_gone("realizer", 1.0) == []
    return asking


def test_what_is_asked_of_a_server_that_has_gone_is_sent_when_it_is_back() -> None:
    asking = asking_one_that_has_gone()

    assert asking.send(keys.BLOCK, block(), 2.0) == []
    assert asking.tick(30.0) == []
    (sent,) = asking.server_there("realizer", "1", 31.0)
    assert isinstance(sent, PublishCommand)


def test_what_is_cancelled_before_its_server_is_back_never_gets_there() -> None:
    """Else a robot is held long after it was said that it cannot be."""
    asking = asking_one_that_has_gone()
    asking.send(keys.BLOCK, block(), 2.0)

    (told,) = asking.cancel("b", Fault(reason="it takes too long"), 7.0)
    assert isinstance(told, TellEnd)
    assert isinstance(told.end, RequestRefused)
    assert "before it was sent" in str(told.end)
    assert asking.server_there("realizer", "1", 31.0) == []
    assert asking.deadline is None


def test_a_server_of_which_nothing_is_known_may_not_show_itself_and_is_sent_to() -> None:
    asking = Asking("client", "life", Patience())
    asking.server_gone("realizer", 1.0)

    assert [type(one) for one in asking.send(keys.BLOCK, block(), 2.0)] == [PublishCommand]
