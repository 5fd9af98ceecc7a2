// The player's control bar and keys: see player.js.
//
//   space       play, pause               home, end   to the start, to the end
//   ← →         1/30 s (with shift 1 s)   + -         faster, slower
//   l           repeat, or play once
//
// bands.js draws into it, presentation.js adds its own key.
"use strict";

class Controls {
  static FRAME = 1 / 30;  // s

  // Add the bar to an element of the page; it is hidden while there is no clip.
  constructor(player, parent) {
    this.player = player;
    this.parent = parent;
    this.bar = document.createElement("div");
    this.bar.className = "player";
    this.bar.hidden = true;
    this.bar.innerHTML = `
      <button class="start" title="To the start (home)" aria-label="To the start">
        <svg viewBox="0 0 24 24"><path d="M6 5h2.4v14H6zM20 5v14L9.6 12z"/></svg></button>
      <button class="toggle" title="Play, pause (space)" aria-label="Play or pause">
        <svg viewBox="0 0 24 24"><path/></svg></button>
      <div class="track"><input class="timeline" type="range" step="any" aria-label="Time">
        <div class="bands" role="group" aria-label="Marks on the time line"></div></div>
      <output class="clock"></output>
      <select class="speed" title="Speed (+ and -)" aria-label="Speed"></select>
      <button class="loop" title="Repeat (l)" aria-label="Repeat">
        <svg viewBox="0 0 24 24"><path d="M7 7h9v3l4.6-4.2L16 1.6V4.6H4.6v7H7zM17 17H8v-3l-4.6
          4.2L8 22.4v-3h11.4v-7H17z"/></svg></button>`;
    parent.append(this.bar);
    const part = (name) => this.bar.querySelector(`.${name}`);
    [this.button, this.timeline, this.clock, this.speed, this.loop] =
      ["toggle", "timeline", "clock", "speed", "loop"].map(part);
    this.speed.append(...Player.SPEEDS.map((x) => new Option(`${x} ×`, x)));

    part("start").onclick = () => player.seek(player.start);
    this.button.onclick = () => player.toggle();
    this.loop.onclick = () => player.setLoop(!player.loop);
    this.speed.onchange = () => {
      player.setSpeed(Number(this.speed.value));
      this.speed.blur();  // return the keyboard to the player
    };
    this.timeline.oninput = () => player.seek(Number(this.timeline.value));
    // Pause while the timeline is dragged.
    this.timeline.onpointerdown = () => {
      const resume = player.playing;
      player.pause();
      addEventListener("pointerup", () => { if (resume) player.play(); }, {once: true});
    };
    addEventListener("keydown", (event) => this.key(event));
    player.addEventListener("time", () => this.showTime());
    player.addEventListener("state", () => this.showState());
    this.showState();
  }

  key(event) {
    const {player} = this;
    const {target} = event;
    const editable = target.matches?.("select, textarea, input:not([type=range], [type=checkbox])");
    if (!player.loaded || editable || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 1 : Controls.FRAME;
    const actions = {
      " ": () => player.toggle(),
      ArrowLeft: () => player.step(-step),
      ArrowRight: () => player.step(step),
      Home: () => player.seek(player.start),
      End: () => player.seek(player.end),
      "+": () => player.faster(),
      "=": () => player.faster(),
      "-": () => player.slower(),
      l: () => player.setLoop(!player.loop),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();  // else a focused button or the timeline would react, too
    action();
  }

  showTime() {
    const {player, timeline} = this;
    const {time, start, end, horizon} = player;
    timeline.value = time;
    const share = (t) => `${horizon > start ? (t - start) / (horizon - start) : 0}`;
    timeline.style.setProperty("--played", share(time));
    timeline.style.setProperty("--available", share(end));
    this.clock.textContent = `${time.toFixed(2)} / ${horizon.toFixed(2)} s`;
  }

  showState() {
    const {player, timeline} = this;
    this.bar.hidden = !(player.loaded && player.horizon > player.start);
    this.button.querySelector("path").setAttribute(
      "d", player.playing ? "M7 5h3.6v14H7zM13.4 5H17v14h-3.6z" : "M8 5v14l11-7z");
    this.button.setAttribute("aria-pressed", player.playing);
    this.loop.setAttribute("aria-pressed", player.loop);
    const known = [...this.speed.options].some(({value}) => Number(value) === player.speed);
    if (!known) this.speed.add(new Option(`${player.speed} ×`, player.speed));
    this.speed.value = player.speed;
    timeline.min = player.start;
    timeline.max = player.horizon;
    this.showTime();
  }
}
