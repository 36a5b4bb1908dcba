// Words over the canvas: what became of objects, the rings' distances. A label is also a button.

class Labels {
  constructor(box, stage, onPick) {
    this.box = box;
    this.stage = stage;
    this.onPick = onPick;
    this.placed = [];
  }

  // boxes: [number, box] of those to name; radii: of the rings.
  show(boxes, radii, ground_z_m) {
    this.box.replaceChildren();
    this.placed = [];
    for (const radius of radii)
      this.add(element("span", "adv-ring", `${radius} m`), [0, -radius, ground_z_m]);
    for (const [number, { fate, box }] of boxes) {
      const button = element("button", `adv-label adv-${fate}`, fate);
      button.type = "button";
      button.tabIndex = -1; // the list of objects is what the keyboard goes through
      button.addEventListener("click", () => this.onPick(number));
      this.add(button, ...cornersAbove(box));
    }
    this.place();
  }

  // places: what the label stands above.
  add(label, ...places) {
    this.box.append(label);
    this.placed.push([label, places]);
  }

  place() {
    for (const [label, places] of this.placed) {
      const pixels = places.map((place) => this.stage.pixel(...place)).filter(Boolean);
      label.hidden = pixels.length === 0;
      const x = sum(pixels.map(([across]) => across)) / pixels.length;
      const y = Math.min(...pixels.map(([, down]) => down)) - 2;
      if (pixels.length) label.style.transform = `translate(-50%, -100%) translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
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
