"""Study of many sessions: records of each, numbers of all, plots, tests of hypotheses. Pure."""
