// The head of the page: the recording and its figures.

import { find, make } from "./elements.js";
import { UNKNOWN, bytes, counted, fineMillimetres, length, milliseconds } from "./figures.js";

function showHeader(data) {
  const { bag, topics } = data;
  find("name").textContent = bag.name;
  find("facts").textContent = [bag.began, length(bag.duration), counted(bag.messages, "message"),
    counted(topics.length, "topic"), bytes(bag.size)].filter(Boolean).join(" · ");
  find("crcs").textContent = bag.crcs ? "after a CRC check of each chunk" : "which has no CRCs: damage inside messages is not detected";
  find("notice").textContent = data.notice;
  find("notice").hidden = !data.notice;
  find("tiles").replaceChildren(...tiles(data).map(([name, value, note]) =>
    make("div", {}, make("dt", {}, name), make("dd", {}, value, make("small", {}, note)))));
  const custom = [["path", bag.path], ...data.custom];
  find("custom").replaceChildren(...custom.flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, value)]));
}

function tiles({ totals, planning, errors, topics }) {
  const found = [];
  if (totals.episodes) {
    const refused = [totals.refused && `${totals.refused} refused`, totals.unanswered && `${totals.unanswered} without a result`];
    found.push(
      ["Goals reached", totals.withGoal ? `${totals.reached} of ${totals.withGoal}` : UNKNOWN, counted(totals.episodes, "episode")],
      ["Pushes", totals.executed.toLocaleString("en"), refused.filter(Boolean).join(", ") || "0 refused"]);
  }
  if (errors.physics) found.push(["Error of physics", fineMillimetres(errors.physics.median), `median${of(errors.physicsModels)}`]);
  if (errors.expected) found.push(["Error of the planner", fineMillimetres(errors.expected.median), `median${of(errors.models)}`]);
  if (planning) found.push(["Planning time", milliseconds(planning.median), `median; 95 %: ${milliseconds(planning.p95)}`]);
  const counts = topics.map((topic) => topic.missing).filter((missing) => missing !== null);
  const missing = counts.length ? counts.reduce((sum, count) => sum + count, 0).toLocaleString("en") : UNKNOWN;
  found.push(["Messages missing", missing, counts.length ? "by sequence number" : "no sequence numbers"]);
  return found;
}

function of(models) {
  return models.length ? `, ${models.join(", ")}` : "";
}

export { showHeader };
