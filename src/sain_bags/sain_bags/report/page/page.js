// The page: what was read from the bag, shown.

const data = JSON.parse(find("data").textContent);

function showHeader() {
  const { bag, totals, planning, errors, topics } = data;
  find("name").textContent = bag.name;
  find("facts").textContent = [bag.began, length(bag.duration), counted(bag.messages, "message"),
    counted(topics.length, "topic"), bytes(bag.size)].filter(Boolean).join(" · ");
  const told = topics.map((topic) => topic.missing).filter((missing) => missing !== null);
  const missing = told.length ? told.reduce((sum, count) => sum + count, 0).toLocaleString("en") : UNKNOWN;
  const refused = [totals.refused && `${totals.refused} refused`, totals.unanswered && `${totals.unanswered} without a result`];
  const tiles = [["Messages missing", missing, told.length ? "by their publishers’ numbers" : "their publishers’ numbers do not tell"]];
  if (totals.episodes) tiles.unshift(
    ["Goals reached", `${totals.reached} of ${totals.withGoal}`, counted(totals.episodes, "episode")],
    ["Pushes", totals.executed.toLocaleString("en"), refused.filter(Boolean).join(", ") || "none refused"]);
  if (errors.expected) tiles.splice(2, 0, ["Expected by the planner", fineMillimetres(errors.expected.median), `median error${of(errors.models)}`]);
  if (errors.physics) tiles.splice(-1, 0, ["Expected by physics", fineMillimetres(errors.physics.median), `median error${of(errors.physicsModels)}`]);
  if (planning) tiles.splice(-1, 0, ["Planning", milliseconds(planning.median), `median; 95 %: ${milliseconds(planning.p95)}`]);
  find("tiles").replaceChildren(...tiles.map(([name, value, note]) =>
    make("div", {}, make("dt", {}, name), make("dd", {}, value, make("small", {}, note)))));
  const custom = [["path", bag.path], ...data.custom];
  find("custom").replaceChildren(...custom.flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, value)]));
}

function of(models) {
  return models.length ? `, ${models.join(", ")}` : "";
}

function showFigures() {
  const { planning, errors } = data;
  const predicted = errors.expected || errors.physics;
  find("figures").hidden = !planning && !predicted;
  find("planning-card").hidden = !planning;
  find("distribution-card").hidden = !predicted;
  if (planning) {
    find("planning-note").textContent = `${counted(planning.plans, "plan")} that sent a push; the longest took ${milliseconds(planning.longest)}`;
    onWidth(find("planning"), (width) => drawPlanning(find("planning"), width, planning));
  }
  if (predicted) {
    const parts = [["physics", "physics", errors.physicsModels], ["expected", "planner", errors.models]].filter(([kind]) => errors[kind]);
    find("distribution-note").replaceChildren("Share of pushes predicted to within: ", ...parts.flatMap(([kind, name, models], place) =>
      [...(place ? [", "] : []), swatch(kind), ` ${name}${models.length ? ` (${models.join(", ")})` : ""}`]));
    onWidth(find("distribution"), (width) => drawDistribution(find("distribution"), width, errors));
  }
}

function swatch(kind) {
  return draw("svg", { width: 11, height: 11, viewBox: "0 0 11 11", "aria-hidden": "true" }, draw("rect", { class: kind, width: 11, height: 11, rx: 2.5 }));
}

class Episodes {
  constructor() {
    this.view = new TopView(find("view"), data);
    this.player = new Player((index) => this.moved(index));
    this.moveCursor = () => {};
    this.buttons = data.episodes.map((episode, place) => this.button(episode, place));
    find("list").replaceChildren(...this.buttons.map((button) => make("li", {}, button)));
    const left = data.totals.episodes - data.episodes.length;
    find("more").hidden = left <= 0;
    find("more").textContent = `${counted(left, "later episode")} not shown one by one; the figures are of all.`;
    this.makeLegend();
    onWidth(find("distance"), () => this.drawCharts());
    onWidth(find("errors"), () => this.drawCharts());
    this.choose(Math.max(data.episodes.findIndex((episode) => episode.pushes.length), 0));
  }

  button(episode, place) {
    const dot = { reached: "dot reached", "not reached": "dot missed" }[episode.outcome] ?? "dot";
    const button = make("button", { type: "button", "aria-pressed": "false" },
      make("span", { class: dot, role: "img", "aria-label": episode.outcome, title: episode.outcome }),
      make("span", { class: "name" }, title(episode)),
      make("span", { class: "soft" }, counted(episode.counts.executed + episode.counts.unanswered, "push", "pushes")),
      make("span", { class: "end", title: "from the target to the goal at the end" }, fineMillimetres(episode.distance)));
    button.addEventListener("click", () => this.choose(place));
    return button;
  }

  choose(place) {
    this.episode = data.episodes[place];
    this.push = undefined;
    this.buttons.forEach((button, number) => button.setAttribute("aria-pressed", String(number === place)));
    const { episode } = this, refused = episode.counts.refused ? `, ${episode.counts.refused} refused` : "";
    const goal = episode.goal ? `, ${episode.outcome} to ${millimetres(episode.tolerance)}` : ", no goal was given";
    find("episode-title").textContent = `${title(episode)}: ${counted(episode.counts.executed, "push", "pushes")}${refused}${goal}`;
    find("shown").textContent = shownText(episode);
    find("verdict").textContent = verdictText(episode);
    this.showMarks();
    find("pushes-card").hidden = !episode.pushes.length;
    find("pushes").replaceChildren(...pushRows(episode, (number) => this.jump(number)));
    this.view.show(episode, 0);
    this.drawCharts();
    this.player.load(episode.frames.time, 0);
  }

  drawCharts() {
    const { episode } = this, distance = find("distance"), errors = find("errors");
    if (!episode) return;
    distance.hidden = !episode.goal;
    if (episode.goal && distance.clientWidth) this.moveCursor = drawDistance(distance, distance.clientWidth, episode);
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
    const distance = episode.goal ? ` · target ${fineMillimetres(apart(episode.frames.poses[index][1], episode.goal) / 1000)} from the goal` : "";
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

  makeLegend() {
    const mark = (shape) => draw("svg", { viewBox: "0 0 20 14", "aria-hidden": "true" }, shape);
    const toggle = (name, shape, text) => {
      const box = make("input", { type: "checkbox" });
      box.checked = true;
      box.addEventListener("change", () => {
        this.view.shown[name] = box.checked;
        this.view.moveTo(this.player.index);
        this.view.showPush(this.episode.pushes[this.push], this.push + 1);
      });
      return make("label", {}, box, mark(shape), text);
    };
    const circle = (kind) => draw("circle", { class: kind, cx: 10, cy: 7, r: 6 });
    find("legend").replaceChildren(
      make("span", {}, mark(circle("disk mid")), "mid disk"), make("span", {}, mark(circle("disk target")), "target"),
      make("span", {}, mark(circle("start other")), "start"), make("span", {}, mark(circle("ring")), "goal"),
      toggle("expected", circle("ghost expected"), "expected by the planner"),
      toggle("physics", circle("ghost physics"), "by physics"),
      toggle("paths", draw("path", { class: "path target", d: "M1 11C6 2 12 12 19 3" }), "paths"));
  }
}

showHeader();
showTopics(data);
showFigures();
if (data.episodes.length) {
  find("episodes").hidden = false;
  new Episodes();
}
