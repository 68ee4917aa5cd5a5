"""Calibration from measurements: what is measured, and what fits it."""
