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
    Object.assign(this, {changed, on: false, full: false, at: [NaN, NaN], buttons: []});
    onKey(({key, repeat}) => repeat ? null
      : key === "p" ? () => this.toggle()
        : key === "Escape" && this.on ? () => this.set(false) : null);
    addEventListener("pointermove", ({clientX, clientY}) => {
      // A browser also tells of a pointer that rests while the page moves below it.
      if (clientX === this.at[0] && clientY === this.at[1]) return;
      this.at = [clientX, clientY];
      this.wake();
    });
    on(window, "pointerdown focusin", () => this.wake());
    document.addEventListener("fullscreenchange", () => {
      if (document.fullscreenElement && !this.on) this.leaveFullScreen();  // it came too late
      else if (document.fullscreenElement) this.full = true;
      else if (this.full) this.set(false);  // its Escape goes to the browser, not to the page
    });
  }

  // Add a button to a bar, which goes with the pointer while presenting.
  addButton(bar) {
    const button = makeButton(
      {className: "present", title: "Present (p)", ariaLabel: "Present", ariaPressed: this.on},
      () => this.toggle(),
      makeIcon("M4 4h6v2.2H6.2V10H4zM14 4h6v6h-2.2V6.2H14zM4 14h2.2v3.8H10V20H4zM17.8 14H20v6h-6v-2.2h3.8z"));
    bar.append(button);
    this.buttons.push(button);
  }

  toggle() { this.set(!this.on); }

  set(on) {
    if (on === this.on) return;
    this.on = on;
    document.body.classList.toggle("presenting", on);
    for (const button of this.buttons) button.ariaPressed = on;
    // It may not be allowed, such as in a frame: then the window is all there is.
    if (on) document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) this.leaveFullScreen();
    this.full = Boolean(on && document.fullscreenElement);
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
