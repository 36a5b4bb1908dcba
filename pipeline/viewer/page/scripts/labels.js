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
    for (const [number, { fate, box: [x, y, z, , , height] }] of boxes) {
      const button = element("button", `adv-label adv-${fate}`, fate);
      button.type = "button";
      button.tabIndex = -1; // the list of objects is what the keyboard goes through
      button.addEventListener("click", () => this.onPick(number));
      this.add(button, [x, y, z + height / 2 + 0.3]);
    }
    this.place();
  }

  add(label, place) {
    this.box.append(label);
    this.placed.push([label, place]);
  }

  place() {
    for (const [label, place] of this.placed) {
      const pixel = this.stage.pixel(...place);
      label.hidden = pixel === null;
      if (pixel) label.style.transform = `translate(-50%, -100%) translate(${pixel[0].toFixed(1)}px, ${pixel[1].toFixed(1)}px)`;
    }
  }
}

function element(tag, className, text) {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}
