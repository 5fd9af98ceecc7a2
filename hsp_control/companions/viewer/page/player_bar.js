// The player's bar: buttons, the time line with its bands, and the keys of docs/companions/view.md.
// Bands on the time line tell when a limit, a singularity or an obstacle acted on the law: one row
// per kind. A band under the pointer, or with the focus, is named with its times; a click goes to
// its start. While the player's time is inside a band, its caption stands above the bar.
"use strict";

class PlayerBar {
  static FRAME = 1 / 30;  // s

  // Add the bar to an element of the page; it is hidden while there is no clip.
  constructor(player, parent) {
    this.player = player;
    const button = (className, title, label, act, path = "") => makeButton(
      {className, title, ariaLabel: label}, act, makeIcon(path));
    this.toggle = button("toggle", "Play, pause (space)", "Play or pause", () => player.toggle());
    this.loop = button("loop", "Repeat (l)", "Repeat", () => player.setLoop(!player.loop),
      "M7 7h9v3l4.6-4.2L16 1.6V4.6H4.6v7H7zM17 17H8v-3l-4.6 4.2L8 22.4v-3h11.4v-7H17z");
    this.timeline = make("input", {className: "timeline", type: "range", step: "any",
                                   ariaLabel: "Time"});
    this.clock = make("output", {className: "clock"});
    this.speed = make("select", {className: "speed", title: "Speed (+ and -)", ariaLabel: "Speed"},
                      ...Player.SPEEDS.map((x) => new Option(`${x} ×`, x)));
    this.bands = make("div", {className: "bands", role: "group",
                              ariaLabel: "Marks on the time line"});
    this.bandName = make("div", {className: "band-name", hidden: true});
    this.bar = make("div", {className: "player", hidden: true},
      button("start", "To the start (home)", "To the start", () => player.seek(player.start),
             "M6 5h2.4v14H6zM20 5v14L9.6 12z"),
      this.toggle, make("div", {className: "track"}, this.timeline, this.bands),
      this.clock, this.speed, this.loop, this.bandName);
    this.moments = make("div", {className: "moments", role: "status"});
    parent.append(this.bar, this.moments);
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
    on(this.bands, "pointerover focusin", ({target}) => this.nameBand(target));
    on(this.bands, "pointerout focusout", () => this.nameBand(document.activeElement));
    onKey((event) => this.actionOf(event));
    player.addEventListener("time", () => this.showTime());
    player.addEventListener("state", () => this.showState());
    this.showState();
  }

  actionOf({key, shiftKey}) {
    const {player} = this;
    const step = shiftKey ? 1 : PlayerBar.FRAME;
    return player.loaded && {
      " ": () => player.toggle(),
      ArrowLeft: () => player.step(-step),
      ArrowRight: () => player.step(step),
      Home: () => player.seek(player.start),
      End: () => player.seek(player.end),
      "+": () => player.faster(),
      "=": () => player.faster(),
      "-": () => player.slower(),
      l: () => player.setLoop(!player.loop),
    }[key];
  }

  showState() {
    const {player, timeline} = this;
    this.bar.hidden = !(player.loaded && player.horizon > player.start);
    this.toggle.querySelector("path").setAttribute(
      "d", player.playing ? "M7 5h3.6v14H7zM13.4 5H17v14h-3.6z" : "M8 5v14l11-7z");
    this.toggle.ariaPressed = player.playing;
    this.loop.ariaPressed = player.loop;
    const known = [...this.speed.options].some(({value}) => Number(value) === player.speed);
    if (!known) this.speed.add(new Option(`${player.speed} ×`, player.speed));
    this.speed.value = player.speed;
    timeline.min = player.start;
    timeline.max = player.horizon;
    this.drawBands();
    this.showTime();
  }

  showTime() {
    const {time, start, end, horizon, loaded, marks} = this.player;
    const share = (t) => `${horizon > start ? (t - start) / (horizon - start) : 0}`;
    this.timeline.value = time;
    this.timeline.style.setProperty("--played", share(time));
    this.timeline.style.setProperty("--available", share(end));
    this.clock.textContent = `${time.toFixed(2)} / ${horizon.toFixed(2)} s`;
    const inside = loaded ? marks.filter(({spans}) =>
      spans.some(([from, to]) => from <= time && time <= to)) : [];
    const told = inside.map(({caption}) => caption).join("\n");
    if (told === this.told) return;
    this.told = told;
    this.moments.replaceChildren(...inside.map(({caption, color}) =>
      make("span", {style: `--color: ${color}`}, caption)));
  }

  // Draw the bands anew if there are others; else the one with the focus would lose it.
  drawBands() {
    const {player} = this, {start, horizon, marks: bands} = player;
    const drawn = JSON.stringify([start, horizon, bands]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const share = (seconds) => `${100 * seconds / (horizon - start || 1)}%`;
    const band = (name, [from, to]) => {
      const label = `${name} ${from.toFixed(2)}–${to.toFixed(2)} s`;
      const mark = make("button", {type: "button", ariaLabel: label,
                                   style: `left: ${share(from - start)}; width: ${share(to - from)}`});
      mark.onclick = ({pointerType}) => {
        player.seek(from);
        if (pointerType === "mouse") mark.blur();  // a finger's tap keeps the name in sight
      };
      return mark;
    };
    // The rows of a comparison are many: they share the space below the rail.
    this.bands.style.setProperty("--pitch", `${Math.min(4, 16 / bands.length)}px`);
    this.bands.replaceChildren(...bands.map(({name, color, spans}) => make(
      "div", {style: `--color: ${color}`}, ...spans.map((span) => band(name, span)))));
    this.nameBand(null);
  }

  // Name a band above it; anything else hides the name.
  nameBand(band) {
    const named = Boolean(band?.matches?.(".bands button"));
    this.bandName.hidden = !named;
    if (!named) return;
    this.bandName.textContent = band.ariaLabel;
    const bar = this.bar.getBoundingClientRect(), box = band.getBoundingClientRect();
    const half = this.bandName.offsetWidth / 2, middle = (box.left + box.right) / 2 - bar.left;
    this.bandName.style.left = `${clamp(middle, half + 4, bar.width - half - 4)}px`;
  }
}
