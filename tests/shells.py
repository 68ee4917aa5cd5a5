"""Files of services that may know the loop, the clock and the bus. Held to by `test_architecture.py`."""

SHELLS = {
    "services/realizer/perform/performance.py",  # awaits bodies
    "services/control/serving/questions.py",  # answers what behaviors would take
    "services/control/bases/driver_guard.py",  # times the calls of drivers by the clock of the loop
    "services/realizer/report.py",  # publishes feedback
    "services/realizer/perform/behavior_run.py",  # awaits and resolves sync points, awaits ends, asks recognition
    "services/realizer/together/planning.py",  # asks the body, and asks it again
    "services/realizer/perform/net_stream.py",  # publishes the marking
    "services/realizer/perform/steering.py",  # holds, continues and stops
    "services/realizer/together/live.py",  # resolved when a block has ended
    "services/control/contract/body.py",  # the interface of bodies: coroutines
    "services/control/bases/one_part_motion.py",  # a body that moves on the loop's clock
    "services/control/bases/setpoints.py",  # set points on the loop's clock
    "services/control/bases/walk.py",  # walks through sync points on the loop's clock
    "services/control/bases/linked.py",  # keeps the connection to a robot
    "services/control/bases/composed.py",  # takes several bodies home at once
    "services/control/mujoco/film.py",  # takes pictures by the clock of the loop
    "services/control/mujoco/pulse.py",  # steps of a physics on loop time
    "services/control/reachy_mini/connection.py",  # HTTP and WebSockets
    "services/control/voice/player.py",  # runs the program that plays
    "services/control/voice/studio.py",  # runs the process of the synthesizer
    "services/control/voice/sounding.py",  # a body that speaks on the loop's clock
    "services/console/web/sessions.py",  # ends sessions whose page does not come back
    "services/perception/child.py",  # a process with pipes
    "services/perception/eyes/pages.py",  # takes what cameras of pages see
    "services/perception/eyes/people.py",  # publishes people and heads
    "services/perception/eyes/watching.py",  # runs the process of a source
    "services/perception/pictures.py",  # a camera, in the process of a source
    "services/perception/sense_faults.py",  # publishes faults
    "services/perception/hearing/company.py",  # publishes people
    "services/perception/hearing/device.py",  # waits for sound, and for a device that is gone
    "services/perception/hearing/intake.py",  # takes what others tell
    "services/perception/hearing/pages.py",  # takes the sound of pages
    "services/perception/hearing/speeches.py",  # publishes voices and words, waits for the last ones
    "services/perception/hearing/listening.py",  # runs the process of a recognizer
    "services/perception/hearing/microphone.py",  # plays a file, or runs the program that records
    "services/recording/replay.py",  # says what was said
    "services/simulation/still.py",  # a world, published once, and what its people do
    "services/tangram/collaboration/host.py",  # asks people who talk
    "services/door/operations.py",  # calls of the client
    "services/door/server.py",  # answers requests
    "services/console/follow.py",  # subscribes
    "services/console/terminal/live.py",  # draws
    "services/console/web/links.py",  # waits for what pages send
    "services/console/web/own_look.py",  # ends a glance
    "services/console/web/server.py",  # serves the page
    "services/console/web/sights.py",  # what cameras of pages see
    "services/console/web/sounds.py",  # sound to the page, and from it
    "services/console/web/visitor.py",  # carries out orders
}
"""Files beside `service.py` that are not pure. Each is a decision: keep the list short."""
