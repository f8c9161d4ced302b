// The page shows what was read from the bag.

import { drawDistribution, drawPlanning } from "./charts.js";
import { find, onWidth } from "./elements.js";
import { Episodes } from "./episodes.js";
import { counted, milliseconds } from "./figures.js";
import { showHeader } from "./header.js";
import { showLearning } from "./learning.js";
import { seriesLegend } from "./legend.js";
import { showTopics } from "./topics.js";

function showFigures({ planning, errors }) {
  const predicted = errors.expected || errors.physics;
  find("figures").hidden = !planning && !predicted;
  find("planning-card").hidden = !planning;
  find("distribution-card").hidden = !predicted;
  if (planning) {
    find("planning-note").textContent = `${counted(planning.plans, "plan")} that led to a push; longest ${milliseconds(planning.longest)}`;
    onWidth(find("planning"), (width) => drawPlanning(find("planning"), width, planning));
  }
  if (predicted) {
    find("distribution-legend").replaceChildren(...seriesLegend(errors));
    onWidth(find("distribution"), (width) => drawDistribution(find("distribution"), width, errors));
  }
}

const data = JSON.parse(find("data").textContent);
showHeader(data);
showTopics(data);
showFigures(data);
showLearning(data);
if (data.episodes.length) {
  find("episodes").hidden = false;
  new Episodes(data);
}
