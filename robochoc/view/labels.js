// Keeps labels readable: none is too small, and of labels that cover each other one is shown. Names of axes have
// priority, then the followed drone, then the drones nearest to the viewer, then the numbers of axes.
class Labels {
  static EVERY = 200; // milliseconds
  static STAYS = 0.9; // factor of the depth of visible labels, so that labels do not flicker
  static ROOM = 0.85; // space of a label, in sizes of its picture
  static HEIGHT_MIN = 16; // pixels of a label's picture: its text is then 11 pixels high
  static LARGER_MAX = 2.5;

  // `names` are the scene's objects in the order of the drones; `axes` is the object with the labels of axes;
  // `size` returns the width and the height of the picture, in pixels.
  constructor(viewer, names, axes, size = () => [innerWidth, innerHeight]) {
    this.viewer = viewer;
    this.size = size;
    this.names = names;
    this.axes = axes;
    this.due = 0;
    this.followed = -1;
    this.pictures = new Map();
  }

  // Postpone the picture in `command`, if it draws the label of a drone: each picture takes milliseconds to load, and of
  // a large team most labels are never visible.
  postpone({ type, path, object }) {
    if (type !== "set_object" || object.object.type !== "Sprite") return;
    const label = this.viewer.scene_tree.find(path.split("/").filter((part) => part)).object;
    if (!this.names.includes(label)) return;
    this.pictures.set(label, object.images[0].url);
    object.images = object.textures = [];
    delete object.materials[0].map;
    object.object.visible = false;
  }

  load(label) {
    const picture = label.children.find((child) => child.isSprite);
    new MeshCat.THREE.TextureLoader().load(this.pictures.get(label), (texture) => {
      picture.material.map = texture;
      picture.material.needsUpdate = true;
      picture.visible = true;
      this.viewer.set_dirty();
    });
    this.pictures.delete(label);
  }

  // Once a frame; labels are updated only every `EVERY` ms.
  step(now) {
    if (now < this.due) return;
    this.due = now + Labels.EVERY;
    this.choose();
  }

  choose() {
    const boxes = [
      ...this.axes.children.map((label) => this.box(label, label.name.includes(" ") ? 1e9 : -1)),
      ...this.names.map((label, number) => this.box(label, number === this.followed ? 0 : null)),
    ].filter((box) => box);
    boxes.sort((one, other) => one.rank - other.rank);
    const shown = [];
    for (const box of boxes)
      if (!shown.some((other) => Math.abs(box.x - other.x) < box.width + other.width && Math.abs(box.y - other.y) < box.height + other.height))
        shown.push(box);
    const wanted = new Set(shown.map((box) => box.label));
    for (const { label } of boxes) {
      if (wanted.has(label) && this.pictures.has(label)) this.load(label);
      if (label.visible !== wanted.has(label)) this.viewer.set_dirty();
      label.visible = wanted.has(label);
    }
  }

  // The position of a label in the picture, and half its width and height; undefined behind the viewer.
  box(label, rank) {
    const THREE = MeshCat.THREE;
    const lens = this.viewer.camera;
    const spot = label.getWorldPosition(new THREE.Vector3());
    const size = label.getWorldScale(new THREE.Vector3());
    const depth = -spot.clone().applyMatrix4(lens.matrixWorldInverse).z;
    if (depth <= lens.near) return null;
    const { x, y } = spot.project(lens);
    const [wide, high] = this.size();
    const half = lens.zoom / 2 / depth / Math.tan(lens.fov * Math.PI / 360); // of a unit of length, in halves of the height
    const larger = this.enlarge(label, Math.min(Math.max(Labels.HEIGHT_MIN / (half * size.y * high), 1), Labels.LARGER_MAX));
    const height = half * size.y;
    return {
      label, x: x * wide / high, y: y + height * (larger - 1),
      rank: rank ?? depth * (label.visible ? Labels.STAYS : 1),
      width: Labels.ROOM * half * size.x * larger, height: Labels.ROOM * height * larger,
    };
  }

  // The label's picture grows upwards, so that it does not cover its object.
  enlarge(label, larger) {
    const picture = label.children.find((child) => child.isSprite);
    if (picture && (picture.renderOrder === 0 || Math.abs(picture.scale.y - larger) > 0.02)) {
      picture.renderOrder = 1; // trails do not cross it
      picture.scale.set(larger, larger, 1);
      picture.center.set(0.5, 0.5 / larger);
      this.viewer.set_dirty();
    }
    return larger;
  }
}
