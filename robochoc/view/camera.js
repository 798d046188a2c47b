// The camera of the scene. Lengths are meshcat's: the scene has radius 1; y is up.
class Camera {
  static FROM = { overview: [0.7, 0.42, 1], top: [0, 1, 0.001], front: [0, 0.16, 1] };
  static UPRIGHT = [0.4, 0.55, 1]; // the overview if the window is higher than wide
  static ROOM = 1.05; // size of the view, in sizes of the scene
  static NEAR = 7; // cells that are visible around a followed drone
  static TURN = 450; // milliseconds

  // `free` returns the part of the window that nothing else covers; `corners` are points around everything visible.
  constructor(viewer, corners, cell, free, still) {
    const THREE = MeshCat.THREE;
    this.viewer = viewer;
    this.corners = corners.map(([x, y, z]) => new THREE.Vector3(x, z, -y)); // in meshcat's frame z is up
    this.cell = cell;
    this.free = free;
    this.still = still;
    this.view = "overview";
    this.followed = null;
    this.at = new THREE.Vector3();
    this.turning = null;
    viewer.controls.addEventListener("start", () => {
      this.turning = null;
      if (this.view !== "follow") this.say(null);
    });
  }

  onview = () => {};

  say(view) {
    this.view = view;
    this.onview(view);
  }

  get lens() { return this.viewer.camera; }

  // Turn to a view, by its name.
  see(view, atOnce = false) {
    this.followed = null;
    this.say(view);
    const upright = view === "overview" && this.part.y > 1.2 * this.part.x;
    this.turn(...this.from(upright ? Camera.UPRIGHT : Camera.FROM[view]), atOnce);
  }

  // Follow `drone`, an object of the scene.
  follow(drone) {
    this.followed = drone;
    this.say("follow");
    drone.getWorldPosition(this.at);
    const distance = Camera.NEAR * this.cell / 2 / Math.tan(this.lens.fov * Math.PI / 360);
    const away = new MeshCat.THREE.Vector3(...Camera.FROM.overview).normalize().multiplyScalar(distance);
    this.turn(away.add(this.at), this.at.clone());
  }

  // After a change of the window: keep the scene in the middle of its free part.
  fit() {
    const { left, top, right, bottom } = this.free();
    const [width, height] = [innerWidth, innerHeight];
    this.part = { x: Math.max(right - left, 50) / height, y: Math.max(bottom - top, 50) / height };
    this.lens.setViewOffset(width, height, (width - left - right) / 2, (height - top - bottom) / 2, width, height);
    if (this.view in Camera.FROM) this.see(this.view, true);
    this.viewer.set_dirty();
  }

  // The nearest position in a direction from which all corners are visible, with the point in the middle.
  from(direction) {
    const THREE = MeshCat.THREE;
    const back = new THREE.Vector3(...direction).normalize();
    const right = new THREE.Vector3(0, 1, 0).cross(back).normalize();
    const up = new THREE.Vector3().crossVectors(back, right);
    const seen = this.corners.map((corner) => [corner.dot(right), corner.dot(up), corner.dot(back)]);
    const half = Math.tan(this.lens.fov * Math.PI / 360) / Camera.ROOM;
    const shift = [0, 0];
    // The least and the greatest slope of lines of sight along an axis of the picture, from a distance.
    const slopes = (axis, distance) => {
      const all = seen.map((corner) => (corner[axis] - shift[axis]) / (distance - corner[2]));
      return [Math.min(...all), Math.max(...all)];
    };
    const fits = (distance) => [this.part.x, this.part.y].every((part, axis) => {
      for (let round = 0; round < 6; round++) {
        const [least, most] = slopes(axis, distance);
        shift[axis] += distance * (least + most) / 2;
      }
      const [least, most] = slopes(axis, distance);
      return most - least <= 2 * half * part;
    });
    let [near, far] = [Math.max(...seen.map((corner) => corner[2])) + 0.05, 60];
    for (let round = 0; round < 30; round++) {
      const middle = (near + far) / 2;
      if (fits(middle)) far = middle; else near = middle;
    }
    fits(far);
    const target = right.multiplyScalar(shift[0]).addScaledVector(up, shift[1]);
    return [back.multiplyScalar(far).add(target), target];
  }

  turn(position, target, atOnce = false) {
    const { controls } = this.viewer;
    if (atOnce || this.still.matches) {
      this.lens.position.copy(position);
      controls.target.copy(target);
      this.turning = null;
    } else
      this.turning = { position, target, begun: performance.now(), from: this.lens.position.clone(), to: controls.target.clone() };
    this.viewer.set_dirty();
  }

  // Once a frame: continue turning, and following a drone. True as long as the camera moves.
  step(time) {
    const { controls } = this.viewer;
    if (this.followed) {
      const moved = this.followed.getWorldPosition(new MeshCat.THREE.Vector3()).sub(this.at);
      this.at.add(moved);
      if (this.turning) { // both ends of the turn move with the drone
        this.turning.position.add(moved);
        this.turning.target.add(moved);
      } else {
        this.lens.position.add(moved);
        controls.target.add(moved);
      }
    }
    if (!this.turning) return false;
    const { position, target, begun, from, to } = this.turning;
    const part = Math.min(Math.max((time - begun) / Camera.TURN, 0), 1);
    const eased = part * part * (3 - 2 * part);
    controls.target.lerpVectors(to, target, eased);
    // Around the target, not straight through the scene.
    const away = from.clone().sub(to);
    const wanted = position.clone().sub(target);
    const length = away.length() + eased * (wanted.length() - away.length());
    away.normalize().lerp(wanted.normalize(), eased).normalize();
    this.lens.position.copy(controls.target).addScaledVector(away, length);
    if (part === 1) this.turning = null;
    this.viewer.set_dirty();
    return true;
  }
}
