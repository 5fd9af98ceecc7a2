// The player's bar: buttons, the time line with its bands, and the keys of hsp_control/companions/viewer/page.md.
// Each kind of event, such as an active limit, has a row of bands. A band under the pointer, or
// with the focus, is named with its times; a click goes to its start. While the player's time is
// inside a band, its caption stands above the bar.

class PlayerBar {
  constructor(player, bar) {
    Object.assign(this, {player, bar, moments: part(".moments")});
    const names = ["toggle", "loop", "timeline", "clock", "speed", "bands", "band-name"];
    [this.toggle, this.loop, this.timeline, this.clock, this.speed, this.bands, this.bandName] =
      names.map((name) => part(`.${name}`, bar));
    this.speed.append(...Player.SPEEDS.map((x) => new Option(`${x} ×`, x)));
    onPress(part(".start", bar), () => player.seek(player.start));
    onPress(this.toggle, () => player.toggle());
    onPress(this.loop, () => player.set({loop: !player.loop}));
    on(this.speed, "change", () => {
      player.set({speed: Number(this.speed.value)});
      this.speed.blur();  // return the keyboard to the player
    });
    on(this.timeline, "input", () => player.seek(Number(this.timeline.value)));
    on(this.timeline, "pointerdown", () => {  // pause while it is dragged
      const resume = player.playing;
      player.pause();
      on(window, "pointerup", () => { if (resume) player.play(); }, {once: true});
    });
    on(this.bands, "pointerover focusin", ({target}) => this.nameBand(target));
    on(this.bands, "pointerout focusout", () => this.nameBand(document.activeElement));
    onKey((event) => this.actionOf(event));
    on(player, "time", () => this.showTime());
    on(player, "state", () => this.showState());
    this.showState();
  }

  actionOf({key, shiftKey}) {
    const {player} = this;
    const step = shiftKey ? 1 : 1 / 30;  // s
    return player.loaded && {
      " ": () => player.toggle(),
      ArrowLeft: () => player.step(-step),
      ArrowRight: () => player.step(step),
      Home: () => player.seek(player.start),
      End: () => player.seek(player.end),
      "+": () => player.faster(),
      "-": () => player.slower(),
      l: () => player.set({loop: !player.loop}),
    }[key === "=" ? "+" : key];
  }

  showState() {
    const {player, timeline} = this;
    this.bar.hidden = !(player.loaded && player.horizon > player.start);
    this.toggle.ariaPressed = player.playing;
    this.loop.ariaPressed = player.loop;
    this.speed.value = player.speed;
    if (!this.speed.value) {
      this.speed.add(new Option(`${player.speed} ×`, player.speed, false, true));
    }
    Object.assign(timeline, {min: player.start, max: player.horizon});
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
    const captions = inside.map(({caption}) => caption).join("\n");
    if (captions === this.captions) return;
    this.captions = captions;
    this.moments.replaceChildren(...inside.map(({caption, color}) =>
      make("span", {style: `--color: ${color}`}, caption)));
  }

  // Draw the bands anew if there are others; else the one with the focus would lose it.
  drawBands() {
    const {start, horizon, marks} = this.player;
    const drawn = JSON.stringify([start, horizon, marks]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    // Those of a comparison are many: they share the space below the rail.
    this.bands.style.setProperty("--pitch", `${Math.min(4, 16 / marks.length)}px`);
    this.bands.replaceChildren(...marks.map(({name, color, spans}) => make(
      "div", {style: `--color: ${color}`}, ...spans.map((span) => this.band(name, ...span)))));
    this.nameBand(null);
  }

  band(name, from, to) {
    const {player} = this, {start, horizon} = player;
    const share = (seconds) => `${100 * seconds / (horizon - start || 1)}%`;
    const style = `left: ${share(from - start)}; width: ${share(to - from)}`;
    const ariaLabel = `${name} ${from.toFixed(2)}–${to.toFixed(2)} s`;
    const band = make("button", {type: "button", ariaLabel, style});
    on(band, "click", ({pointerType}) => {
      player.seek(from);
      if (pointerType === "mouse") band.blur();  // a finger's tap keeps the name in sight
    });
    return band;
  }

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
