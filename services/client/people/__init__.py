"""People, as a program tells the robot of them: who is there, what they do and say."""
