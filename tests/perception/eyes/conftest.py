"""A face without what mends that of real points: what is drawn of it has nothing to be mended."""

import numpy as np
import pytest

from engage_hri.services.perception.eyes import head_pose


@pytest.fixture
def exact_face(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the average face be that of whoever is seen."""
    face = head_pose.average_face()
    exact = face._replace(mends=np.zeros_like(face.mends))
    monkeypatch.setattr(head_pose, "average_face", lambda: exact)
