"""The files that take longest, in the order in which they begin.

It decides nothing but how evenly the work is shared out: a file that is not here comes after them. Files that wait
for processes of their own alternate with files that only compute. They are found by `pytest --durations=60`.
"""

LONGEST = (
    "docs/test_pages.py", "cli/test_check_body.py", "console/test_window.py", "judge/test_judge.py",
    "control/mujoco/test_mujoco_contract.py", "conformance/test_conformance.py", "control/test_contract.py",
    "cli/test_processes.py", "recording/test_again.py", "scenario/test_appendix_b.py", "lab/test_lab.py",
    "lab/test_doctor.py", "control/reachy_mini/test_contract.py",
    "recording/test_in_the_window.py", "scenario/test_raw_perception.py", "docs/test_site.py",
    "lab/test_heal.py", "scenario/test_on_physics.py",
    "control/test_espeak.py", "hostile/test_attacks.py", "cli/test_recordings.py",
    "realizer/test_exact_plan.py", "lab/test_time.py", "cli/test_demo.py", "access/test_attacks.py",
    "cli/test_second_ctrl_c.py", "cli/test_simulate.py", "lab/test_talks_on.py",
    "access/test_table.py", "test_wheel.py", "tangram/people/test_stochastic_task.py", "lab/test_reach.py",
    "control/mujoco/test_faults.py", "lab/test_deploy.py", "cli/test_watched.py",
    "realizer/test_slices.py", "cli/test_in_one.py", "control/test_composed.py",
    "generation/test_same_choices.py", "control/test_slowed_over_table.py", "generation/test_talked_into.py",
    "generation/test_streaming.py", "control/test_postures.py", "generation/test_chosen_again.py",
    "generation/test_told_deeds.py", "control/test_switching.py",
)  # fmt: skip
