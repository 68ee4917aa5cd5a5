"""Examination of a robot's bus for `engage doctor`: `service` gathers facts, `findings` judges, `report` shows."""
