"""Which tests `make test` leaves to `make test-all`, and why.

People run `make test` after each small change, and wait for it. It must take minutes, so most of it runs in one
process and in virtual time. The long share is the rest: the operating system, sockets, browsers and packages.
They wait for other processes, and few changes of the code touch what they guard. CI runs them for each change.

`conftest.py` marks the long share with `long`: each test that is marked `real_time`, each in a file or folder below,
and of some tests all cases but the first few. A test that is not long and starts a process fails, unless its file is
in `SHORT_PROCESSES`. So no test of real processes makes `make test` slow unseen.

Some of it is more of what the rest has: cases like the first few, and what is drawn by chance in large numbers. That
is marked `many`, too. `make test-long` tries it, as it tries all random cases (`random_cases.py`).
"""

import re
import subprocess
import traceback
from collections.abc import Iterator
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parent

LONG = {
    "lab": "several machines on this one: it needs root, and waits for routers that start",
    "frameworks/test_livekit.py": "it needs a package that few have; `make test-frameworks` has it",
    "frameworks/test_pipecat.py": "the same",
    "test_wheel.py": "it builds the wheel and installs it in environments of their own",
    "docs/test_site.py": "it builds the whole site",
    "generation/test_again.py": "many fragments in many lives, each decided twice",
    "docs/test_glossary.py": "it reads the whole tree",
    "control/test_estimates_from_anywhere.py": "many poses, each performed; the contract of bodies has the law",
    "tangram/people/test_human_session.py": "whole tasks; test_human.py has the person alone",
    "mutants": "each test runs pytest on a copy of the tree; it guards a tool and not the robot",
    "cli/test_early_ctrl_c.py": "each test starts `engage` and interrupts it while it loads",
    "control/test_espeak.py": "each of its bodies starts eSpeak NG as a process",
    "control/test_own_synthesizer.py": "a synthesizer is a process",
    "control/test_synthesizer_that_fails.py": "a synthesizer is a process",
    "control/test_voice_outlets.py": "loudspeakers are programs of the system",
    "control/test_told_sound.py": "a synthesizer is a process",
    "perception/test_own_voice.py": "minutes of sound through a filter and a detector",
    "control/test_voice_recognized.py": "eSpeak NG speaks, and a recognizer listens",
    "scenario/test_raw_perception.py": "whole tasks seen by cameras; recognition/ has the parts",
    "recording/test_commands_on_damage.py": "each command on each damage; test_damage.py has what reading finds",
    "scenario/test_on_physics.py": "a whole task in physics; test_appendix_b.py has it on the simulated torso",
    "scenario/test_appendix_b_varied.py": "six more whole tasks; test_appendix_b.py has that of the thesis",
    "hostile/test_attacks.py": "attacks at random; test_payloads.py has what is hostile by name",
    "growth": "half a day of a robot in virtual time",
    "cli/test_check_body.py": "each test checks a whole body by the command; control/ has the laws themselves",
    "access/test_table.py": "each row of the table over real sockets; test_denials.py has what a router tells",
    "recording/test_conditions.py": "a whole session with conditions",
    "recording/test_in_the_window.py": "a whole session in the window, compared at each jump",
    "recording/test_annotation_files.py": "a whole session as a file for ELAN",
    "recording/test_tiers_at_random.py": "a whole session against an oracle; test_tiers.py has the rules",
    "recording/test_window_oracle.py": "a whole session against an oracle; test_player.py has the rules",
    "tangram/people/test_stochastic_task.py": "whole tasks with a person drawn by chance",
    "study/test_heads_like_peoples.py": "whole sessions; generation/test_living_head.py has each policy",
    "test_skips.py": "each test runs pytest; it guards a tool and not the robot",
    "cli/test_simulate.py": "whole tasks in processes of their own; study/ has what is made of them",
    "control/mujoco/test_mujoco_contract.py": "all laws in physics; test_as_simulated.py compares it with the torso",
    "control/reachy_mini/test_contract.py": "all laws on a driver that test_outages.py and others have in parts",
    "control/mujoco/test_beside.py": "another robot in physics; test_mujoco_contract.py has all laws",
    "control/mujoco/test_chosen_again.py": "whole fragments in physics",
    "control/mujoco/test_described_contract.py": "another robot in physics; test_as_simulated.py has ours",
    "control/mujoco/test_faults.py": "each fault in physics; test_mujoco_contract.py has all laws",
    "control/mujoco/test_limits.py": "random faults in physics",
    "control/mujoco/test_small_robots.py": "other robots in physics; test_mujoco_contract.py has all laws",
    "control/mujoco/test_turns.py": "each slice of inverse kinematics",
    "control/mujoco/test_pictures.py": "it draws films of physics, and has ffmpeg write them",
}
"""Files and folders whose tests are long though they are not marked `real_time`, with the reason."""

LONG_TESTS = {
    "cli/test_console.py": {
        "test_a_demo_is_recorded": "a whole task",
    },
    "cli/test_demo.py": {
        "test_the_same_seed_gives_the_same_session": "a whole task again",
        "test_people_talk_with_each_other_and_the_robot_asks": "a whole party",
        "test_a_misplaced_piece_is_asked_for_again": "a whole task; test_appendix_b.py has it, too",
        "test_another_seed_gives_other_times_but_the_same_story_and_quiet_prints_nothing": "a whole task",
        "test_lines_on_stdout_leave_it_to_them": "a whole task",
        "test_the_resolution_decides_what_counts_as_shared": "a whole task; test_appendix_b.py has it, too",
    },
    "cli/test_formats.py": {
        "test_commands_write_formats_as_utf8": "each command in a process of its own",
    },
    "cli/test_new_body.py": {
        "test_it_writes_a_driver_that_keeps_the_contract_and_says_what_is_next": "all laws by the command",
    },
    "control/reachy_mini/test_contract.py": {
        "TestLivingReachyMini": "the laws again, while it breathes",
        "TestNoisyReachyMini": "the laws again, with noise",
    },
    "cli/test_calibrate_cameras.py": {
        "test_colors_are_learned_and_a_piece_that_is_not_there_is_told": "pictures of a table; pieces/ has them, too",
        "test_a_camera_is_placed_and_its_settings_are_read": "pictures of a sheet are drawn and searched",
    },
    "client/test_small_talk.py": {
        "test_in_german_it_greets_answers_shows_pieces_by_their_names_and_says_goodbye": "minutes of a robot",
        "test_two_who_say_nothing_are_both_greeted_and_hear_all_else_once": "minutes of a robot",
        "test_who_wants_help_hears_each_time_other_examples_and_may_ask_for_any_piece": "minutes of a robot",
    },
    "control/test_beginners.py": {
        "test_degrees_are_asked_about_once": "all laws on a body that breaks many",
    },
    "control/test_slowed_over_table.py": {
        "test_an_arm_on_its_way_home_from_a_target_takes_a_pace_while_the_trunk_leans": "many ways; another has one",
    },
    "bus/test_visitors.py": {
        "test_who_came_and_went_is_forgotten_by_who_watches": "thousands of visitors",
    },
    "cli/test_calibrate.py": {
        "test_what_is_measured_corrects_the_body_and_says_how_well": "many measurements",
    },
    "control/test_calibration.py": {
        "test_few_measurements_are_not_taken_for_good_ones": "many calibrations",
        "test_as_many_as_are_said_lie_within_the_stated_error": "many calibrations",
    },
    "control/test_contract.py": {
        "TestArms": "the laws of the torso again, of its arms alone",
        "TestHeadAlone": "the laws of the torso again, of its head alone",
        "TestNoisyEncoders": "the laws of the torso again, with noise",
        "TestVoice": "the laws of the torso again, of its voice alone",
    },
    "control/test_composed.py": {
        "TestApart": "the laws of the torso again, in two parts",
        "TestComposedBody": "the laws of the torso again, in parts; the others of the file have what is its own",
    },
    "control/test_repertoire.py": {
        "test_each_lexeme_is_one_fluid_motion_within_the_limits_and_as_estimated": "all motions of the repertoire",
    },
    "control/test_ordinary.py": {
        "TestScattering": "the laws of test_setpoints.py again, with encoders that scatter",
        "TestTable": "the laws of test_setpoints.py again, with angles of a table",
    },
    "control/test_setpoints.py": {
        "TestAwaited": "the laws of TestSetPoints again, with commands that take a while",
    },
    "control/test_silent_voice.py": {
        "TestSilentVoice": "the laws again, of a voice alone",
        "TestTorsoWithSilentVoice": "the laws of the torso again, with another voice",
    },
    "control/test_liars.py": {
        "test_who_breaks_a_law_is_caught_by_it": "a body for each law; it guards the suite",
    },
    "docs/test_making_pages.py": {
        "test_arrows_point_down_and_boxes_keep_apart": "it draws all pictures of the site",
    },
    "hostile/test_docs.py": {
        "test_the_example_of_the_page_runs": "all that hostile peers send; test_nothing_pending.py has them, too",
    },
    "perception/pieces/test_appendix_a.py": {
        "test_no_piece_of_a_drawn_table_lies_in_another": "many tables are drawn",
        "test_both_find_the_same_on_tables_that_people_lay": "many tables are drawn and searched; the figure is, too",
    },
    "perception/pieces/test_finding.py": {
        **{
            f"test_all_pieces_are_found_to_millimetres_in_any_light[Light(strength={it}, noise=20, blur=0.8)]": "same"
            for it in (1.5, 0.45)
        },
        "test_the_stated_spread_is_honest": "many pictures, counted",
        "test_on_an_empty_table_nothing_lies_and_a_hand_is_no_piece": "pictures of hands; test_hands.py has some",
        "test_a_place_that_a_hand_covers_is_not_bare_and_one_from_which_a_piece_was_taken_is": "the same",
        "test_a_hand_hides_what_is_under_it_and_nothing_else": "the same",
        "test_another_camera_sees_the_same": "the same from elsewhere",
    },
    "perception/pieces/test_hands.py": {
        "test_a_piece_that_is_carried_before_a_slow_camera_is_an_act_of_who_carries_it": (
            "a film is drawn and searched; the others of the file have the acts"
        ),
        **{
            f"test_a_hand_is_found_where_it_is_whatever_its_skin[Light(strength=0.6, noise=15, blur=0.8)-{skin}]": (
                "the same in less light"
            )
            for skin in range(4)
        },
        "test_a_piece_that_lies_elsewhere_and_what_has_laid_it_there_long_ago_are_no_hands": "more pictures of hands",
        "test_two_hands_are_two_and_a_piece_that_one_of_them_holds_is_none": "the same",
        "test_a_piece_under_a_hand_is_told_where_it_lies_or_not_at_all": "the same",
        "test_a_pale_hand_that_stays_does_not_become_the_table": "the same",
        **{f"test_what_a_hand_holds_is_found_and_is_not_the_hand[{skin}]": "another skin" for skin in (1, 2, 3)},
    },
    "perception/pieces/test_pieces.py": {
        "test_a_film_of_a_table_becomes_the_world": "a film is drawn, written and read",
    },
    "perception/test_hearing.py": {
        "test_a_person_answers_the_robot_and_asks_it_by_sound_alone": "a conversation by sound",
        "test_one_person_is_heard_in_whichever_channel_of_a_file": "minutes of sound; another test has two channels",
        "test_while_the_robot_speaks_nothing_is_heard_if_so_set": "a robot that speaks, and sound",
        "test_of_several_people_one_channel_cannot_tell_whose_voice_it_is_and_that_is_told": "minutes of sound",
        "test_a_recognizer_that_fails_is_told_and_the_speech_has_no_words": "without sound: test_recognizing.py",
        "test_the_voice_is_that_of_the_only_person_whom_others_tell_of": "minutes of sound",
    },
    "perception/eyes/test_pictures.py": {
        "test_two_people_are_two_faces_and_a_far_one_is_found": "more pictures",
        "test_a_rendered_person_is_found_and_faces_where_they_do[3]": "another person",
        "test_a_rendered_person_is_found_and_faces_where_they_do[7]": "another person",
    },
    "perception/eyes/test_placing.py": {
        "test_a_camera_is_found_by_the_sheet": "pictures of a sheet are drawn and searched",
    },
    "perception/test_lips.py": {
        "test_it_is_that_of_whose_lips_go_with_it_and_hardly_ever_anothers": "each voice takes minutes of sound",
        "test_who_answers_the_robot_by_voice_is_told_by_the_id_of_their_face": "sound and a robot",
    },
    "perception/test_pages_heard.py": {
        "test_a_flood_of_microphones_is_bounded_and_what_is_no_sound_of_ours_is_told": "so many microphones",
    },
    "perception/test_recognizing.py": {
        "TestSphinx": "speech of many voices through a model; test_hearing.py hears one",
    },
    "perception/test_voice.py": {
        "test_onsets_and_ends_of_spoken_phrases_are_where_they_can_be_heard[10.0]": "with less noise",
    },
    "realizer/test_vocabulary.py": {
        "test_each_term_is_performed_degraded_or_dropped_as_the_page_says": "all words; conformance/ has the rules",
    },
    "realizer/test_forecast.py": {
        "test_a_decision_costs_at_most_in_proportion_in_the_longest_block_that_there_may_be": "long blocks, counted",
    },
    "realizer/test_second_lives.py": {
        "test_a_story_with_ids_that_are_used_again_is_the_one_with_ids_of_their_own": "random stories, each twice",
    },
    "recognition/test_coded_timelines.py": {
        "test_what_differed_once_is_as_coded": "all that once differed; fresh ones are not long",
    },
    "recognition/test_memory.py": {
        "test_a_long_session_keeps_no_more_than_a_short_one": "a long session; growth/ has longer ones",
    },
    "recognition/test_identities.py": {
        "test_memory_stays_flat_however_often_an_id_changes": "thousands of changes",
    },
    "recognition/test_crowd.py": {
        "test_a_step_asks_nobody_who_has_gone": "thousands of people",
        "test_events_and_totals_are_the_same_as_if_nobody_were_forgotten": "hours of people, twice",
        "test_what_is_kept_does_not_grow_with_those_who_have_passed": "thousands of people",
    },
    "judge/test_judge.py": {
        "test_points_of_blocks_in_streams_come_when_predicted_mostly": "many streams; a single block is not long",
    },
    "generation/test_same_choices.py": {
        "test_the_simulated_body_leads_to_the_same_plans": "many fragments; the others of the file ask all bodies",
        "test_far_less_is_asked_than_there_is": "it counts over many fragments what the others of the file compare",
    },
    "recording/test_again.py": {
        "test_the_anchor_scenario_gives_the_same_events": "a whole task; three people and a restart are played, too",
        "test_the_file_of_a_killed_recorder_gives_the_same_events_as_far_as_it_goes": "a whole task again",
        "test_a_recording_that_begins_in_the_middle_says_that_it_lacks_what_was_before": "a whole task again",
        "test_raw_perception_gives_the_same_events": "a whole task seen by cameras",
    },
    "recording/test_analyse.py": {
        "test_an_interval_holds_the_true_difference_as_often_as_it_says": "thousands of samples, drawn",
        "test_the_numbers_of_a_recording_are_those_of_the_live_run": "a whole task, by chance",
    },
    "recording/test_player.py": {
        "test_from_deadline_to_deadline_each_message_comes_once_in_order": "random recordings; the scan is not long",
    },
    "recording/test_realizer_again.py": {
        "test_random_blocks_are_performed_the_same_in_both_lives": "random blocks in two lives",
        "test_the_anchor_scenario_is_performed_the_same": "a whole task",
        "test_a_report_of_the_body_that_is_missing_or_came_earlier_is_noticed": "random blocks thrice",
        "test_other_settings_make_it_do_something_else": "random blocks again, with other settings",
    },
    "recording/test_recorder.py": {
        "test_a_whole_task_is_in_the_file_message_for_message": "a whole task; the others of the file have the rules",
        "test_status_and_capabilities_of_those_who_come_are_asked_for": "a whole task",
    },
    "recording/test_tiers.py": {
        "test_every_connection_event_is_an_annotation_with_its_times": "a whole task",
        "test_looks_of_both_sides_are_those_that_were_told": "a whole task",
        "test_an_eaf_is_read_by_another_library_as_it_was_meant": "a whole task",
        "test_a_table_has_a_row_for_each_annotation": "a whole task",
    },
    "recording/test_replay.py": {
        "test_a_whole_task_comes_again_message_for_message": "a whole task; the others of the file have the rules",
    },
    "requests/test_request_model.py": {
        "test_where_nobody_dies_callers_are_told_what_was_done_and_services_have_what_was_asked_last": "many at once",
    },
    "requests/test_requests.py": {
        "test_a_desk_forgets_the_oldest_ended_requests_of_who_sends_many_and_no_live_one": "thousands of requests",
        "test_ten_thousand_requests_at_once_come_as_the_server_keeps_up_each_once_and_in_order": "so many",
    },
    "scenario/test_appendix_b.py": {
        "test_a_misplaced_piece_is_asked_to_be_fixed_and_then_is_right": "another whole task",
        "test_totals_of_causes_turn_and_reference[object-gazes1]": "the task at the other resolution",
        "test_robot_initiated_events_come_in_the_order_and_with_the_outcomes_of_the_transcript[object]": (
            "the task at the other resolution; recognition/test_appendix_b.py has both without a robot"
        ),
        "test_everybody_looks_where_the_transcript_says[3]": "the task with another seed",
        "test_the_same_seed_gives_the_same_run_and_another_seed_the_same_events": (
            "the task again, and with another seed; test_demo.py has the same seed"
        ),
        "test_the_task_finishes_the_figure_with_a_person_who_listens": "another whole task",
    },
    "scenario/test_words.py": {
        "test_all_that_the_simulated_person_says_are_words_of_events": "whole tasks, by chance",
    },
    "simulation/test_party.py": {
        "test_they_talk_over_each_other_as_people_do": "an hour of talk, counted",
        "test_what_is_said_to_others_is_not_the_robots_and_its_questions_are_answered": "two hours of talk, counted",
    },
    "frameworks/test_realtime.py": {
        "test_events_are_those_of_the_api_by_its_own_types": "it needs a package that few have",
    },
    "study/test_permutation.py": {
        "test_many_divisions_of_two_samples_are_tested_by_drawing": "so many divisions are drawn",
        "test_many_pairs_are_tested_by_drawing": "so many signs are drawn",
    },
    "study/test_plots.py": {
        "test_all_plots_are_drawn": "it draws with Matplotlib",
    },
    "tangram/collaboration/test_visitors.py": {
        "test_who_does_nothing_and_looks_away_is_let_go_kindly": "minutes of a whole robot",
        "test_who_looks_at_the_pieces_to_think_is_not_let_go": "minutes of a whole robot; who is let go is not long",
        "test_who_attends_and_does_nothing_is_asked_for_another_piece": "minutes of a whole robot; help is not long",
    },
    "test_shares.py": {
        "test_a_process_that_nobody_has_marked_is_red_and_what_is_left_out_is_told": "it runs pytest",
    },
}
"""The same of single tests, classes of tests, or cases, by file."""

FIRST_CASES = {
    "cli/test_doctor.py": {"test_the_report_fits_and_has_all_that_was_found": 40},
    "control/reachy_mini/test_looking.py": {
        "test_joints_that_follow_late_are_expected_at_their_goal_not_before_and_soon_after": 3,
    },
    "control/reachy_mini/test_slow_streams.py": {"test_it_comes_to_its_end_late_and_says_so": 10},
    "realizer/test_replans_at_random.py": {"test_a_block_that_was_held_goes_on_the_same_if_it_is_planned_again": 3},
    "recognition/test_random_parties.py": {"test_pairs_are_those_of_the_script": 2},
    "client/test_turn.py": {"test_a_body_that_is_left_stops_the_robot_at_a_word_and_said_is_true": 5},
    "control/reachy_mini/test_limits.py": {"test_no_target_is_beyond_what_the_joints_are_trusted_with": 3},
    "control/test_clear_of_table.py": {
        "test_no_arm_comes_into_the_table_whatever_begins_when": 3,
        "test_a_gesture_gives_way_to_a_trunk_that_leans_later": 8,
    },
    "control/test_moving_trunk.py": {"test_no_joint_leaves_its_limits_in_a_hurry_while_the_trunk_moves": 1},
    "control/test_postures.py": {"test_while_the_body_moves_they_are_the_same": 2},
    "generation/test_interruptible.py": {"test_who_may_interrupt_stops_the_robot_and_who_may_not_is_told": 4},
    "generation/test_own_words_back.py": {"test_the_robot_is_not_stopped_or_answered_by_its_own_words": 2},
    "generation/test_posture_truth.py": {"test_degrees_expected_are_degrees_turned": 1},
    "generation/test_several_addressees.py": {"test_a_party_of_three_is_asked_and_who_answers_is_looked_at": 2},
    "generation/test_talked_into.py": {
        "test_words_decide_and_not_their_length": 4,
        "test_who_interrupts_has_answered_wherever_the_threshold_stands": 4,
        "test_who_is_out_of_sight_for_up_to_two_seconds_can_still_answer": 4,
        "test_a_typed_line_stops_the_robot_and_is_its_answer": 4,
    },
    "generation/test_told_deeds.py": {
        "test_a_thing_that_cannot_be_looked_at_was_not_looked_at": 3,
        "test_what_died_while_it_spoke_leaves_the_rest_unknown": 3,
    },
    "generation/test_wordless.py": {"test_a_voice_takes_the_floor_after_a_second_and_a_half": 2},
    "hostile/test_nothing_pending.py": {"test_nothing_is_pending_after_lies_cuts_and_vanished_bodies": 2},
    "recognition/test_sensor_lag.py": {"test_a_voice_that_is_known_late_has_been_heard_early": 10},
    "recording/test_damage.py": {
        "test_one_changed_byte_anywhere_is_told_if_anything_differs": 1,
        "test_other_damage_is_told_if_anything_differs": 15,
    },
    "schemas/test_export.py": {"test_what_the_codec_writes_fits_and_what_fits_it_reads": 20},
    "client/test_stopped_over_a_restart.py": {
        "test_stop_stops_the_robot_although_recognition_is_away": 4,
    },
    "control/mujoco/test_as_simulated.py": {"test_points_are_those_of_the_simulated_torso": 2},
    "control/test_alive.py": {"test_all_of_it_keeps_the_limits_of_the_joints": 1},
    "control/test_following.py": {"test_what_moves_is_followed_and_told_where_it_is": 12},
    "control/test_meets_table.py": {"test_many_poses_at_once_meet_the_table_where_one_of_them_does": 1},
    "control/test_switching.py": {
        "test_whatever_fault_comes_no_point_is_reported_that_the_joints_do_not_bear_out": 6,
    },
    "client/conversation/test_promises.py": {
        "test_the_history_of_random_conversations_is_what_a_listener_has_written_down": 1,
        "test_the_first_word_of_a_call_comes_as_soon_as_that_of_plain_text": 1,
    },
    "generation/test_interrupted.py": {"test_each_outcome_says_who_and_what_and_each_word_is_said_once": 3},
    "generation/test_tied_to_references.py": {"test_whatever_is_tied_to_a_reference_can_be_performed": 6},
    "judge/test_judge.py": {
        "test_no_story_breaks_a_law_that_is_enforced": 4,
        "test_what_once_broke_a_law_breaks_none": 6,
    },
    "perception/pieces/test_hands.py": {"test_a_hand_is_found_where_it_is_whatever_its_skin": 1},
    "perception/test_voice.py": {"test_onsets_and_ends_of_spoken_phrases_are_where_they_can_be_heard": 1},
    "bus/test_one_history.py": {"test_each_reader_sees_what_it_must_whoever_comes_goes_crashes_or_lies": 2},
    "realizer/test_faults_on_the_way.py": {"test_a_fault_that_comes_in_the_middle_and_goes": 4},
    "realizer/test_kept_or_told.py": {"test_what_is_rehearsed_is_what_comes_in_the_performance": 4},
    "realizer/test_late_loop.py": {
        "test_no_behavior_breaks_its_block_and_none_is_lost_before_the_body_was_asked": 14,
    },
    "realizer/test_on_target.py": {
        "test_gaze_face_and_posture_meet_the_stroke_of_any_arm": 3,
        "test_speech_begins_as_all_are_on_target_and_not_before": 3,
        "test_who_is_on_target_waits_for_a_slow_arm": 3,
        "test_who_comes_just_in_time_sets_out_no_earlier_than_that": 3,
        "test_a_gaze_meets_the_word_and_the_stroke_together": 3,
    },
    "realizer/test_past_blocks.py": {"test_a_tie_to_a_block_that_ends_is_kept_or_told_whenever_it_comes": 3},
    "realizer/test_plan_growth.py": {"test_twice_the_block_costs_twice_the_work": 3},
    "realizer/test_slices.py": {"test_no_try_is_long": 3},
    "recognition/test_coded_timelines.py": {"test_events_are_those_that_a_coder_writes_down": 2},
    "recognition/test_each_open_is_decided.py": {
        "test_each_open_is_decided_once": 1,
        "test_what_was_told_last_of_each_event_is_told_by_present_ids": 1,
    },
    "recognition/test_identities.py": {"test_a_person_whose_id_changes_has_the_events_of_one_whose_id_does_not": 2},
    "recording/test_again.py": {"test_three_people_and_a_restart_in_the_middle_give_the_same_events": 1},
    "requests/test_request_model.py": {"test_each_request_ends_exactly_once_and_nothing_is_pending_for_ever": 2},
    "test_contained.py": {"test_a_bug_ends_one_request_and_the_next_is_served": 8},
    "text/test_reader.py": {"test_a_long_row_of_marks_is_read_to_its_end": 4},
}
"""Tests of many cases that are alike and take long, by file: so many of them, the first, are not long."""

MANY = {
    "generation/test_again.py",
    "hostile/test_attacks.py",
    "growth",
    "control/test_estimates_from_anywhere.py",
    "control/mujoco/test_limits.py",
    "recording/test_tiers_at_random.py",
    "tangram/people/test_stochastic_task.py",
    "scenario/test_appendix_b_varied.py",
    "realizer/test_second_lives.py",
    "recognition/test_memory.py",
    "recognition/test_crowd.py",
    "judge/test_judge.py",
    "simulation/test_party.py",
}
"""Files and folders whose long tests are drawn by chance, or take hours of virtual time."""

LONG_BUSES = {
    "group": "sessions of one process, with keys: they hear each other in memory; `zenoh` has the sockets",
    "shared": "one session for a whole process; `memory` has what it does within, `zenoh` what it does outside",
}
"""Kinds of bus on which the contract of buses is long, with the reason."""

SMOKE = "cli/test_smoke.py"
"""The one file of real processes that stays short: without it a robot that does not start at all would pass."""

REAL_TIME = re.compile(r"^pytestmark = .*\breal_time\b", re.MULTILINE)
"""What marks a whole file."""

SHORT_PROCESSES: dict[str, str] = {
    SMOKE: "it is what real processes do at the least",
    "test_architecture.py": "it asks git for the names of files",
    "test_shares.py": "it asks make and pytest, and no robot",
    "test_public_names.py": "it asks Python once what an import loads",
    "cli/test_demo.py": "it plays a demo on the virtual clock in one process, for all its tests",
    "cli/test_formats.py": "terminals of other encodings need a process, which prints a page and ends",
    "cli/test_loading.py": "it asks Python once how a command is loaded",
    "control/test_liars.py": "it asks pytest once, and no robot",
    "control/test_offers.py": "it asks Python once what a package on the path offers",
    "docs/test_changes.py": "it asks towncrier thrice, and no robot",
    "runtime/test_installation.py": "it asks Python once where a package is",
}
"""Files of the short share that may start processes, with the reason."""


def is_long(path: Path, test: str, *, place: int = 0, real_time: bool, each_bus: bool = False) -> bool:
    """Whether a test belongs to the long share.

    test: its name in the file, perhaps with its case in brackets. place: of the case among those of its test.
    """
    name, (whole, _, case) = path.relative_to(TESTS).as_posix(), test.partition("[")
    named = {test, whole, whole.partition("::")[0]}
    is_named = is_long_file(path) or not named.isdisjoint(LONG_TESTS.get(name, ()))
    on_long_bus = each_bus and case.rstrip("]").partition("-")[0] in LONG_BUSES
    is_one_of_many = place >= FIRST_CASES.get(name, {}).get(whole, inf)
    return name != SMOKE and (real_time or is_named or on_long_bus or is_one_of_many)


def is_many(path: Path, test: str, *, place: int = 0) -> bool:
    """Whether a test of the long share is more of what the rest of the tests has. test, place: as of `is_long`."""
    file = path.relative_to(TESTS)
    is_one_of_many = place >= FIRST_CASES.get(file.as_posix(), {}).get(test.partition("[")[0], inf)
    return is_one_of_many or any(each.as_posix() in MANY for each in (file, *file.parents))


@cache
def is_long_file(path: Path) -> bool:
    """Whether all tests of this file, or folder, belong to the long share, as is known without loading it.

    A file is read once: it is asked about for each of its tests.
    """
    if not path.is_relative_to(TESTS) or path == TESTS / SMOKE:
        return False
    file = path.relative_to(TESTS)
    is_named = any(each.as_posix() in LONG for each in (file, *file.parents))
    return is_named or (path.name.startswith("test_") and REAL_TIME.search(path.read_text("utf-8")) is not None)


def may_have_long(path: Path) -> bool:
    """Whether some test of this file, or folder, may belong to the long share, as is known without loading it."""
    if path.is_dir() or not path.is_relative_to(TESTS):
        return True
    is_named = path.relative_to(TESTS).as_posix() in LONG_TESTS | FIRST_CASES
    marked = re.search("real_time|each_bus", path.read_text("utf-8"))
    return is_named or is_long_file(path) or (path != TESTS / SMOKE and marked is not None)


def _is_importing() -> bool:
    """Whether whoever calls this does so while a module is loaded."""
    return any(frame.f_code.co_filename.startswith("<frozen importlib") for frame, _ in traceback.walk_stack(None))


class Started:
    """Counts processes that are started from here, by `subprocess` or by asyncio, which uses it.

    A test of real processes that nobody has marked would make `make test` slow, and nobody would see why: it fails.
    """

    def __init__(self) -> None:
        self.number = self._before = 0
        self._patch = pytest.MonkeyPatch()

    def pytest_sessionstart(self) -> None:
        """Count from now on. What a library starts while it is imported is not counted: MuJoCo's glfw does so."""
        begin = subprocess.Popen.__init__

        def counted(process: "subprocess.Popen[Any]", *arguments: Any, **options: Any) -> None:
            self.number += not _is_importing()
            begin(process, *arguments, **options)

        self._patch.setattr(subprocess.Popen, "__init__", counted)

    def pytest_sessionfinish(self) -> None:
        self._patch.undo()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        self._before = self.number

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        yield
        name = item.path.relative_to(TESTS).as_posix()
        if self.number > self._before and item.get_closest_marker("long") is None and name not in SHORT_PROCESSES:
            pytest.fail(f"it starts a process: mark it `real_time`, or list {name} in tests/long_share.py")


class Left:
    """Tells in one line how much `-m "not long"` has left out, also where only workers know it.

    Files that are long as a whole are not even loaded: that is a fifth of what loading all costs. With `-m long` it
    is those without a long test that are not.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.tests, self.files, self._asked = 0, 0, config.option.markexpr == "not long"
        self._is_rest_asked = config.option.markexpr.startswith("long")

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Never asked for what is named on the command line."""
        if self._is_rest_asked and not may_have_long(collection_path):
            return True
        if not self._asked or collection_path == TESTS or not is_long_file(collection_path):
            return None
        self.files += len([*collection_path.rglob("test_*.py")]) if collection_path.is_dir() else 1
        return True

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        if self._asked:
            self.tests += sum(item.get_closest_marker("long") is not None for item in items)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["left"] = self.tests, self.files

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Each worker has the same tests."""
        self.tests, self.files = getattr(node, "workeroutput", {}).get("left", (self.tests, self.files))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.tests or self.files:
            files = f" and {self.files} whole files" if self.files else ""
            terminalreporter.write_line(
                f"{self.tests} tests{files} are left to `make test-all` (tests/long_share.py)"
            )
