// How Sphinx's search puts its answers in order: pages that explain before names of the code.
const Scorer = {
  objNameMatch: 4,
  objPartialMatch: 2,
  objPrio: { 0: 2, 1: 0, 2: -2 },
  objPrioDefault: 0,
  title: 20,
  partialTitle: 12,
  term: 6,
  partialTerm: 2,
};
