// The cloud: points that an attack left alone, and those that it touched, which travel, appear or fade.

const NEAR = `
  float nearness(vec4 view) { return clamp(30.0 / max(-view.z, 1.0), 0.55, 1.7); }`;

const KEPT_VERTEX = `
  attribute float shade;
  uniform float pixels;
  varying float vShade;
  ${NEAR}
  void main() {
    vec4 view = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * view;
    gl_PointSize = pixels * nearness(view);
    vShade = shade;
  }`;

const KEPT_FRAGMENT = `
  uniform vec3 low, high;
  varying float vShade;
  void main() {
    if (length(gl_PointCoord - 0.5) > 0.5) discard;
    gl_FragColor = vec4(mix(low, high, vShade), 1.0);
    #include <colorspace_fragment>
  }`;

// A moved point is a disc, an added one a diamond, a removed one a ring in the end: colour is not all.
const TOUCHED_VERTEX = `
  attribute vec3 offset;
  attribute float action;
  uniform float pixels, progress, stretch;
  varying float vAction;
  ${NEAR}
  void main() {
    vec4 view = modelViewMatrix * vec4(position + offset * progress * stretch, 1.0);
    gl_Position = projectionMatrix * view;
    gl_Position.z -= 0.0006 * gl_Position.w; // in front of the cloud that it lies in
    float shown = action > ${ADDED - 0.5} ? smoothstep(0.0, 0.4, progress) : 1.0;
    gl_PointSize = pixels * nearness(view) * shown * mix(0.6, 1.0, progress);
    vAction = action;
  }`;

const TOUCHED_FRAGMENT = `
  uniform float progress, glow;
  uniform vec3 moved, removed, added, untouched;
  varying float vAction;
  void main() {
    vec2 place = 2.0 * gl_PointCoord - 1.0;
    float radius = length(place);
    bool isAdded = vAction > ${ADDED - 0.5}, isRemoved = !isAdded && vAction > ${REMOVED - 0.5};
    float edge = isAdded ? abs(place.x) + abs(place.y) : radius;
    float core = 1.0 - smoothstep(0.3, 0.38, edge);
    if (isRemoved) core *= mix(1.0, smoothstep(0.14, 0.22, radius), progress); // hollow
    float halo = glow * mix(0.25, 1.0, progress) * pow(max(0.0, 1.0 - radius), 1.3);
    float alpha = max(core * (isAdded ? progress : 1.0), halo);
    if (alpha < 0.02) discard;
    vec3 colour = isAdded ? added : isRemoved ? removed : moved;
    gl_FragColor = vec4(mix(untouched, colour, mix(0.45, 1.0, progress)), alpha);
    #include <colorspace_fragment>
  }`;

class CloudView {
  constructor(root) {
    this.root = root;
    this.group = new THREE.Group();
    this.kept = new THREE.ShaderMaterial({
      vertexShader: KEPT_VERTEX,
      fragmentShader: KEPT_FRAGMENT,
      uniforms: { pixels: { value: 2 }, low: { value: null }, high: { value: null } },
    });
    this.touched = new THREE.ShaderMaterial({
      vertexShader: TOUCHED_VERTEX,
      fragmentShader: TOUCHED_FRAGMENT,
      transparent: true,
      depthWrite: false,
      uniforms: {
        pixels: { value: 9 }, progress: { value: 0 }, stretch: { value: 1 }, glow: { value: 0.75 },
        moved: { value: null }, removed: { value: null }, added: { value: null }, untouched: { value: null },
      },
    });
    this.trail = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.7 });
    this.recolour();
  }

  recolour() {
    const { low, high } = this.kept.uniforms;
    low.value = colourOf(this.root, "point-low");
    high.value = colourOf(this.root, "point-high");
    for (const name of ["moved", "removed", "added"])
      this.touched.uniforms[name].value = colourOf(this.root, name);
    this.touched.uniforms.untouched.value = low.value;
    this.trail.color = colourOf(this.root, "moved");
  }

  // by: "height" or "intensity", what the points that were left alone are shaded by.
  show(scene, by) {
    this.clear();
    const { position, intensity, action, offset, counts } = scene.points;
    const shade = by === "intensity"
      ? intensity.map((value) => Math.sqrt(value))
      : intensity.map((_, i) => Math.min(1, Math.max(0, (position[3 * i + 2] - scene.ground_z_m) / 3)));
    const from = counts[KEPT];
    this.group.add(
      new THREE.Points(geometry({ position: [position.slice(0, 3 * from), 3], shade: [shade.slice(0, from), 1] }), this.kept),
    );
    if (action.length > from) {
      const touched = new THREE.Points(
        geometry({
          position: [position.slice(3 * from), 3],
          offset: [offset.slice(3 * from), 3],
          action: [action.slice(from), 1],
        }),
        this.touched,
      );
      touched.renderOrder = 2;
      this.group.add(touched);
    }
    this.start = position.slice(3 * from, 3 * (from + counts[MOVED]));
    this.way = offset.slice(3 * from, 3 * (from + counts[MOVED]));
    this.trails = new THREE.LineSegments(
      geometry({ position: [new Float32Array(2 * this.start.length), 3] }), this.trail);
    this.trails.frustumCulled = false;
    this.group.add(this.trails);
  }

  // progress: 0 for the clean cloud, 1 for the attacked one; displacements are drawn `stretch` times as long.
  move(progress, stretch) {
    this.touched.uniforms.progress.value = progress;
    this.touched.uniforms.stretch.value = stretch;
    const ends = this.trails.geometry.getAttribute("position");
    for (let i = 0; i < this.start.length; i++) {
      const place = 6 * Math.floor(i / 3) + (i % 3);
      ends.array[place] = this.start[i];
      ends.array[place + 3] = this.start[i] + this.way[i] * progress * stretch;
    }
    ends.needsUpdate = true;
  }

  // Sizes in pixels of the screen; points of a sparse cloud are larger, and so are few touched ones.
  resize(scene, scale) {
    const [kept, ...touched] = scene.points.counts;
    this.kept.uniforms.pixels.value = (kept > 40_000 ? 1.7 : 2.4) * scale;
    const sizes = [[5_000, 7], [1_000, 9], [200, 11], [-1, 15]];
    this.touched.uniforms.pixels.value = sizes.find(([many]) => sum(touched) > many)[1] * scale;
  }

  clear() {
    for (const each of this.group.children) each.geometry.dispose();
    this.group.clear();
  }
}

function sum(values) {
  return values.reduce((total, value) => total + value, 0);
}

function geometry(attributes) {
  const made = new THREE.BufferGeometry();
  for (const [name, [values, size]] of Object.entries(attributes))
    made.setAttribute(name, new THREE.BufferAttribute(values, size));
  return made;
}
