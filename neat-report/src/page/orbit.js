// A camera that turns about a target and keeps the model upright.

const FIELD_OF_VIEW = (36 * Math.PI) / 180;
const MAX_PITCH = (89 * Math.PI) / 180;

class Orbit {
  /** For the data of a report; `changed` is called after every move. */
  constructor(data, changed) {
    this.data = data;
    this.changed = changed;
    this.up = data.up;
    const helper = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.north = normalize(cross(cross(this.up, helper), this.up));
    this.east = cross(this.north, this.up);
    this.home = this.firstPose();
    this.pose = { ...this.home };
    this.animation = 0;
  }

  /** From where the photographs were taken, and there from where the junctions hide
   * each other least. */
  firstPose() {
    const pose = { target: [0, 0, 0], distance: 1.12 / Math.sin(FIELD_OF_VIEW / 2), yaw: 0, pitch: 0.42 };
    const { views } = this.data;
    const directions = views.map((view) => normalize(view.position));
    const mean = scale(directions.reduce(add, [0, 0, 0]), 1 / Math.max(views.length, 1));
    let reach = Math.PI;
    // Cameras all around say nothing.
    if (norm(mean) > 0.35) {
      const height = dot(normalize(mean), this.up);
      pose.yaw = Math.atan2(dot(mean, this.east), dot(mean, this.north));
      pose.pitch = clamp(Math.asin(clamp(height, -1, 1)), 0.2, 1);
      reach = 0.6;
    }
    const yaws = Array.from({ length: 25 }, (_, i) => pose.yaw + reach * (i / 12 - 1));
    const clarity = yaws.map((yaw) => this.clarity({ ...pose, yaw }));
    pose.yaw = yaws[clarity.indexOf(Math.max(...clarity))];
    return pose;
  }

  /** How far apart the junctions appear: the mean logarithm of the distance from each
   * to its nearest neighbour, of some hundred. */
  clarity(pose) {
    const { right, down } = this.camera(pose);
    const { points } = this.data;
    const stride = Math.ceil(points.length / 200);
    const flat = points.filter((_, i) => i % stride === 0).map((p) => [dot(right, p), dot(down, p)]);
    return flat.reduce((sum, [x, y]) => {
      const distances = flat.map(([u, v]) => Math.hypot(u - x, v - y) || Infinity);
      return sum + Math.log(clamp(Math.min(...distances), 1e-3, 1));
    }, 0);
  }

  /** The camera's centre and axes in model coordinates. */
  camera(pose = this.pose) {
    const { target, distance, yaw, pitch } = pose;
    const level = add(scale(this.north, Math.cos(yaw)), scale(this.east, Math.sin(yaw)));
    const back = add(scale(level, Math.cos(pitch)), scale(this.up, Math.sin(pitch)));
    const forward = scale(back, -1);
    const right = normalize(cross(forward, this.up));
    return { center: add(target, scale(back, distance)), right, down: cross(forward, right), forward };
  }

  /** What the renderer needs for a viewport. */
  view(width, height) {
    const { center, right, down, forward } = this.camera();
    const { distance } = this.pose;
    const focal = this.focal(width, height);
    const near = distance * 0.01;
    const pinhole = { fx: focal, fy: focal, cx: width / 2, cy: height / 2, skew: 0 };
    const projection = pinholeProjection(pinhole, width, height, near, distance + norm(this.pose.target) + this.data.extent);
    const matrix = multiply(projection, cameraFromWorld(right, down, forward, center));
    return { matrix, width, height, near, distance, fog: [distance - 0.9, distance + 1.5, 0.62] };
  }

  /** In pixels: the shorter side of the viewport spans the field of view. */
  focal(width, height) {
    return Math.min(width, height) / 2 / Math.tan(FIELD_OF_VIEW / 2);
  }

  turn(dx, dy) {
    this.stop();
    this.pose.yaw += dx * 0.006;
    this.pose.pitch = clamp(this.pose.pitch + dy * 0.006, -MAX_PITCH, MAX_PITCH);
    this.changed();
  }

  move(dx, dy, width, height) {
    this.stop();
    const { right, down } = this.camera();
    const perPixel = this.pose.distance / this.focal(width, height);
    const shift = add(scale(right, -dx * perPixel), scale(down, -dy * perPixel));
    this.pose.target = add(this.pose.target, shift);
    this.changed();
  }

  /** Zooms by a factor; what is at (x, y) of the viewport stays there. */
  zoom(factor, x, y, width, height) {
    this.stop();
    const before = this.pose.distance;
    this.pose.distance = clamp(before / factor, 0.005, 200);
    const perPixel = (before - this.pose.distance) / this.focal(width, height);
    const { right, down } = this.camera();
    const shift = add(scale(right, (x - width / 2) * perPixel), scale(down, (y - height / 2) * perPixel));
    this.pose.target = add(this.pose.target, shift);
    this.changed();
  }

  /** Makes a point the one that the camera turns about. */
  center(target) {
    this.goTo({ target });
  }

  /** Shows a ball whole. */
  fit(target, radius) {
    this.goTo({ target, distance: Math.max((1.12 * radius) / Math.sin(FIELD_OF_VIEW / 2), 0.02) });
  }

  reset() {
    const turns = Math.round((this.pose.yaw - this.home.yaw) / (2 * Math.PI));
    this.goTo({ ...this.home, yaw: this.home.yaw + turns * 2 * Math.PI });
  }

  /** Moves there in a moment, at once for people who prefer less motion. */
  goTo(goal) {
    this.stop();
    const from = { ...this.pose };
    const to = { ...from, ...goal };
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const begin = performance.now();
    const step = (now) => {
      const t = still ? 1 : clamp((now - begin) / 280, 0, 1);
      const eased = t * t * (3 - 2 * t);
      this.pose = {
        target: mixPoints(from.target, to.target, eased),
        distance: from.distance * (to.distance / from.distance) ** eased,
        yaw: mix(from.yaw, to.yaw, eased),
        pitch: mix(from.pitch, to.pitch, eased),
      };
      this.animation = t < 1 ? requestAnimationFrame(step) : 0;
      this.changed();
    };
    step(begin);
  }

  stop() {
    cancelAnimationFrame(this.animation);
    this.animation = 0;
  }
}
