// Presenting: the scene, its title and what happens now, as large as the screen.
//
//   p        begins and ends it             escape   ends it
//
// Legend, panels and details are put away. The bar and the pointer go, too, when the pointer
// has rested for two seconds; they come back when it moves, or for the Tab key. Then the camera
// begins to sway about its target, until somebody takes it.
"use strict";

class Presentation {
  static REST = 2000;  // ms

  // `changed` is called when there is more or less space.
  constructor(changed) {
    Object.assign(this, {changed, on: false, full: false, at: "", buttons: []});
    onKey(({key, repeat}) => repeat ? null
      : key === "p" ? () => this.toggle()
        : key === "Escape" && this.on ? () => this.set(false) : null);
    on(window, "pointermove", ({clientX, clientY}) => {
      // A browser also tells of a pointer that rests while the page moves below it.
      const at = `${clientX} ${clientY}`;
      if (at !== this.at) this.wake();
      this.at = at;
    });
    on(window, "pointerdown focusin", () => this.wake());
    on(document, "fullscreenchange", () => {
      if (document.fullscreenElement && !this.on) this.leaveFullScreen();  // it came too late
      else if (document.fullscreenElement) this.full = true;
      else if (this.full) this.set(false);  // its Escape goes to the browser, not to the page
    });
  }

  // Take over a button of a bar, which goes with the pointer while presenting.
  addButton(button) {
    button.ariaPressed = this.on;
    this.buttons.push(onPress(button, () => this.toggle()));
  }

  toggle() { this.set(!this.on); }

  set(presenting) {
    if (presenting === this.on) return;
    this.on = presenting;
    document.body.classList.toggle("presenting", presenting);
    for (const button of this.buttons) button.ariaPressed = presenting;
    // It may not be allowed, such as in a frame: then the window is all there is.
    if (presenting) document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) this.leaveFullScreen();
    this.full = Boolean(presenting && document.fullscreenElement);
    this.wake();
    this.changed();
  }

  leaveFullScreen() { document.exitFullscreen().catch(() => {}); }

  // Show the bar and the pointer, for a while.
  wake() {
    clearTimeout(this.timer);
    document.body.classList.remove("resting");
    if (!this.on) return;
    this.timer = setTimeout(() => {
      document.body.classList.add("resting");
      this.sway();
    }, Presentation.REST);
  }

  sway() {
    if (this.swaying || matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    this.swaying = true;
    const {camera, controls, dom_element: pane} = viewer, home = camera.position.clone();
    const begin = performance.now(), arm = home.clone().sub(controls.target);
    let taken = false;
    on(pane, "pointerdown wheel", () => { taken = true; }, {capture: true, once: true});
    const step = (now) => {
      this.swaying = this.on && !taken && viewer.controls === controls;
      const t = (now - begin) / 1000, angle = 0.3 * Math.sin(0.25 * t) * (1 - Math.exp(-t / 3));
      if (this.swaying) camera.position.copy(arm).applyAxisAngle(camera.up, angle).add(controls.target);
      else if (!taken) camera.position.copy(home);
      viewer.set_dirty();
      if (this.swaying) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
