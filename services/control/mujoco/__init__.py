"""Bodies with physics: the torso of `control.torso`, and robots of other people, in MuJoCo."""
