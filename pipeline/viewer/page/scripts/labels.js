// Words over the canvas: what became of objects, the rings' distances. A label is also a button.

class Labels {
  constructor(box, stage, onPick) {
    this.box = box;
    this.stage = stage;
    this.onPick = onPick;
    this.placed = [];
  }

  // boxes: [number, box] of those to name, the most important first; radii: of the rings.
  show(boxes, radii, ground_z_m) {
    this.box.replaceChildren();
    this.placed = [];
    for (const [number, { outcome, box }] of boxes) {
      const button = element("button", `adv-label adv-${outcome}`, outcome === "withheld" ? OUTCOMES[outcome] : outcome);
      button.type = "button";
      button.tabIndex = -1; // the list of objects is what the keyboard goes through
      button.addEventListener("click", () => this.onPick(number));
      this.add(button, ...cornersAbove(box));
    }
    for (const radius of radii)
      this.add(element("span", "adv-ring", `${radius} m`), [0, -radius, ground_z_m]);
    for (const one of this.placed) Object.assign(one, { width: one.label.offsetWidth, height: one.label.offsetHeight });
    this.place();
  }

  // places: what the label stands above.
  add(label, ...places) {
    this.box.append(label);
    this.placed.push({ label, places });
  }

  // A label that would lie on a more important one is left out.
  place() {
    const taken = [];
    for (const { label, places, width, height } of this.placed) {
      const pixels = places.map((place) => this.stage.pixel(...place)).filter(Boolean);
      const x = sum(pixels.map(([across]) => across)) / pixels.length;
      const y = Math.min(...pixels.map(([, down]) => down)) - 2;
      const isFree = taken.every(([left, low, wide, high]) =>
        Math.abs(x - left) > (width + wide) / 2 || y - height > low || y < low - high);
      const isShown = pixels.length > 0 && isFree;
      label.style.visibility = isShown ? "" : "hidden";
      if (!isShown) continue;
      taken.push([x, y, width, height]);
      label.style.transform = `translate(-50%, -100%) translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }
}

function cornersAbove([x, y, z, length, width, height, yaw]) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([a, b]) => [
    x + (a * length * cos - b * width * sin) / 2, y + (a * length * sin + b * width * cos) / 2, z + height / 2,
  ]);
}

function element(tag, className, text) {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}
