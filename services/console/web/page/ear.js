// Takes the sound of a microphone off the main thread, and hands it over in windows of 32 ms at 16 kHz, with the frame of the context at which each began.
const RATE = 16000;
const WINDOW = 512;

class Ear extends AudioWorkletProcessor {
  constructor() {
    super();
    this.window = new Int16Array(WINDOW);
    this.filled = 0;
    this.sum = 0; // of the samples that become one, where the context has more of them a second
    this.count = 0;
    this.owed = 0; // part of one of our samples for which there is sound already
    this.began = 0;
    this.out = null; // to who sends it on
    this.port.onmessage = ({ data }) => (this.out = data);
  }

  process(inputs) {
    const sound = inputs[0]?.[0];
    if (!sound || !this.out) return true;
    for (let index = 0; index < sound.length; index += 1) {
      if (this.filled === 0 && this.count === 0) this.began = currentFrame + index;
      this.sum += sound[index];
      this.count += 1;
      this.owed += RATE / sampleRate;
      if (this.owed < 1) continue;
      this.owed -= 1;
      this.window[this.filled] = Math.max(-32768, Math.min(32767, Math.round((this.sum / this.count) * 32768)));
      this.sum = this.count = 0;
      this.filled += 1;
      if (this.filled < WINDOW) continue;
      this.out.postMessage({ frame: this.began, samples: this.window.slice(0), ended: Date.now() }); // the only clock that there is here
      this.filled = 0;
    }
    return true;
  }
}

registerProcessor("ear", Ear);
