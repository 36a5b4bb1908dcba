// What lies on the ground: rings of distance, the sensor's vehicle, lanes and trajectories.

const RINGS_M = [20, 40, 60, 80];
const LINE_STYLES = { lane: ["lane", 1.2, false], true: ["true", 2.6, false], believed: ["believed", 2.6, true], claim: ["added", 1.2, true] };

class GroundView {
  constructor(root) {
    this.root = root;
    this.group = new THREE.Group();
    this.scale = 1; // of the widths of lines
  }

  show(scene) {
    this.clear();
    for (const radius of RINGS_M) this.group.add(this.ring(radius, scene.ground_z_m));
    this.group.add(this.arrow(scene.ground_z_m));
    for (const line of scene.lines) this.group.add(this.line(line));
  }

  ring(radius, z) {
    const places = new Float32Array(3 * 180);
    for (let i = 0; i < 180; i++)
      places.set([radius * Math.cos((i * Math.PI) / 90), radius * Math.sin((i * Math.PI) / 90), z], 3 * i);
    return new THREE.LineLoop(
      geometry({ position: [places, 3] }), new THREE.LineBasicMaterial({ color: colourOf(this.root, "ring") }));
  }

  // The sensor's place, pointing forward, as in the bird's-eye pictures.
  arrow(z) {
    const shape = new THREE.Shape([[2.4, 0], [-1.6, 1.1], [-0.7, 0], [-1.6, -1.1]].map(([x, y]) => new THREE.Vector2(x, y)));
    const material = new THREE.MeshBasicMaterial({ color: colourOf(this.root, "ink"), side: THREE.DoubleSide });
    const arrow = new THREE.Mesh(new THREE.ShapeGeometry(shape), material);
    arrow.position.z = z + 0.03;
    return arrow;
  }

  line({ kind, condition, position }) {
    const [colour, width, dashed] = LINE_STYLES[kind];
    const ends = [];
    for (let i = 0; i + 5 < position.length; i += 3) ends.push(...position.subarray(i, i + 6));
    const made = new THREE.LineSegmentsGeometry();
    made.setPositions(ends);
    const lines = new THREE.LineSegments2(
      made, new THREE.LineMaterial({ color: colourOf(this.root, colour), linewidth: width * this.scale, dashed, dashSize: 0.8, gapSize: 0.5, transparent: true }));
    if (dashed) lines.computeLineDistances();
    lines.userData = { role: kind, condition };
    return lines;
  }

  move(progress, shown) {
    for (const each of this.group.children) {
      const { role, condition } = each.userData;
      if (!role) continue; // rings and the arrow
      each.material.opacity = opacityOf(condition, progress);
      each.visible = each.material.opacity > 0.02 && shown(role);
    }
  }

  clear() {
    clearLines(this.group);
  }
}
