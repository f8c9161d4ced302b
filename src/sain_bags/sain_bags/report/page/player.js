// Moves through an episode's recorded scenes, by hand or in time.

import { find, icon } from "./elements.js";

const PLAY = "M4 2.5v11l9.5-5.5z", PAUSE = "M3.5 2.5h3v11h-3zM9.5 2.5h3v11h-3z";
const LONGEST_WAIT = 0.5; // [s], a silence in the recording is shown no longer

class Player {
  constructor(onMove) {
    this.onMove = onMove;
    this.slider = find("slider");
    this.button = find("play");
    this.playing = false;
    this.slider.addEventListener("input", () => this.moveTo(Number(this.slider.value)));
    this.button.addEventListener("click", () => (this.playing ? this.stop() : this.play()));
    this.setButton();
  }

  load(times, index) {
    this.stop();
    this.times = times;
    this.slider.max = times.length - 1;
    this.slider.disabled = this.button.disabled = times.length < 2;
    this.moveTo(index);
  }

  moveTo(index) {
    this.index = Math.min(Math.max(index, 0), this.times.length - 1);
    this.slider.value = this.index;
    this.slider.style.setProperty("--done", `${(100 * this.index) / Math.max(this.times.length - 1, 1)}%`);
    this.onMove(this.index);
  }

  play() {
    if (this.index >= this.times.length - 1) this.moveTo(0);
    this.playing = true;
    this.setButton();
    let before = performance.now(), ahead = 0; // [s] of the recording that is to be shown yet
    const step = (now) => {
      if (!this.playing) return;
      ahead += (Number(find("speed").value) * (now - before)) / 1000;
      before = now;
      let index = this.index;
      while (index < this.times.length - 1 && ahead >= this.wait(index)) ahead -= this.wait(index++);
      if (index !== this.index) this.moveTo(index);
      if (index >= this.times.length - 1) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  wait(index) {
    return Math.min(this.times[index + 1] - this.times[index], LONGEST_WAIT);
  }

  stop() {
    this.playing = false;
    this.setButton();
  }

  setButton() {
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    this.button.replaceChildren(icon(this.playing ? PAUSE : PLAY));
  }
}

export { Player };
