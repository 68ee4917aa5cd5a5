"""What drives a robot and follows it, from any process."""

from engage_hri.services.client.robot import PerformFailed, Robot, connect

__all__ = ["PerformFailed", "Robot", "connect"]
