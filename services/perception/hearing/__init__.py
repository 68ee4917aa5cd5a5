"""Hearing: from sound to who speaks since when, and which words. docs/hearing.md tells how to use it.

service.py       the service: its sound, its ears, and what they tell on the bus
voice.py         when a voice begins and ends in sound; pure
sound.py         samples: WAV files, rates, and when each was captured; pure
microphone.py    sound as it comes: a file in the time of the loop, or the program that records
own_voice.py     the robot's own voice, taken out of a microphone; pure
recognizing.py   what a recognizer is, and the desk at which its process works
listening.py     a recognizer in its own process, or in this one where time is virtual
recognizers/     adaptors, each for one engine
"""
