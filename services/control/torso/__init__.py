"""The torso as a formula: the driver `simulated`, whose joints are where their plan has them but for its faults."""
