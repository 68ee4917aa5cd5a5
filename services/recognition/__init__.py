"""Recognition: which connection events begin, succeed, fail and end between the robot and each person.

Pure state machines whose transition tables are data (`directed_gaze`, `mutual_facial_gaze`, `adjacency_pair`,
`backchannel`), composed per person by `session`; `statistics` and `engagement` count what they publish;
`service` connects them to the bus. Theory: thesis chapter 2.
"""
