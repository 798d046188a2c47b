// All drones drawn by one call: one mesh has a copy of the drone's shape for each drone, and a texture has the position,
// the attitude and the colour of each drone, taken from the scene's objects, which are not drawn themselves.
// These are not instances, which are drawn one by one without a graphics card.
class Swarm {
  static TEXELS = 4; // of a drone: three rows of its matrix, and its colour

  // `bodies` are the scene's objects, each of which receives the mesh of a drone as its child.
  constructor(viewer, bodies) {
    this.viewer = viewer;
    this.bodies = bodies;
    this.mesh = null;
  }

  // Once a frame, until the scene has all drones.
  step() {
    if (this.mesh || !this.bodies.length) return;
    const parts = this.bodies.map((body) => body.children.find((child) => child.isMesh));
    if (parts.every((part) => part)) this.join(parts);
  }

  // The different corners of a mesh without an index, and for each of its faces the numbers of three of them.
  static corners({ attributes }) {
    const numbers = new Map();
    const corners = [];
    const faces = [];
    for (let corner = 0; corner < attributes.position.count; corner++) {
      const key = Object.values(attributes).flatMap(({ array, itemSize }) =>
        Array.from(array.subarray(itemSize * corner, itemSize * (corner + 1)), (part) => part.toFixed(4))).join();
      if (!numbers.has(key)) numbers.set(key, corners.push(corner) - 1);
      faces.push(numbers.get(key));
    }
    return { corners, faces };
  }

  join(parts) {
    const THREE = MeshCat.THREE;
    const count = parts.length;
    const drone = parts[0].geometry;
    const { corners, faces } = Swarm.corners(drone);
    const size = corners.length;
    const shape = new THREE.BufferGeometry();
    for (const [name, { array, itemSize, normalized }] of Object.entries(drone.attributes)) {
      const copies = new array.constructor(itemSize * size * count);
      corners.forEach((corner, at) => {
        const part = array.subarray(itemSize * corner, itemSize * (corner + 1));
        for (let number = 0; number < count; number++) copies.set(part, itemSize * (number * size + at));
      });
      shape.setAttribute(name, new THREE.BufferAttribute(copies, itemSize, normalized));
    }
    const index = new Uint32Array(faces.length * count);
    for (let number = 0; number < count; number++)
      index.set(faces.map((corner) => number * size + corner), number * faces.length);
    shape.setIndex(new THREE.BufferAttribute(index, 1));
    const rows = new Float32Array(size * count);
    for (let number = 0; number < count; number++) rows.fill((number + 0.5) / count, number * size, (number + 1) * size);
    shape.setAttribute("row", new THREE.BufferAttribute(rows, 1));

    const states = new Float32Array(4 * Swarm.TEXELS * count);
    const texture = new THREE.DataTexture(states, Swarm.TEXELS, count, THREE.RGBAFormat, THREE.FloatType);
    const paint = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
    paint.onBeforeCompile = (shader) => {
      shader.uniforms.states = { value: texture };
      shader.vertexShader = `attribute float row;
        uniform sampler2D states;
        ${shader.vertexShader}`
        .replace("#include <color_vertex>", `#include <color_vertex>
          vec4 x = texture2D(states, vec2(0.125, row));
          vec4 y = texture2D(states, vec2(0.375, row));
          vec4 z = texture2D(states, vec2(0.625, row));
          vColor *= texture2D(states, vec2(0.875, row)).rgb;`)
        .replace("#include <beginnormal_vertex>",
          "vec3 objectNormal = vec3(dot(x.xyz, normal), dot(y.xyz, normal), dot(z.xyz, normal));")
        .replace("#include <begin_vertex>", `vec4 here = vec4(position, 1.0);
          vec3 transformed = vec3(dot(x, here), dot(y, here), dot(z, here));`);
    };
    this.mesh = new THREE.Mesh(shape, paint);
    this.mesh.name = "swarm";
    this.mesh.frustumCulled = false;
    this.mesh.updateMatrixWorld = () => {}; // the texture has positions in the frame of the world
    this.mesh.onBeforeRender = () => {
      for (const [drone, { matrixWorld: { elements: e }, material: { color } }] of parts.entries())
        states.set([e[0], e[4], e[8], e[12], e[1], e[5], e[9], e[13], e[2], e[6], e[10], e[14], color.r, color.g, color.b, 1],
          4 * Swarm.TEXELS * drone);
      texture.needsUpdate = true;
    };
    for (const part of parts) part.visible = false;
    this.viewer.scene.add(this.mesh);
    this.viewer.set_dirty();
  }
}
