// The plots beside the scene, of live and of exported pages: a page gets a side when it is made.
//
//   const side = new Side(player);
//   side.show(data);      // the plots, or the same with more rows: see plots.js
//   side.clear();         // there are none
//
//   g        shows or hides them; so does the button in the bar
//
// The scene, its caption and the bar are then in `side.stage`, the plots in `side.box`.
"use strict";

class Side {
  constructor(player) {
    this.player = player;
    this.plots = null;
    this.stage = document.createElement("main");
    this.box = document.createElement("aside");
    this.stage.id = "stage";
    this.box.id = "side";
    document.body.classList.add("sided", "without-plots");
    document.body.append(this.stage, this.box);
    const parts = "#meshcat-pane, #caption, #lost, .player, .moments";
    for (const part of document.querySelectorAll(parts)) this.stage.append(part);
    barHeight = 0;  // the bar is below the picture
    this.addButton();
    addEventListener("keydown", (event) => this.key(event));
  }

  addButton() {
    this.button = document.createElement("button");
    this.button.type = "button";
    this.button.className = "side";
    this.button.title = "Plots (g)";
    this.button.setAttribute("aria-label", "Show or hide the plots");
    this.button.innerHTML = '<svg viewBox="0 0 24 24"><path d="M4 4h1.8v14.2H20V20H4zM7.5 '
      + '15l3.6-5 3.2 3 4.4-7 1.6 1-5.6 9-3.3-3.1-2.5 3.4z"/></svg>';
    this.button.onclick = ({detail}) => {
      this.toggle();
      if (detail) this.button.blur();  // return the keyboard to the player
    };
    document.querySelector(".player .present").before(this.button);
  }

  key(event) {
    if (event.key !== "g" || event.ctrlKey || event.metaKey || event.altKey) return;
    if (!document.body.classList.contains("without-plots")) this.toggle();
  }

  // Show or hide the plots; the scene takes their space.
  toggle() { document.body.classList.toggle("alone"); }

  show(data) {
    document.body.classList.remove("without-plots");
    if (this.plots) this.plots.load(data);
    else this.plots = new Plots(this.player, this.box, data);
    return this.plots;
  }

  // Remove the plots; whether the user wants to see any is kept.
  clear() { document.body.classList.add("without-plots"); }
}
