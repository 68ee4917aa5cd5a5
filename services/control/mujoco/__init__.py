"""Bodies with physics: the torso of `control.torso`, and robots of other people, in MuJoCo.

`model` has the torso's motors and masses, `robot` works out the motors of other robots; `physics` moves both.
"""
