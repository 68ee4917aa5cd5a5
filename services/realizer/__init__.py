"""The realizer: a block of behaviors and constraints goes in, a closed-loop performance comes out.

    service   the realizer on the bus
    perform   live blocks on the event loop: one task for each behavior, and the feedback about it
    together  several live blocks: ties, parts that change hands, and planning beside those that run
    export    a plan as text, JSON or DOT, and its net as messages
    report    feedback, and what came of a block
    decide    what may move now, given what has been measured; no clock
    foresee   when each instant will be, by all that was measured; no clock
    plan      from a block and estimates to a net and its earliest schedule; no clock
    net       the Petri net as data, as PNML, and while it runs
    points    sync points, and how a behavior can wait at each

Each may use those below it. A sync point is what the body reports, never what the clock says.
"""
