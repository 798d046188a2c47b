// Draws the picture of a viewer. Without a graphics card, half of the time of a frame is for antialiasing, and a quarter
// for the light of each pixel. Therefore light is computed for each corner, and without a graphics card only a picture
// that stands still has antialiasing.
class Picture {
  static STILL = 250; // milliseconds without a change
  static SAMPLES = 4;
  static SOFTWARE = /swiftshader|llvmpipe|softpipe|basic render|software/i;

  // A renderer for the constructor of the viewer, which adds its canvas to `parent`.
  static renderer(parent) {
    const probe = document.createElement("canvas").getContext("webgl2");
    const names = probe?.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? probe?.RENDERER;
    const antialias = !Picture.SOFTWARE.test(probe?.getParameter(names));
    probe?.getExtension("WEBGL_lose_context")?.loseContext();
    const renderer = new MeshCat.THREE.WebGLRenderer({ alpha: true, antialias });
    parent.append(renderer.domElement);
    return renderer;
  }

  constructor(viewer) {
    const { renderer } = viewer;
    this.viewer = viewer;
    this.due = Infinity;
    this.draw = viewer.render.bind(viewer);
    const place = viewer.set_object.bind(viewer);
    viewer.set_object = (path, object) => place(path, object.isMesh ? Picture.matt(object) : object);
    if (renderer.getContextAttributes().antialias || !renderer.capabilities.isWebGL2) return;
    viewer.render = () => { this.due = performance.now() + Picture.STILL; this.draw(); };
  }

  // The mesh with flat faces, each of which has corners of its own.
  static matt(mesh) {
    const { color, opacity, transparent, side, depthWrite, vertexColors } = mesh.material;
    mesh.geometry = mesh.geometry.toNonIndexed();
    mesh.geometry.computeVertexNormals();
    mesh.material = new MeshCat.THREE.MeshLambertMaterial({ color, opacity, transparent, side, depthWrite, vertexColors });
    return mesh;
  }

  // Once a frame.
  step(now) {
    if (now < this.due || this.viewer.needs_render) return;
    this.due = Infinity;
    const THREE = MeshCat.THREE;
    const { renderer } = this.viewer;
    const { x, y } = renderer.getDrawingBufferSize(new THREE.Vector2());
    const format = { format: THREE.RGBAFormat, stencilBuffer: true }; // then depth has 24 bits, otherwise 16
    const target = new THREE.WebGLMultisampleRenderTarget(x, y, format);
    target.samples = Picture.SAMPLES;
    const copy = new THREE.Mesh(
      new THREE.PlaneGeometry(2, 2),
      new THREE.MeshBasicMaterial({ map: target.texture, transparent: true, blending: THREE.NoBlending, depthTest: false }));
    renderer.setRenderTarget(target);
    this.draw();
    renderer.setRenderTarget(null);
    renderer.render(copy, new THREE.OrthographicCamera(-1, 1, 1, -1, -1, 1));
    for (const used of [target, copy.geometry, copy.material]) used.dispose();
  }
}
