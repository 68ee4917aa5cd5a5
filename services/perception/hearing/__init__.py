"""Hearing: from sound to who speaks since when, and which words. docs/hearing.md tells how to use it.

service.py       the service: it puts the others together
device.py        ears at a device or a file
pages.py         ears at the microphones of pages
intake.py        what it takes from the bus besides sound
speeches.py      what is said in channels of sound: by whom, since when, with which words
lips.py          whose voice it is of several people; pure
company.py       who is here, and what hearing complains of
voice.py         when a voice begins and ends in sound; pure
sound.py         samples: WAV files, rates, and when each was captured; pure
microphone.py    sound as it comes: a file in the time of the loop, or the program that records
own_voice.py     the robot's own voice, taken out of a microphone; pure
recognizing.py   what a recognizer is, and the desk at which its process works
listening.py     a recognizer in its own process, or in this one where time is virtual
recognizers/     adaptors, each for one engine
"""
