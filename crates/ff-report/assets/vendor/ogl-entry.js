// The parts of OGL that the replay uses; vendor.sh bundles them.
export { Box } from 'ogl/src/extras/Box.js';
export { Camera } from 'ogl/src/core/Camera.js';
export { Cylinder } from 'ogl/src/extras/Cylinder.js';
export { Geometry } from 'ogl/src/core/Geometry.js';
export { Mesh } from 'ogl/src/core/Mesh.js';
export { Orbit } from 'ogl/src/extras/Orbit.js';
export { Program } from 'ogl/src/core/Program.js';
export { Quat } from 'ogl/src/math/Quat.js';
export { Renderer } from 'ogl/src/core/Renderer.js';
export { Sphere } from 'ogl/src/extras/Sphere.js';
export { Transform } from 'ogl/src/core/Transform.js';
export { Vec3 } from 'ogl/src/math/Vec3.js';
