// The bar below the scene: pause, step, reset, save, the time and the rate; above it which
// targets are out of reach, the status line, and who steers the robot.
"use strict";

class PlayBar {
  static ICONS = {
    pause: "M7 5h3.6v14H7zM13.4 5H17v14h-3.6z",
    go: "M8 5v14l11-7z",
    step: "M6 5v14l9.6-7zM16.6 5H19v14h-2.4z",
    reset: "M12 5V1.6L6.6 6.2 12 10.8V7.4a5.4 5.4 0 1 1-5.4 5.4H4.2A7.8 7.8 0 1 0 12 5z",
    stop: "M6 6h12v12H6z",
    save: "M10.8 3.5h2.4v8.2l3-3 1.7 1.7L12 16.3 6.1 10.4l1.7-1.7 3 3zM4.5 18.1h15v2.4h-15z",
    panel: "M4 6.2h8.2a3 3 0 0 1 5.6 0H20v2h-2.2a3 3 0 0 1-5.6 0H4zM4 15.8h2.2a3 3 0 0 1 5.6 "
      + "0H20v2h-8.2a3 3 0 0 1-5.6 0H4z",
  };

  constructor(play, parent) {
    this.play = play;
    this.box = document.createElement("div");
    this.box.className = "play-foot";
    const button = (name, label, key) => `
      <button type="button" class="${name}" aria-label="${label}"
        title="${label}${key ? ` (${key})` : ""}">
        <svg viewBox="0 0 24 24" aria-hidden="true"><path fill-rule="evenodd"
          d="${PlayBar.ICONS[name] ?? PlayBar.ICONS.pause}"/></svg></button>`;
    this.box.innerHTML = `
      <div class="play-status away" role="status" hidden></div>
      <div class="play-status message" role="status" hidden></div>
      <div class="play-watching" hidden><span></span>
        <button type="button">Take over</button></div>
      <div class="play-bar" role="toolbar" aria-label="Simulation">
        ${button("toggle", "Pause", "space")}${button("step", "One step", ".")}
        ${button("reset", "Reset", "r")}${button("save", "Save the run", "s")}
        ${button("stop", "Stop the robot")}
        <output class="clock" aria-label="Time"></output>
        <output class="rate" aria-label="Rate"></output>
        ${button("panel", "Controls and plots")}
      </div>`;
    parent.append(this.box);
    presentation.addButton(this.box.querySelector(".play-bar"));
    const part = (selector) => this.box.querySelector(selector);
    [this.away, this.status, this.watching, this.clock, this.rate, this.toggle, this.panel] =
      [".away", ".message", ".play-watching", ".clock", ".rate", ".toggle", ".panel"].map(part);
    this.row = part(".play-bar");
    this.acting = ["toggle", "step", "reset", "save", "stop"].map((name) => part(`.${name}`));
    this.toggle.onclick = () => play.toggle();
    for (const name of ["step", "reset", "save", "stop"]) part(`.${name}`).onclick = () => play.act(name);
    part(".play-watching button").onclick = () => play.takeOver();
    this.panel.onclick = () => play.panel.setOpen(!play.panel.open);
    // After a click the keyboard is the scene's again: space must not press it once more.
    this.box.addEventListener("click", ({detail, target}) => {
      if (detail) target.closest("button")?.blur();
    });
  }

  showState({t, running, rate, message, level, away}) {
    this.clock.textContent = `${t.toFixed(2)} s`;
    this.rate.innerHTML = running
      ? `${Number(rate).toFixed(2)} ×<span> real time</span>`
      : this.play.simulated ? "paused" : "stopped";
    const label = running ? "Pause" : "Go";
    if (this.toggle.getAttribute("aria-label") !== label) {
      this.toggle.setAttribute("aria-label", label);
      this.toggle.title = `${label} (space)`;
      this.toggle.querySelector("path").setAttribute("d", PlayBar.ICONS[running ? "pause" : "go"]);
    }
    PlayBar.say(this.status, message);
    PlayBar.say(this.away, away);
    this.status.classList.toggle("warning", level === "warning");
  }

  static say(line, text) {
    line.hidden = !text;
    if (line.textContent !== (text ?? "")) line.textContent = text ?? "";
  }

  showDrive(mine, taken) {
    this.watching.hidden = mine;
    this.watching.querySelector("span").textContent =
      taken ? "You are watching: another page steers." : "You are watching: nobody steers.";
    for (const button of this.acting) button.disabled = !mine;
  }

  showPanel(open) {
    this.panel.setAttribute("aria-pressed", open);
    this.panel.setAttribute("aria-expanded", open);
  }
}
