"""How a session of Zenoh is opened: endpoints that are none, and pauses of those whose link broke."""

import json
from typing import Any

import pytest
import zenoh

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.zenoh import session


@pytest.mark.parametrize("endpoint", ["somewhere", "tcp:192.0.2.1:7447", ""])
async def test_a_client_of_a_router_with_a_misspelled_endpoint_does_not_wait_for_it(endpoint: str) -> None:
    with pytest.raises(InputRefused, match="is not an endpoint"):
        await session.open_client("robot", [endpoint])


async def test_processes_whose_link_broke_try_again_at_times_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with up to twice the pauses, so that not all come at once."""
    pauses: list[dict[str, int]] = []

    def opened(config: zenoh.Config) -> Any:
        pauses.append(json.loads(config.get_json("connect/retry")))

    monkeypatch.setattr(zenoh, "open", opened)
    for _ in range(50):
        await session.open_client("robot", ["tcp/192.0.2.1:7447"])

    for name in ("period_init_ms", "period_max_ms"):
        least = session.RETRY_MS[name]
        assert all(least <= each[name] <= 2 * least for each in pauses)
        assert len({each[name] for each in pauses}) > 10
