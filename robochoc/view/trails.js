"use strict";

// The flown paths of the drones until now: one mesh with a ribbon for each straight piece. The corners of the pieces have
// their times as attributes, so that a trail grows by setting the shader's time.
class Trails {
  static CORNERS = [[0, -1, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0]];
  static SIZES = { position: 3, begin: 3, end: 3, tint: 3, span: 2 };
  static WIDTH = 2.5; // pixels
  static CLOSE = 0.01; // cells: the largest deviation of a trail from the motion
  static VERTEX = `
    attribute vec3 begin, end, tint;
    attribute vec2 span;
    uniform vec2 pixels;
    uniform float width;
    varying float when;
    varying vec3 paint;
    void main() {
      vec4 a = projectionMatrix * modelViewMatrix * vec4(begin, 1.0);
      vec4 b = projectionMatrix * modelViewMatrix * vec4(end, 1.0);
      vec2 along = (b.xy / b.w - a.xy / a.w) * pixels;
      along = length(along) > 0.001 ? normalize(along) : vec2(1.0, 0.0);
      vec4 here = mix(a, b, position.x);
      vec2 aside = vec2(-along.y, along.x) * position.y + along * (position.x - 0.5);
      here.xy += aside * width / pixels * here.w;
      when = mix(span.x, span.y, position.x);
      paint = tint;
      gl_Position = here;
    }`;
  static FRAGMENT = `
    uniform float now, lasting, opacity;
    varying float when;
    varying vec3 paint;
    void main() {
      float age = now - when;
      if (age < 0.0 || age > lasting) discard;
      gl_FragColor = vec4(paint, opacity * (1.0 - 0.8 * smoothstep(0.3, 1.0, age / lasting)));
    }`;

  constructor(viewer) {
    this.viewer = viewer;
    this.begins = [];
    this.uniforms = {
      now: { value: 0 }, lasting: { value: 1e9 }, opacity: { value: 0.9 },
      width: { value: Trails.WIDTH }, pixels: { value: new MeshCat.THREE.Vector2(1, 1) },
    };
  }

  // `ways` are the drones' [times, positions, states, colour]; `parent` has the frame of their positions.
  draw(ways, parent) {
    const THREE = MeshCat.THREE;
    const pieces = ways.flatMap((way) => Trails.pieces(...way)).sort((one, other) => one.span[0] - other.span[0]);
    this.begins = pieces.map(({ span }) => span[0]);
    const ribbons = new THREE.BufferGeometry();
    for (const [name, size] of Object.entries(Trails.SIZES)) {
      const values = pieces.flatMap((piece) => Trails.CORNERS.flatMap((corner) => piece[name] ?? corner));
      ribbons.setAttribute(name, new THREE.BufferAttribute(new Float32Array(values), size));
    }
    ribbons.setIndex(pieces.flatMap((_, number) => [0, 1, 2, 0, 2, 3].map((corner) => 4 * number + corner)));
    const paint = new THREE.ShaderMaterial({
      uniforms: this.uniforms, vertexShader: Trails.VERTEX, fragmentShader: Trails.FRAGMENT,
      transparent: true, depthWrite: false, side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(ribbons, paint);
    this.mesh.name = "trails";
    this.mesh.frustumCulled = false;
    parent.add(this.mesh);
  }

  // The pieces of one path, in few keys, cut where its drone changes its state.
  static pieces(times, positions, states, colour) {
    const at = (time, key, next) => {
      const between = (time - times[key]) / (times[next] - times[key]);
      return [0, 1, 2].map((axis) => {
        const from = positions[3 * key + axis];
        return from + between * (positions[3 * next + axis] - from);
      });
    };
    const close = (key, next) => {
      for (let middle = key + 1; middle < next; middle++) {
        const spot = at(times[middle], key, next);
        if (Math.hypot(...spot.map((part, axis) => part - positions[3 * middle + axis])) > Trails.CLOSE) return false;
      }
      return true;
    };
    const paints = [[-1, "", colour], ...states];
    const pieces = [];
    let paint = 0;
    for (let key = 0, next = 1; next < times.length; key = next++) {
      while (next + 1 < times.length && close(key, next + 1)) next++;
      let from = times[key];
      while (from < times[next]) {
        while (paint + 1 < paints.length && paints[paint + 1][0] <= from + 1e-3) paint++;
        const upto = Math.min(times[next], paint + 1 < paints.length ? paints[paint + 1][0] : Infinity);
        const tint = new MeshCat.THREE.Color(paints[paint][2]).toArray();
        pieces.push({ begin: at(from, key, next), end: at(upto, key, next), tint, span: [from, upto] });
        from = upto;
      }
    }
    return pieces;
  }

  // "all", "none", or a number of seconds.
  show(wanted) {
    if (this.mesh) this.mesh.visible = wanted !== "none";
    this.uniforms.lasting.value = wanted === "all" ? 1e9 : Number(wanted) || 1;
    this.viewer.set_dirty();
  }

  // Pieces that begin later are not drawn.
  set now(time) {
    this.uniforms.now.value = time;
    let [begun, more] = [0, this.begins.length];
    while (begun < more) {
      const middle = (begun + more) >> 1;
      if (this.begins[middle] <= time) begun = middle + 1; else more = middle;
    }
    this.mesh?.geometry.setDrawRange(0, 6 * begun);
  }

  resize() {
    const size = this.viewer.renderer.getDrawingBufferSize(new MeshCat.THREE.Vector2());
    this.uniforms.pixels.value.set(size.x / 2, size.y / 2);
    this.uniforms.width.value = Trails.WIDTH * this.viewer.renderer.getPixelRatio() / 2;
  }
}
