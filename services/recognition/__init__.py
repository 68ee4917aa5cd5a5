"""Recognition: which connection events begin, succeed, fail and end between the robot and each person.

`events` has pure state machines with transition tables as data (`directed_gaze`, `mutual_facial_gaze`,
`adjacency_pair`, `backchannel`), one set for each person of a `session`; `kinds` says what a new one is told.
`listener` decides what in the robot's turn is a backchannel, `exchange` what is a turn.
`perceive` makes actions of raw perception, `statistics` counts the events, `recognizer` joins the three, `service`
connects them to the bus. Theory: thesis chapter 2.
"""
