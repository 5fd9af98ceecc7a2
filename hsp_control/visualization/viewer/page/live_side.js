// The plots of the live page: a run's, while it is computed and after: see viewer/run_plots.py.
"use strict";

{
  const PHONE = "(max-width: 560px)";
  let side = null;  // none before there are plots: a page without a run keeps its look
  let names = null;

  commandHandlers.plots = ({arrays, plots}) => {
    if (!side) {
      side = new Side(player);
      if (matchMedia(PHONE).matches) side.toggle();  // away at first: the scene needs the space
      names = document.createElement("ul");
      names.className = "run-names";
      side.box.append(names);
    }
    side.show(withArrays(plots, arrays.map(unpackArray)));
    tellRuns(plots.runs);
  };

  commandHandlers.no_plots = () => side?.clear();

  // The names of several runs, each with the line that its curves have.
  function tellRuns(runs) {
    const told = runs.length > 1 ? runs : [];
    names.hidden = !told.length;
    names.replaceChildren(...told.map((name, run) => {
      const entry = document.createElement("li");
      entry.append(Plots.sample(run), name);
      return entry;
    }));
  }
}
