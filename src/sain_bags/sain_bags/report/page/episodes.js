// The episodes: one is chosen, shown from above, and listed push by push.

import { drawDistance, drawErrors } from "./charts.js";
import { find, make, onWidth } from "./elements.js";
import { counted, degrees, fineMillimetres, fixed, millimetres } from "./figures.js";
import { goalDistance, wantedName } from "./geometry.js";
import { seriesLegend, topViewLegend } from "./legend.js";
import { Player } from "./player.js";
import { pushFacts, pushRows, shownText, verdictText } from "./pushes.js";
import { TopView } from "./top_view.js";

class Episodes {
  constructor(data) {
    this.data = data;
    this.view = new TopView(find("view"), data);
    this.player = new Player((index) => this.moved(index));
    this.moveCursor = () => {};
    this.buttons = data.episodes.map((episode, place) => this.button(episode, place));
    find("list").replaceChildren(...this.buttons.map((button) => make("li", {}, button)));
    const left = data.totals.episodes - data.episodes.length;
    const more = [left > 0 ? `${counted(left, "later episode")} not listed. The figures include them.` : "", data.idle].filter(Boolean);
    find("more").hidden = !more.length;
    find("more").textContent = more.join(" ");
    const disks = data.episodes.flatMap((episode) => episode.disks);
    find("legend").replaceChildren(...topViewLegend(disks, (name, on) => this.toggle(name, on)));
    onWidth(find("distance"), () => this.drawCharts());
    onWidth(find("errors"), () => this.drawCharts());
    this.choose(Math.max(data.episodes.findIndex((episode) => episode.pushes.length), 0));
  }

  button(episode, place) {
    const dot = { reached: "dot reached", "not reached": "dot missed" }[episode.outcome] ?? "dot";
    const button = make("button", { type: "button", "aria-pressed": "false" },
      make("span", { class: dot, "aria-hidden": "true" }),
      make("span", { class: "name" }, episode.title),
      make("span", { class: "soft" }, counted(episode.counts.executed, "push", "pushes")),
      make("span", { class: "end" }, episode.poses.length ? `${episode.outcome}, ${fineMillimetres(episode.distance)}` : episode.outcome));
    button.addEventListener("click", () => this.choose(place));
    return button;
  }

  choose(place) {
    this.episode = this.data.episodes[place];
    this.push = undefined;
    this.buttons.forEach((button, number) => button.setAttribute("aria-pressed", String(number === place)));
    const { episode } = this, refused = episode.counts.refused ? `, ${episode.counts.refused} refused` : "";
    const turn = episode.turn === null ? "" : `, and ${degrees(episode.turn)} from the heading`;
    const keep = episode.keep.map(({ body, tolerance, moved }) =>
      `; body ${body}, to be kept within ${fineMillimetres(tolerance)}, was moved by ${fineMillimetres(moved)}`).join("");
    const away = `${fineMillimetres(episode.distance)} from it at rest (tolerance ${millimetres(episode.tolerance)})`;
    const goal = episode.poses.length ? `, goal ${episode.outcome}: ${away}${turn}${keep}` : ", without a goal";
    find("episode-title").textContent = `${episode.title}: ${counted(episode.counts.executed, "push", "pushes")}${refused}${goal}`;
    find("shown").textContent = shownText(episode);
    find("verdict").textContent = verdictText(episode);
    this.showMarks();
    find("errors-legend").replaceChildren(...seriesLegend(episode.series));
    find("pushes").replaceChildren(...pushRows(episode, (number) => this.jump(number)));
    this.view.show(episode, 0);
    this.drawCharts();
    this.player.load(episode.frames.time, 0);
  }

  drawCharts() {
    const { episode } = this, distance = find("distance"), errors = find("errors");
    if (!episode) return;
    distance.hidden = !episode.poses.length;
    if (episode.poses.length && distance.clientWidth) this.moveCursor = drawDistance(distance, distance.clientWidth, episode);
    else this.moveCursor = () => {};
    if (this.player.times) this.moveCursor(this.player.index);
    find("errors-card").hidden = !episode.pushes.some((push) => (push.expectedError ?? push.physicsError) !== null);
    if (errors.clientWidth) drawErrors(errors, errors.clientWidth, episode.pushes, (number) => this.jump(number));
  }

  showMarks() {
    const last = Math.max(this.episode.frames.time.length - 1, 1);
    this.marks = this.episode.pushes.map((push, number) => {
      const mark = make("button", { type: "button", class: push.outcome, "aria-label": `Go to push ${number + 1}` }, String(number + 1));
      const before = this.episode.pushes.slice(0, number).filter((other) => other.from === push.from).length;
      mark.style.left = `calc(${(100 * (push.from ?? 0)) / last}% + ${13 * before}px)`;
      mark.addEventListener("click", () => this.jump(number));
      return mark;
    });
    find("marks").replaceChildren(...this.marks);
  }

  // To where a push ended: there its prediction can be compared.
  jump(number) {
    this.player.stop();
    const push = this.episode.pushes[number];
    this.chosen = number;
    this.player.moveTo(push.to ?? push.from ?? 0);
    this.chosen = undefined;
  }

  moved(index) {
    const { episode } = this, started = episode.pushes.findLastIndex((push) => (push.from ?? 0) < index);
    const number = this.chosen ?? Math.max(started, episode.pushes.length ? 0 : -1);
    this.view.moveTo(index);
    this.moveCursor(index);
    const time = fixed(episode.frames.time[index], 2, "s");
    const distance = episode.poses.length ? ` · ${wantedName(episode)} ${fineMillimetres(goalDistance(episode, episode.frames.poses[index]) / 1000)} from the goal` : "";
    find("moment").textContent = `${time}${distance}`;
    find("slider").setAttribute("aria-valuetext", `${time}${number < 0 ? "" : `, push ${number + 1} of ${episode.pushes.length}`}${distance}`);
    if (number !== this.push) this.showPush(number);
  }

  showPush(number) {
    this.push = number;
    const push = this.episode.pushes[number];
    this.view.showPush(push, number + 1);
    this.marks.forEach((mark, place) => mark.setAttribute("aria-current", String(place === number)));
    [...find("pushes").querySelectorAll("tbody tr")].forEach((row, place) => row.setAttribute("aria-current", String(place === number)));
    find("push").hidden = !push;
    if (push) find("push").replaceChildren(...pushFacts(push, number, this.episode));
  }

  toggle(name, on) {
    this.view.shown[name] = on;
    this.view.moveTo(this.player.index);
    this.view.showPush(this.episode.pushes[this.push], this.push + 1);
  }
}

export { Episodes };
