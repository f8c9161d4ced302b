// The topics of the recording, when their messages came and how late, and how many are missing.

import { draw, find, make } from "./elements.js";
import { UNKNOWN, fixed, length } from "./figures.js";

function showTopics(data) {
  const heads = ["Topic", "Messages", "Rate", "Over time", "Longest gap", "Missing", "Latest"];
  const head = make("tr", {}, ...heads.map((name) => make("th", { scope: "col", class: name === "Over time" ? "left" : null }, name)));
  find("topics").replaceChildren(make("thead", {}, head), make("tbody", {}, ...data.topics.map((topic) => topicRow(topic, data))));
  const lossy = data.topics.filter((topic) => topic.places.length);
  find("gaps").hidden = !lossy.length;
  find("gaps").lastElementChild.replaceChildren(...lossy.map(gapsLine));
}

function topicRow(topic, data) {
  const missing = topic.missing ? "alarm" : "soft";
  const start = topic.gap ? make("small", {}, `from ${length(topic.gapStart)} on`) : null;
  return make("tr", {},
    make("td", { class: "topic" }, topic.name, make("small", {}, topic.type)),
    make("td", { "data-head": "Messages" }, topic.messages.toLocaleString("en")),
    make("td", { "data-head": "Rate" }, topic.rate ? fixed(topic.rate, topic.rate < 1 ? 2 : topic.rate < 10 ? 1 : 0, "Hz") : UNKNOWN),
    make("td", { class: "lane" }, lane(topic, data)),
    make("td", { "data-head": "Gap" }, topic.gap ? length(topic.gap) : UNKNOWN, start),
    make("td", { "data-head": "Missing", class: missing }, topic.missing === null ? UNKNOWN : topic.missing.toLocaleString("en")),
    make("td", { "data-head": "Latest" }, topic.latest ? fixed(1e3 * topic.latest, 1, "ms") : UNKNOWN));
}

function lane(topic, data) {
  const most = Math.max(...topic.counts, 1);
  const cells = topic.counts.flatMap((count, bin) => count
    ? [draw("rect", { class: "count", x: bin, width: 1.04, height: 10, "fill-opacity": (0.25 + 0.75 * Math.sqrt(count / most)).toFixed(2) })] : []);
  const marks = topic.places.map(([time]) => draw("rect", { class: "missing", x: (time / (data.bag.duration || 1)) * data.bins - 0.4, width: 0.8, height: 10 }));
  return draw("svg", { viewBox: `0 0 ${data.bins} 10`, preserveAspectRatio: "none", "aria-hidden": "true" }, ...cells, ...marks);
}

function gapsLine(topic) {
  const parts = topic.places.map(([time, count]) => `${count} before ${fixed(time, 2, "s")}`);
  const rest = topic.missing - topic.places.reduce((sum, [, count]) => sum + count, 0);
  if (rest > 0) parts.push(`${rest.toLocaleString("en")} later`);
  return make("li", {}, make("strong", {}, topic.name), ` ${parts.join(", ")}`);
}

export { showTopics };
