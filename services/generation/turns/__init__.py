"""The turn policy: follows the robot's turns, says how their fragments follow each other, and ends a turn early."""
