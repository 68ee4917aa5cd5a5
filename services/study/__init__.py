"""A study of many sessions: what each leaves behind, numbers of them all, plots, tests of hypotheses. Pure."""
