"""The turn policy: follows the robot's turns, and says how the fragments of one turn follow each other."""
