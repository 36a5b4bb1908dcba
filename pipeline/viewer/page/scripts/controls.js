// Which control does what, by mouse, touch and keyboard.

Viewer.prototype.connect = function () {
  const { one, stage } = this;
  const on = (name, event, then) => one(name).addEventListener(event, then);
  on("progress", "input", () => {
    this.stop();
    this.setProgress(Number(one("progress").value));
  });
  on("play", "click", () => (this.run ? this.stop() : this.play()));
  on("stretch", "change", () => {
    this.stretch = Number(one("stretch").value);
    this.move();
  });
  on("shade", "change", () => this.draw());
  on("objects", "change", () => this.select(one("objects").value === "" ? null : Number(one("objects").value)));
  on("closer", "click", () => stage.approach(this.scene.boxes[this.selected].box));
  on("save", "click", () => this.save());
  for (const name of Object.values(VIEWS)) on(name, "click", () => this.look(name));
  this.connectFrames();
  this.connectCanvas();
  this.root.addEventListener("keydown", (event) => this.press(event));
};

// A choice among the frames of a report, a time line over a bag.
Viewer.prototype.connectFrames = function () {
  const { one } = this;
  const { frames, options } = this.source;
  one("frames").hidden = this.isBag || frames.length < 2;
  one("timeline").hidden = !this.isBag || frames.length < 2;
  one("frame").replaceChildren(...frames.map((title, number) => new Option(title, number)));
  one("frame").addEventListener("change", () => this.open(Number(one("frame").value)));
  one("time").max = String(frames.length - 1);
  one("time").addEventListener("input", () => this.go(Number(one("time").value)));
  one("run").addEventListener("click", () => this.runTime());
  one("options").hidden = options.length < 2;
  one("option").replaceChildren(...options.map((name, number) => new Option(name, number)));
  one("option").addEventListener("change", () => {
    this.markTime();
    this.open(this.number);
  });
  this.markTime();
};

// The frames that the chosen attack touches, each row with its first and last one.
Viewer.prototype.runs = function () {
  return this.source.attacked[Number(this.one("option").value)] ?? [];
};

// Marks them below the time line; one frame is seen, too.
Viewer.prototype.markTime = function () {
  const runs = this.runs(), last = Math.max(1, this.source.frames.length - 1);
  const marks = this.one("attacked");
  marks.hidden = !runs.length;
  const times = runs.map(([from, to]) => (from === to ? `${from}` : `${from} to ${to}`)).join(", ");
  marks.title = `attacked: frames ${times}`.slice(0, 300);
  marks.replaceChildren(...runs.map(([from, to]) => {
    const mark = element("span", "", "");
    mark.style.left = `${(100 * from) / last}%`;
    mark.style.width = `${(100 * (to - from)) / last}%`;
    return mark;
  }));
};

// To another frame, if there is one of that number.
Viewer.prototype.go = async function (number) {
  if (number < 0 || number >= this.source.frames.length) return;
  this.one("frame").value = this.one("time").value = String(number);
  this.one("now").textContent = this.source.frames[number];
  await this.open(number);
};

// Plays the bag along the time line; a frame waits for the one before it.
Viewer.prototype.runTime = async function () {
  this.isRunning = !this.isRunning;
  this.one("run").setAttribute("aria-pressed", String(Boolean(this.isRunning)));
  if (!this.isRunning) return;
  if (this.number === this.source.frames.length - 1) await this.go(0);
  while (this.isRunning && this.number < this.source.frames.length - 1) {
    const pause = new Promise((then) => setTimeout(then, 1000 / FRAMES_PER_S));
    await Promise.all([this.go(this.number + 1), pause]);
  }
  this.isRunning = false;
  this.one("run").setAttribute("aria-pressed", "false");
};

// A click chooses, a drag turns. In a report, wheel and finger scroll the page until the canvas has the focus.
Viewer.prototype.connectCanvas = function () {
  const { stage } = this;
  const { canvas, controls } = stage;
  let pressed = null;
  const canHit = (box) => this.boxes.isShown(box, this.scene.is_attacked ? this.progress : 0, (role) => !this.hidden.has(role));
  canvas.addEventListener("pointerdown", (event) => {
    pressed = [event.clientX, event.clientY];
    canvas.focus({ preventScroll: true });
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!this.scene || !pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 6) return;
    this.select(this.boxes.hit(stage.placeOf(event), stage.camera, canHit));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!this.scene || event.buttons) return;
    const isOver = this.boxes.hit(stage.placeOf(event), stage.camera, canHit) !== null;
    canvas.style.cursor = isOver ? "pointer" : "grab";
  });
  const take = (isTaken) => {
    controls.enableZoom = isTaken;
    canvas.style.touchAction = isTaken ? "none" : "pan-y";
  };
  take(this.isBag);
  canvas.addEventListener("focus", () => take(true));
  canvas.addEventListener("blur", () => take(this.isBag));
  canvas.addEventListener("webglcontextrestored", () => stage.draw());
};

Viewer.prototype.press = function (event) {
  if (!this.scene || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target.matches("select, input:not([type=range])")) return;
  const key = event.key.toLowerCase();
  const { stage } = this;
  const onCanvas = event.target === stage.canvas;
  const turns = { arrowleft: [-0.12, 0], arrowright: [0.12, 0], arrowup: [0, -0.08], arrowdown: [0, 0.08] };
  if (VIEWS[key]) this.look(VIEWS[key]);
  else if (key === "n") this.go(this.number + 1);
  else if (key === "p") this.go(this.number - 1);
  else if (key === "o") this.selectNext(event.shiftKey ? -1 : 1);
  else if (key === "f" && this.selected !== null) stage.approach(this.scene.boxes[this.selected].box);
  else if (key === "a") this.setProgress(this.progress < 0.5 ? 1 : 0);
  else if (key === "escape") this.select(null);
  else if (onCanvas && turns[key]) stage.turn(...turns[key]);
  else if (onCanvas && (key === "+" || key === "-")) stage.zoom(key === "+" ? 0.85 : 1 / 0.85);
  else return;
  event.preventDefault();
};

// The objects one after the other, in the order of the list.
Viewer.prototype.selectNext = function (step) {
  const list = this.one("objects");
  const place = (list.selectedIndex + step + list.options.length) % list.options.length;
  list.selectedIndex = place;
  this.select(list.value === "" ? null : Number(list.value));
};
