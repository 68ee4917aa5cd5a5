"""Rigs: programs that try the robot, for tests and by hand. They lie here, so that no robot carries them about."""
