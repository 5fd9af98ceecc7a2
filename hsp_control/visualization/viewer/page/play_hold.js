// The dead-man's key of a live loop: the robot moves only while somebody holds it.
//
// It is the space bar, or a button of the bar. The page repeats that it is held; the loop
// stops the robot when it hears nothing, whatever the reason.
"use strict";

class PlayHold {
  static EVERY = 50;  // ms; the loop waits for 500

  constructor(play, bar) {
    this.play = play;
    this.held = false;
    this.button = document.createElement("button");
    this.button.type = "button";
    this.button.className = "hold";
    this.button.title = "The robot moves while this, or the space bar, is held";
    this.button.textContent = "Hold to run";
    bar.prepend(this.button);
    this.button.addEventListener("pointerdown", (event) => {
      this.button.setPointerCapture(event.pointerId);
      this.set(true);
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
      this.button.addEventListener(kind, () => this.set(false));
    }
    this.button.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("blur", () => this.set(false));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.set(false);
    });
  }

  set(held) {
    if (held === this.held) return;
    this.held = held;
    this.button.setAttribute("aria-pressed", held);
    clearInterval(this.timer);
    this.say();
    if (held) this.timer = setInterval(() => this.say(), PlayHold.EVERY);
  }

  say() { this.play.send({do: "hold", held: this.held}); }
}
