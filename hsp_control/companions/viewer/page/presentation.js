// Presenting: the scene, its title and the present event, as large as the screen. Legend, panels and
// details are put away. When the pointer has rested for two seconds, it and the bar go, too, until
// it moves, or for the Tab key; and the camera sways about its target, until the user moves it.

class Presentation {
  static REST = 2000;  // ms

  constructor(changed) {  // called when there is more or less space
    Object.assign(this, {changed, on: false, full: false, buttons: []});
    onKey(({key, repeat}) => repeat ? null
      : key === "p" ? () => this.toggle()
        : key === "Escape" && this.on ? () => this.set(false) : null);
    on(window, "pointermove pointerdown focusin", ({type, movementX, movementY}) => {
      // Browsers also report a resting pointer when the page moves below it.
      if (type !== "pointermove" || movementX || movementY) this.wake();
    });
    on(document, "fullscreenchange", () => {
      const full = Boolean(document.fullscreenElement);
      if (full && !this.on) document.exitFullscreen().catch(() => {});  // it came too late
      else if (this.full && !full) this.set(false);  // its Escape goes to the browser
      else this.full = full;
    });
  }

  addButton(button) { this.buttons.push(onPress(button, () => this.toggle())); }
  toggle() { this.set(!this.on); }

  set(presenting) {
    if (presenting === this.on) return;
    this.on = presenting;
    document.body.classList.toggle("presenting", presenting);
    for (const button of this.buttons) button.ariaPressed = presenting;
    // It may not be allowed, such as in a frame: then the window is used.
    if (presenting) document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) document.exitFullscreen().catch(() => {});
    this.full = false;
    this.wake();
    this.changed();
  }

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
