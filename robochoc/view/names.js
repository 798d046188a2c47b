// Whose name is written beside it: of names that would cover each other, that of the drone nearest to the viewer.
class Names {
  static EVERY = 200; // milliseconds
  static STAYS = 0.9; // so much nearer counts whose name is there already: names do not flicker
  static ROOM = 0.85; // in which a name stands alone, in sizes of its picture

  // `names` are the scene's objects, in the order of the drones.
  constructor(viewer, names) {
    this.viewer = viewer;
    this.names = names;
    this.due = 0;
    this.followed = -1;
  }

  // Once a frame. What moves slowly needs no more than a few states a second.
  step(now) {
    if (now < this.due) return;
    this.due = now + Names.EVERY;
    this.choose();
  }

  choose() {
    const boxes = this.names.map((name, number) => this.box(name, number)).filter((box) => box);
    boxes.sort((one, other) => one.rank - other.rank);
    const shown = [];
    for (const box of boxes)
      if (!shown.some((other) => Math.abs(box.x - other.x) < box.width + other.width && Math.abs(box.y - other.y) < box.height + other.height))
        shown.push(box);
    const wanted = new Set(shown.map((box) => box.name));
    for (const { name } of boxes) {
      if (name.visible !== wanted.has(name)) this.viewer.set_dirty();
      name.visible = wanted.has(name);
    }
  }

  // Where a name is in the window, half as wide and as high as its text; nothing behind the viewer.
  box(name, number) {
    const THREE = MeshCat.THREE;
    const lens = this.viewer.camera;
    const spot = name.getWorldPosition(new THREE.Vector3());
    const size = name.getWorldScale(new THREE.Vector3());
    const depth = -spot.clone().applyMatrix4(lens.matrixWorldInverse).z;
    if (depth <= lens.near) return null;
    const { x, y } = spot.project(lens);
    const half = Names.ROOM / 2 / depth / Math.tan(lens.fov * Math.PI / 360);
    const rank = number === this.followed ? 0 : depth * (name.visible ? Names.STAYS : 1);
    // In halves of the window's height.
    return { name, rank, x: x * innerWidth / innerHeight, y, width: half * size.x, height: half * size.y };
  }
}
