// One viewer: its controls, and what is shown now. `root` is the element that fragment.html makes.

const VIEWS = { r: "reset", t: "top", e: "ego" };
const PLAY_MS = 2600; // from the clean to the attacked cloud
const NAMED = ["lost", "displaced", "believed", "claimed", "withheld"]; // outcomes with a label, the first before others
const MOST_LABELS = 60;
const CHOSEN_FIRST = ["lost", "displaced", "claimed", "changed"]; // outcomes of which an object is chosen if nobody chose
const CHOSEN_M = 300; // from the vehicle, at most
const FRAMES_PER_S = 5; // of a time line that plays

class Viewer {
  constructor(root, source) {
    this.root = root;
    this.source = source;
    this.isBag = root.dataset.source === "server"; // and else a part of a report
    this.one = (name) => root.querySelector(`.adv-${name}`);
    this.progress = 1;
    this.stretch = 1;
    this.selected = null;
    this.hidden = new Set();
    this.stage = new Stage(this.one("canvas"), root);
    this.cloud = new CloudView(root);
    this.boxes = new BoxView(root);
    this.ground = new GroundView(root);
    this.labels = new Labels(this.one("labels"), this.stage, (number) => this.select(number));
    const { scene } = this.stage;
    scene.add(this.ground.group, this.cloud.group, this.boxes.group, this.boxes.targets, this.boxes.selection);
    this.stage.onDraw = () => this.labels.place();
    this.stage.onResize = () => this.scene && this.redraw();
    this.connect();
    onThemeChange(() => this.recolour());
  }

  // Shows the frame of a number. While one is on its way, only the last that was asked for comes next: who moves
  // the time line does not wait for every frame in between.
  async open(number) {
    this.number = this.wanted = number;
    this.loading ??= this.load().finally(() => (this.loading = null));
    await this.loading;
  }

  async load() {
    while (this.wanted !== null) {
      const number = this.wanted;
      this.wanted = null;
      try {
        this.show(number, await this.source.scene(number, this.one("option").value));
      } catch (error) {
        this.one("story").replaceChildren(element("p", "adv-lead", `This frame cannot be shown: ${error.message}`));
      }
    }
  }

  // The view stays where it is but for the first frame.
  show(number, scene) {
    const isFirst = !this.scene;
    const kept = this.selected === null ? null : this.scene.boxes[this.selected].id;
    this.scene = scene;
    this.selected = null;
    this.draw();
    this.list();
    if (isFirst) this.look("reset");
    this.select(this.sameOr(kept));
    if (isFirst) this.look("reset"); // now with what was chosen
    this.root.dataset.ready = String(number);
  }

  // The number of the object that was chosen in the frame before; without one, of one that is lost, displaced, claimed
  // or changed: one that is seen, and of these the nearest; or null.
  sameOr(id) {
    const boxes = [...this.scene.boxes.entries()];
    const same = boxes.find(([, box]) => id && box.id === id);
    if (same) return same[0];
    const away_m = ({ box: [x, y] }) => Math.hypot(x, y);
    const rank = ([, box]) => [CHOSEN_FIRST.indexOf(box.outcome), this.stage.pixel(...box.box.slice(0, 3)) ? 0 : 1, away_m(box)];
    const [first] = boxes
      .filter(([, box]) => CHOSEN_FIRST.includes(box.outcome) && away_m(box) < CHOSEN_M)
      .map((one) => [rank(one), one[0]])
      .sort(([a], [b]) => a[0] - b[0] || a[1] - b[1] || a[2] - b[2]);
    return first?.[1] ?? null;
  }

  // What the object is at this place of the slider: on the clean cloud, one that the attack hides is found.
  outcomeNow(box) {
    const isHidden = box.role === "truth" && ["lost", "displaced"].includes(box.outcome);
    return isHidden && this.scene.is_attacked && this.progress < 0.5 ? "found" : box.outcome;
  }

  draw() {
    const { scene } = this;
    this.one("heading").textContent = scene.title;
    this.one("note").textContent = scene.note;
    this.root.classList.toggle("adv-is-attacked", scene.is_attacked);
    this.one("stretching").hidden = !scene.points.counts[MOVED];
    this.boxes.scale = this.ground.scale = this.stage.scale;
    this.cloud.resize(scene, this.stage.scale * this.stage.renderer.getPixelRatio());
    this.cloud.show(scene, this.one("shade").value);
    this.boxes.show(scene);
    this.ground.show(scene);
    this.legend();
    this.move();
  }

  // What the slider and the buttons of the legend change.
  move() {
    const progress = this.scene.is_attacked ? this.progress : 0;
    const shown = (role) => !this.hidden.has(role);
    this.cloud.move(progress, this.stretch);
    this.boxes.move(progress, shown);
    this.ground.move(progress, shown);
    const rank = ([number, { outcome }]) => (number === this.selected ? 0 : 1 + NAMED.indexOf(outcome));
    const named = [...this.scene.boxes.entries()].filter(
      ([number, box]) => (number === this.selected && this.boxes.isShown(box, progress, shown)) ||
        (NAMED.includes(box.outcome) && this.boxes.isShown(box, progress, shown) &&
          (box.role === "claim" || progress >= 0.5)));
    named.sort((a, b) => rank(a) - rank(b)); // else the nearest first, as they come
    const labelled = named.slice(0, MOST_LABELS).map(([number, box]) => [number, { ...box, outcome: this.outcomeNow(box) }]);
    this.labels.show(labelled.filter(([, box]) => OUTCOMES[box.outcome]), RINGS_M, this.scene.ground_z_m);
    this.tell(progress, shown);
    this.one("stretched").hidden = this.stretch === 1 || !this.scene.points.counts[MOVED];
    this.one("stretched").textContent = `displacements × ${this.stretch}`;
    this.stage.draw();
  }

  look(name) {
    const chosen = this.selected === null ? [] : [this.scene.boxes[this.selected].box.slice(0, 3)];
    this.stage.look(name, [...focusOf(this.scene), ...chosen], this.scene.ground_z_m);
  }

  select(number) {
    this.selected = number;
    this.told = null;
    this.one("objects").value = number === null ? "" : String(number);
    this.one("closer").hidden = number === null;
    this.move();
  }

  // The story and the outline of the chosen object, made anew where the slider makes it another.
  tell(progress, shown) {
    const { selected } = this;
    const box = selected === null ? null : this.scene.boxes[selected];
    this.boxes.selection.visible = !box || this.boxes.isShown(box, progress, shown);
    const now = box ? this.outcomeNow(box) : "none";
    if (this.told === now) return;
    this.told = now;
    this.boxes.select(selected, now);
    const story = box
      ? storyOf({ ...box, outcome: now })
      : [element("p", "adv-lead", "Click on a box, or choose an object, to read about it.")];
    this.one("story").replaceChildren(...story);
  }

  // The objects, for those who do not click on a canvas.
  list() {
    const groups = new Map();
    this.scene.boxes.forEach((box, number) => {
      const group = (box.role === "truth" && OUTCOMES[box.outcome]) || box.group;
      groups.set(group, [...(groups.get(group) || []), new Option(box.title, number)]);
    });
    const nothing = new Option("none chosen", "");
    const order = Object.values(OUTCOMES);
    const rank = (name) => (order.indexOf(name) + order.length + 1) % (order.length + 1);
    const grouped = [...groups].sort(([a], [b]) => rank(a) - rank(b)).map(([name, options]) => {
      const made = document.createElement("optgroup");
      made.label = `${name} (${options.length})`;
      made.append(...options);
      return made;
    });
    this.one("objects").replaceChildren(nothing, ...grouped);
  }

  legend() {
    const { boxes, points, lines } = this.scene;
    const has = (role, outcome) => boxes.some((box) => box.role === role && (!outcome || box.outcome === outcome));
    const count = (action) => points.total[action].toLocaleString("en");
    const marks = [
      has("truth") && ["truth", "line", "truth"],
      has("truth", "displaced") && ["displaced", "line", "displaced"],
      has("truth", "lost") && ["lost", "line", "lost"],
      has("prediction") && ["prediction", "line", "predictions"],
      points.total[MOVED] && ["moved", "disc", `moved: ${count(MOVED)}`],
      points.total[ADDED] && ["added", "diamond", `added: ${count(ADDED)}`],
      points.total[REMOVED] && ["removed", "hollow", `removed: ${count(REMOVED)}`],
      boxes.some(({ outcome }) => outcome === "changed") && ["added", "line", "received from the attack"],
      has("claim") && ["claim", "line", "marks of debug topics"],
      has("claim", "withheld") && ["lost", "dashed", "not sent"],
      has("cam") && ["cam", "line", "CAMs"],
      has("ldm") && ["ldm", "dashed", "Local Dynamic Map"],
      ...["lane", "true", "believed"].map((kind) => lines.some((line) => line.kind === kind) && LINE_MARKS[kind]),
    ].filter(Boolean);
    this.one("legend").replaceChildren(...marks.map((mark) => this.mark(...mark)));
  }

  // A line of the legend; those of boxes and lines are buttons that hide them.
  mark(name, shape, text) {
    const isSwitch = ["truth", "prediction", "claim", "cam", "ldm", "lane", "true", "believed"].includes(name);
    const made = element(isSwitch ? "button" : "span", "adv-mark", text);
    made.prepend(element("i", `adv-${shape} adv-${{ claim: "added" }[name] ?? name}`, ""));
    if (!isSwitch) return made;
    made.type = "button";
    made.title = "show or hide";
    made.setAttribute("aria-pressed", String(!this.hidden.has(name)));
    made.addEventListener("click", () => {
      if (!this.hidden.delete(name)) this.hidden.add(name);
      made.setAttribute("aria-pressed", String(!this.hidden.has(name)));
      this.move();
    });
    return made;
  }

  recolour() {
    this.stage.recolour();
    this.cloud.recolour();
    if (this.scene) this.redraw();
  }

  redraw() {
    this.draw();
    this.select(this.selected);
  }

  setProgress(progress) {
    this.progress = progress;
    this.one("progress").value = String(progress);
    this.move();
  }

  // Runs from one end of the slider to the other, until it is there or somebody takes the slider.
  play() {
    const from = this.progress >= 1 ? 0 : this.progress, started = performance.now();
    const run = (this.run = {});
    const step = (now) => {
      if (run !== this.run) return;
      const progress = Math.min(1, from + Math.max(0, now - started) / PLAY_MS);
      this.setProgress(progress);
      if (progress < 1) requestAnimationFrame(step);
      else this.stop();
    };
    this.one("play").setAttribute("aria-pressed", "true");
    requestAnimationFrame(step);
  }

  stop() {
    this.run = null;
    this.one("play").setAttribute("aria-pressed", "false");
  }

  save() {
    const link = document.createElement("a");
    link.href = this.one("canvas").toDataURL("image/png");
    link.download = `${this.scene.name}.png`;
    link.click();
  }
}

// The places that the first view has to show: objects that count, without the farthest, and all that are hidden.
// What an attack claims counts as well, if it is not far away.
function focusOf({ boxes }) {
  const truth = boxes.filter( // the nearest ones first
    ({ role, outcome, box: [x, y] }) => role === "truth" && outcome !== "ignored" && Math.hypot(x, y) < 100);
  const near = truth.slice(0, Math.ceil(0.85 * truth.length));
  const hidden = truth.filter(({ outcome }) => ["lost", "displaced"].includes(outcome));
  const reach_m = { changed: 90, claimed: 90, believed: 160 };
  const claimed = boxes.filter(({ outcome, box: [x, y] }) => Math.hypot(x, y) < (reach_m[outcome] ?? 0));
  const places = [...near, ...hidden, ...claimed].map(({ box }) => box.slice(0, 3));
  return places.length ? places : [[25, 15, 0], [25, -15, 0], [-15, 0, 0]];
}

const LINE_MARKS = {
  lane: ["lane", "line", "lanes"], true: ["true", "line", "true path"], believed: ["believed", "dashed", "believed path"],
};
