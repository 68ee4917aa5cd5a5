"""Commands for those who build a robot: check, calibrate and disturb a body."""
