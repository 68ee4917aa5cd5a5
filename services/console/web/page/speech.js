// Plays the pieces of a voice off the main thread, so that a page that draws holds no word up.
const JOINS = 0.003; // seconds by which what follows may be beside what was before: then it follows without a gap
const SPEECH = 0.5; // seconds after which the clocks are compared anew; within them what follows keeps its distance
const LAG = 0.05; // seconds by which a speech may be late as a whole, so that what comes too late is still heard
const APART = 0.06; // seconds by which it may be beside the clocks: a device that stood still for a while is late from then on
const FADE = 0.004; // seconds in which sound ends that is cut

class Speech extends AudioWorkletProcessor {
  constructor() {
    super();
    this.pieces = []; // sound to play: the frame of the context at which each begins, and its samples
    this.last = null; // where the sound ends that came last: by the window's clock, and in time of the context
    this.lag = 0; // seconds by which what plays is late
    this.port.onmessage = ({ data }) => (data.onmessage = (sound) => this.take(sound.data));
  }

  // at: by the window's clock. place: the time of the context that is heard then, as far as it is known.
  take({ at, place, samples }) {
    if (!samples.length) return this.cut(at, place);
    const seconds = samples.length / sampleRate;
    let begin = this.next(at, place);
    const more = Math.max(0, Math.min(currentTime - begin, LAG - this.lag));
    this.lag += more;
    begin += more;
    this.last = { at: at + seconds, time: begin + seconds };
    const lost = Math.min(seconds, currentTime - begin);
    if (lost > 0) this.port.postMessage(lost);
    this.pieces.push({ begin: Math.round(begin * sampleRate), samples });
  }

  next(at, place) {
    const apart = this.last === null ? Infinity : at - this.last.at;
    const follows = apart > -JOINS && apart < SPEECH;
    const caught = Math.min(this.lag, Math.max(0, apart)); // silence makes good what is late
    const time = follows ? this.last.time + (Math.abs(apart) < JOINS ? 0 : apart - caught) : place;
    if (!follows || Math.abs(time - place) > APART) {
      this.lag = 0;
      return place;
    }
    if (apart >= JOINS) this.lag -= caught;
    return time;
  }

  cut(at, place) {
    const time = this.last !== null && at <= this.last.at ? this.last.time - (this.last.at - at) : place;
    const end = Math.max(Math.round(time * sampleRate), currentFrame + Math.round(FADE * sampleRate));
    this.pieces = this.pieces.filter((piece) => piece.begin < end);
    const fade = Math.round(FADE * sampleRate);
    for (const piece of this.pieces) {
      const kept = end - piece.begin;
      piece.samples = piece.samples.slice(0, kept);
      for (let index = Math.max(0, kept - fade); index < piece.samples.length; index += 1) piece.samples[index] *= (kept - index) / fade;
    }
    this.last = null;
  }

  process(inputs, [[out]]) {
    for (const { begin, samples } of this.pieces) {
      for (let index = Math.max(0, begin - currentFrame); index < out.length; index += 1) {
        const from = currentFrame + index - begin;
        if (from >= samples.length) break;
        out[index] = samples[from];
      }
    }
    const until = currentFrame + out.length;
    if (this.pieces.length) this.pieces = this.pieces.filter(({ begin, samples }) => begin + samples.length > until);
    return true;
  }
}

registerProcessor("speech", Speech);
