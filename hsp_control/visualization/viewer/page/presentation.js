// Presenting: the scene, its title and what happens now, as large as the screen.
//
//   new Presentation(document.querySelector(".player"), refit);
//
//   p        begins and ends it             escape   ends it
//
// Legend, panels and details are put away. The bar and the pointer go, too, when the pointer
// has rested for two seconds; they come back when it moves, or for the Tab key.
"use strict";

class Presentation {
  static REST = 2000;  // ms

  // `bar` gets a button; `changed()` is called when there is more or less space.
  constructor(bar, changed) {
    this.changed = changed;
    this.on = this.full = false;
    this.at = [NaN, NaN];
    this.button = document.createElement("button");
    this.button.className = "present";
    this.button.type = "button";
    this.button.title = "Present (p)";
    this.button.setAttribute("aria-label", "Present");
    this.button.setAttribute("aria-pressed", "false");
    this.button.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M4 4h6v2.2H6.2V10H4z
      M14 4h6v6h-2.2V6.2H14zM4 14h2.2v3.8H10V20H4zM17.8 14H20v6h-6v-2.2h3.8z"/></svg>`;
    this.button.onclick = ({detail}) => {
      if (detail) this.button.blur();  // return the keyboard to the player
      this.toggle();
    };
    bar.append(this.button);
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("pointermove", ({clientX, clientY}) => {
      // A browser also tells of a pointer that rests while the page moves below it.
      if (clientX === this.at[0] && clientY === this.at[1]) return;
      this.at = [clientX, clientY];
      this.wake();
    });
    for (const kind of ["pointerdown", "focusin"]) addEventListener(kind, () => this.wake());
    document.addEventListener("fullscreenchange", () => {
      if (document.fullscreenElement) this.full = true;
      else if (this.full) this.set(false);  // its Escape goes to the browser, not to the page
    });
  }

  key(event) {
    if (event.key === "Tab") this.wake();
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (event.target.matches?.("select, textarea, input:not([type=range], [type=checkbox])")) return;
    if (event.key === "p") this.toggle();
    else if (event.key === "Escape" && this.on) this.set(false);
  }

  toggle() { this.set(!this.on); }

  set(on) {
    if (on === this.on) return;
    this.on = on;
    document.body.classList.toggle("presenting", on);
    this.button.setAttribute("aria-pressed", on);
    // It may not be allowed, such as in a frame: then the window is all there is.
    if (on) document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) document.exitFullscreen().catch(() => {});
    this.full = Boolean(on && document.fullscreenElement);
    this.wake();
    this.changed();
  }

  // Show the bar and the pointer, for a while.
  wake() {
    clearTimeout(this.timer);
    document.body.classList.remove("resting");
    if (!this.on) return;
    this.timer = setTimeout(() => document.body.classList.add("resting"), Presentation.REST);
  }
}
