"use strict";

// The flown paths of the drones until now: one mesh with a ribbon for each straight piece. The corners of the pieces have
// their times as attributes, so that a trail grows by setting the shader's time.
class Trails {
  static CORNERS = [[0, -1, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0]];
  static SIZES = { position: 3, begin: 3, end: 3, tint: 3, span: 2 };
  static WIDTH = 2.5; // pixels
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
    this.uniforms = {
      now: { value: 0 }, lasting: { value: 1e9 }, opacity: { value: 0.9 },
      width: { value: Trails.WIDTH }, pixels: { value: new MeshCat.THREE.Vector2(1, 1) },
    };
  }

  // `ways` are the drones' [times, positions, states, colour]; `parent` has the frame of their positions.
  draw(ways, parent) {
    const THREE = MeshCat.THREE;
    const parts = Object.fromEntries(Object.keys(Trails.SIZES).map((name) => [name, []]));
    for (const way of ways) Trails.add(parts, ...way);
    const ribbons = new THREE.BufferGeometry();
    for (const [name, values] of Object.entries(parts))
      ribbons.setAttribute(name, new THREE.BufferAttribute(new Float32Array(values), Trails.SIZES[name]));
    const corners = [];
    for (let first = 0; first < parts.span.length / 2; first += 4)
      corners.push(first, first + 1, first + 2, first, first + 2, first + 3);
    ribbons.setIndex(corners);
    const paint = new THREE.ShaderMaterial({
      uniforms: this.uniforms, vertexShader: Trails.VERTEX, fragmentShader: Trails.FRAGMENT,
      transparent: true, depthWrite: false, side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(ribbons, paint);
    this.mesh.name = "trails";
    this.mesh.frustumCulled = false;
    parent.add(this.mesh);
  }

  // The pieces of one path, cut where its drone changes its state.
  static add(parts, times, positions, states, colour) {
    const at = (time, key) => {
      const between = (time - times[key]) / (times[key + 1] - times[key]);
      return [0, 1, 2].map((axis) => {
        const from = positions[3 * key + axis];
        return from + between * (positions[3 * key + 3 + axis] - from);
      });
    };
    const paints = [[-1, "", colour], ...states];
    let paint = 0;
    for (let key = 0; key + 1 < times.length; key++) {
      let from = times[key];
      while (from < times[key + 1]) {
        while (paint + 1 < paints.length && paints[paint + 1][0] <= from + 1e-3) paint++;
        const next = paint + 1 < paints.length ? paints[paint + 1][0] : Infinity;
        const upto = Math.min(times[key + 1], next);
        const [begin, end, tint] = [at(from, key), at(upto, key), new MeshCat.THREE.Color(paints[paint][2]).toArray()];
        for (const corner of Trails.CORNERS) {
          parts.position.push(...corner);
          parts.begin.push(...begin);
          parts.end.push(...end);
          parts.tint.push(...tint);
          parts.span.push(from, upto);
        }
        from = upto;
      }
    }
  }

  // "all", "none", or a number of seconds.
  show(wanted) {
    if (this.mesh) this.mesh.visible = wanted !== "none";
    this.uniforms.lasting.value = wanted === "all" ? 1e9 : Number(wanted) || 1;
    this.viewer.set_dirty();
  }

  set now(time) { this.uniforms.now.value = time; }

  resize() {
    const size = this.viewer.renderer.getDrawingBufferSize(new MeshCat.THREE.Vector2());
    this.uniforms.pixels.value.set(size.x / 2, size.y / 2);
    this.uniforms.width.value = Trails.WIDTH * this.viewer.renderer.getPixelRatio() / 2;
  }
}
