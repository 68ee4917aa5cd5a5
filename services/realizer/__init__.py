"""The realizer: a block of behaviors and constraints goes in, a closed-loop performance comes out.

    points     which sync points a behavior has, and where it can wait        classes   points that are one instant
    planner    block + estimates -> plan: net, earliest schedule              net       the Petri net, as data
    authority  what may move now, given what has been measured                export    a plan as text, JSON, DOT
    executor   one live block on the event loop                               service   the realizer's life on the bus

All but the last two are pure. A sync point is what the body reports, never what the clock says.
"""
