"""Smart Turn v3 of Daily and Pipecat: a small model of how turns end, for 23 languages, which needs no words.

Its file is `smart-turn-v3.2-cpu.onnx` (8.7 MB, under the BSD 2-Clause License). It takes the logarithm of mel spectra
as Whisper does (Radford et al. 2022, "Robust speech recognition via large-scale weak supervision", 2.2): 80 bands on
the scale of Slaney's Auditory Toolbox, windows of 25 ms each 10 ms, of a sound of 8 s with zero mean and unit
variance. Shorter sound gets silence in front.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Probability
from engage_hri.services.perception.hearing.turn_detectors import HEARD, TurnDetector, TurnDetectorSettings
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.parcels import TURN_MODEL

Floats = NDArray[np.float64]
WINDOW, HOP, BANDS = 400, 160, 80


class SmartTurn(TurnDetector):
    """Smart Turn v3. `hearing.turn_model` is its file; empty: the one that `engage hearing install` has fetched."""

    def __init__(self, settings: TurnDetectorSettings) -> None:
        import onnxruntime

        path = Path(settings.model or Path(settings.folder) / TURN_MODEL.names()[0])
        if not path.is_file():
            advice = "engage hearing install"
            raise InputRefused(Fault(reason=f"there is no {path}", where="hearing.turn_model", advice=advice))
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])

    def finished(self, samples: Samples) -> Probability:
        (probability,) = self._session.run(None, {"input_features": spectra(samples)[np.newaxis]})
        return min(1.0, max(0.0, float(np.ravel(probability)[0])))


def spectra(samples: Samples) -> NDArray[np.float32]:
    """Make the spectra of the last 8 s, of shape (80, 800): bands, times."""
    length = int(HEARD * RATE)
    sound = np.zeros(length)
    if last := min(len(samples), length):
        sound[-last:] = samples[-last:] / 32768
    sound = (sound - sound.mean()) / np.sqrt(sound.var() + 1e-7)
    framed = np.lib.stride_tricks.sliding_window_view(np.pad(sound, WINDOW // 2, mode="reflect"), WINDOW)[:-1:HOP]
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(WINDOW) / WINDOW)
    power = np.abs(np.fft.rfft(framed * hann)) ** 2
    loudness: Floats = np.log10(np.maximum(power @ MEL_BANDS, 1e-10)).T
    found: NDArray[np.float32] = ((np.maximum(loudness, loudness.max() - 8.0) + 4.0) / 4.0).astype(np.float32)
    return found


def _mel_bands() -> Floats:
    """Weights of each frequency in each band: triangles of equal area, from one center to the next but one."""
    # Slaney's scale: 3 mel each 200 Hz up to 1 kHz, from there on 27 to a factor of 6.4.
    step = np.log(6.4) / 27.0
    mels = np.linspace(0.0, 15.0 + np.log(8.0) / step, BANDS + 2)  # 8 kHz
    edges = np.where(mels < 15.0, mels * 200.0 / 3.0, 1000.0 * np.exp(step * (mels - 15.0)))
    frequencies = np.linspace(0.0, RATE / 2, WINDOW // 2 + 1)[:, np.newaxis]
    low, center, high = edges[:-2], edges[1:-1], edges[2:]
    triangles = np.minimum((frequencies - low) / (center - low), (high - frequencies) / (high - center))
    bands: Floats = np.maximum(0.0, triangles) * 2.0 / (high - low)
    return bands


MEL_BANDS = _mel_bands()
