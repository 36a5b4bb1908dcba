// Canvas, camera and views. Drawn only when something changed: a page that lies open costs nothing.

const FIELD_OF_VIEW = 50;

class Stage {
  constructor(canvas, root) {
    this.canvas = canvas;
    this.root = root;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.1, 1500);
    this.camera.up.set(0, 0, 1);
    // The picture is kept for printing and saving.
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.maxDistance = 400;
    this.controls.screenSpacePanning = false;
    this.controls.addEventListener("change", () => this.draw());
    this.onDraw = this.onResize = () => {};
    this.scale = 1; // of points and lines: thicker on a large canvas
    this.recolour();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize(); // the first view fits into the canvas as it is
  }

  recolour() {
    this.renderer.setClearColor(colourOf(this.root, "canvas"));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.scale = Math.min(2, Math.max(0.9, height / 700));
    this.onResize();
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.renderer.render(this.scene, this.camera);
      this.onDraw();
    });
  }

  // name: "reset", "top" or "ego"; places: what is to be seen from the first two.
  look(name, places, ground_z_m) {
    if (name === "ego") this.stand([-9, 0, 2.6], [12, 0, ground_z_m + 1.5]);
    else this.fit(name === "top" ? [-0.001, 0, 1] : [-0.77, 0.14, 0.62], [...places, [0, 0, ground_z_m]], ground_z_m);
  }

  // Looks from a direction, from as near as all the places can be seen, with a margin: from afar, nearer in steps.
  fit(direction, places, ground_z_m) {
    const back = new THREE.Vector3(...direction).normalize();
    const forward = new THREE.Vector3(-back.x, -back.y, 0).normalize();
    const right = new THREE.Vector3(forward.y, -forward.x, 0);
    const steep = Math.tan((FIELD_OF_VIEW / 360) * Math.PI);
    const target = new THREE.Vector3(0, 0, ground_z_m);
    let far = 400;
    for (let step = 0; step < 8; step++) {
      this.stand(target.clone().addScaledVector(back, far).toArray(), target.toArray());
      this.camera.updateMatrixWorld();
      const seen = places.map((place) => new THREE.Vector3(...place).project(this.camera));
      const [wide, high] = ["x", "y"].map((axis) => {
        const values = seen.map((place) => place[axis]);
        return [Math.min(...values), Math.max(...values)];
      });
      target.addScaledVector(right, ((wide[0] + wide[1]) / 2) * steep * this.camera.aspect * far);
      target.addScaledVector(forward, (((high[0] + high[1]) / 2) * steep * far) / Math.max(back.z, 0.3));
      far = Math.max(16, far * Math.max((wide[1] - wide[0]) / 1.7, (high[1] - high[0]) / 1.55));
    }
    this.stand(target.clone().addScaledVector(back, far).toArray(), target.toArray());
  }

  stand(from, to) {
    this.camera.position.set(...from);
    this.controls.target.set(...to);
    this.controls.update();
    this.draw();
  }

  // Closer to a box, from where the camera stands.
  approach([x, y, z, length]) {
    const target = new THREE.Vector3(x, y, z);
    const back = this.camera.position.clone().sub(target).normalize();
    back.z = Math.max(back.z, 0.35);
    this.camera.position.copy(target).addScaledVector(back.normalize(), 3 * Math.max(length, 3));
    this.controls.target.copy(target);
    this.controls.update();
    this.draw();
  }

  // Around the target, by angles in radians.
  turn(around, up) {
    const way = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(way.x, way.y), far = way.length();
    const azimuth = Math.atan2(way.y, way.x) + around;
    const height = Math.min(1.55, Math.max(0.02, Math.atan2(way.z, flat) - up));
    way.set(Math.cos(azimuth) * Math.cos(height), Math.sin(azimuth) * Math.cos(height), Math.sin(height));
    this.camera.position.copy(this.controls.target).addScaledVector(way, far);
    this.controls.update();
    this.draw();
  }

  // Nearer to the target for a factor below 1.
  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  // Pixels from the upper left corner, or null for what lies behind the camera.
  pixel(x, y, z) {
    const place = new THREE.Vector3(x, y, z).project(this.camera);
    if (place.z > 1 || Math.abs(place.x) > 1 || Math.abs(place.y) > 1) return null;
    const { clientWidth, clientHeight } = this.canvas;
    return [((place.x + 1) / 2) * clientWidth, ((1 - place.y) / 2) * clientHeight];
  }

  // Where on the canvas (-1 to 1) an event of the pointer is.
  placeOf(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return new THREE.Vector2(((event.clientX - left) / width) * 2 - 1, 1 - ((event.clientY - top) / height) * 2);
  }
}
