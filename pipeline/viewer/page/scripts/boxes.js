// Boxes of the truth, of predictions, and of received messages; and which one a click hits.

// How the boxes of a role, with an outcome, are drawn: name of the colour, width in pixels, dashed or not.
const BOX_STYLES = {
  "truth/found": ["truth", 1.8, false],
  "truth/displaced": ["displaced", 3, false],
  "truth/lost": ["lost", 3, false],
  "truth/missed": ["truth", 1.8, true],
  "truth/ignored": ["ignored", 1.1, false],
  "prediction/hit": ["prediction", 1.8, false],
  "prediction/false": ["prediction", 1.8, true],
  "prediction/ignored": ["prediction", 1, true],
  "truth/": ["truth", 1.8, false],
  "cam/": ["cam", 1.8, false],
  "cam/changed": ["added", 2.6, false],
  "ldm/": ["ldm", 1.8, true],
  "ldm/changed": ["added", 2.6, true],
  "claim/true": ["true", 1.8, false],
  "claim/claimed": ["added", 2.6, false],
  "claim/believed": ["believed", 2.6, false],
  "claim/withheld": ["lost", 1.8, true],
};
const DASH_M = 0.35;

class BoxView {
  constructor(root) {
    this.root = root;
    this.group = new THREE.Group();
    this.targets = new THREE.Group(); // invisible bodies that clicks hit
    this.targets.visible = false;
    this.selection = new THREE.Group();
    this.sets = [];
    this.scale = 1; // of the widths of lines
    this.raycaster = new THREE.Raycaster();
  }

  show(scene) {
    this.clear();
    this.scene = scene;
    const sets = new Map();
    scene.boxes.forEach((box, number) => {
      const key = `${box.role}/${box.outcome}/${box.condition}`;
      sets.set(key, [...(sets.get(key) || []), box]);
      this.targets.add(targetOf(box, number));
    });
    for (const boxes of sets.values()) {
      const [{ role, outcome, condition }] = boxes;
      const [colour, width, dashed] = BOX_STYLES[`${role}/${outcome}`];
      this.sets.push({ role, outcome, condition, lines: this.add(this.group, boxes, colour, width, dashed) });
      // On the clean cloud, an object that the attack hides is one like any other.
      if (scene.is_attacked && (outcome === "lost" || outcome === "displaced"))
        this.sets.push({ role, outcome: "found", condition: "clean", lines: this.add(this.group, boxes, "truth", 1.8, false) });
      if (scene.is_attacked && (outcome === "lost" || outcome === "displaced"))
        this.sets[this.sets.length - 2].condition = "attacked";
    }
  }

  add(group, boxes, colour, width, dashed) {
    const made = new THREE.LineSegmentsGeometry();
    made.setPositions(boxes.flatMap(edgesOf));
    const material = new THREE.LineMaterial({
      color: colourOf(this.root, colour), linewidth: width * this.scale, dashed, dashSize: DASH_M, gapSize: DASH_M, transparent: true,
    });
    const lines = new THREE.LineSegments2(made, material);
    if (dashed) lines.computeLineDistances();
    lines.renderOrder = 1;
    group.add(lines);
    return lines;
  }

  // Fades from the boxes on the clean cloud to those on the attacked one.
  move(progress, shown) {
    for (const { role, condition, lines } of this.sets) {
      const opacity = opacityOf(condition, progress);
      lines.material.opacity = opacity;
      lines.visible = opacity > 0.02 && shown(role);
    }
  }

  // Whether the box can be seen, and clicked, at this place of the slider.
  isShown(box, progress, shown) {
    return opacityOf(box.condition, progress) >= 0.5 && shown(box.role);
  }

  // outcome: what the box is at this place of the slider.
  select(number, outcome) {
    clearLines(this.selection);
    if (number === null) return;
    const box = this.scene.boxes[number];
    const [colour] = BOX_STYLES[`${box.role}/${outcome}`];
    const outline = this.add(this.selection, [box], colour, 4, false);
    outline.material.depthTest = false; // it is seen through everything
    outline.renderOrder = 3;
    const fill = targetOf(box, number);
    fill.material = new THREE.MeshBasicMaterial({
      color: colourOf(this.root, colour), transparent: true, opacity: 0.15, depthWrite: false,
    });
    this.selection.add(fill);
  }

  // The number of the box under a place of the canvas (-1 to 1), or null; objects come before predictions.
  hit(place, camera, canHit) {
    this.raycaster.setFromCamera(place, camera);
    const numbers = this.raycaster
      .intersectObjects(this.targets.children)
      .map((one) => one.object.userData.number)
      .filter((number) => canHit(this.scene.boxes[number]));
    const truth = numbers.find((number) => this.scene.boxes[number].role === "truth");
    return truth ?? numbers[0] ?? null;
  }

  clear() {
    clearLines(this.group);
    clearLines(this.selection);
    this.targets.clear();
    this.sets = [];
  }
}

// How much is seen of what is on the clean cloud alone, or on the attacked one, at this place of the slider.
function opacityOf(condition, progress) {
  return condition === "clean" ? 1 - progress : condition === "attacked" ? progress : 1;
}

function clearLines(group) {
  for (const each of group.children) {
    if (each.geometry !== UNIT_BOX) each.geometry.dispose();
    each.material.dispose();
  }
  group.clear();
}

const UNIT_BOX = new THREE.BoxGeometry(1, 1, 1);
const NO_MATERIAL = new THREE.MeshBasicMaterial();

function targetOf(box, number) {
  const [x, y, z, length, width, height, yaw] = box.box;
  const body = new THREE.Mesh(UNIT_BOX, NO_MATERIAL);
  body.position.set(x, y, z);
  body.scale.set(Math.max(length, 0.6), Math.max(width, 0.6), Math.max(height, 0.1));
  body.rotation.z = yaw;
  body.userData.number = number;
  return body;
}

// Both ends of the twelve edges, and of a line out of the front.
function edgesOf({ role, box: [x, y, z, length, width, height, yaw] }) {
  const place = (along, across, up) => [
    x + along * Math.cos(yaw) - across * Math.sin(yaw), y + along * Math.sin(yaw) + across * Math.cos(yaw), z + up,
  ];
  const [l, w, h] = [length / 2, width / 2, height / 2];
  const floor = [[l, w], [l, -w], [-l, -w], [-l, w]];
  const ends = role === "claim" ? [] : [...place(l, 0, -h), ...place(l + Math.max(0.35 * l, 0.3), 0, -h)];
  floor.forEach(([a, b], i) => {
    const [c, d] = floor[(i + 1) % 4];
    ends.push(...place(a, b, -h), ...place(c, d, -h));
    if (h) ends.push(...place(a, b, h), ...place(c, d, h), ...place(a, b, -h), ...place(a, b, h));
  });
  return ends;
}
