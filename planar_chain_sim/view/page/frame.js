// Reads a frame: see scene.py for its layout.

const HEAD = 6, ZERO = 3, BODY = 8, SEGMENT = 4;

// Return the arms of a frame, null if it belongs to another scene.
export function readFrame(numbers, scene, revision) {
  if (!scene || numbers[0] !== revision) return null;
  let at = 1;
  const take = (count) => numbers.subarray(at, at += count);
  return scene.map((arm) => {
    const [time, tick, kinetic, potential, realTimeFactor, lateness] = take(HEAD);
    const count = arm.joints.length;
    const position = take(count), velocity = take(count), effort = take(count);
    const zeros = rows(take(count * ZERO), ZERO, ([x, y, angle]) => ({x, y, angle}));
    const bodies = rows(take(arm.bodies.length * BODY), BODY, ([x, y, angle, cx, cy, fx, fy, moment]) =>
      ({x, y, angle, cx, cy, fx, fy, moment}));
    for (const [index, body] of bodies.entries()) {
      body.segments = rows(take(arm.bodies[index].segments * SEGMENT), SEGMENT, ([x1, y1, x2, y2]) => ({x1, y1, x2, y2}));
    }
    return {time, tick, kinetic, potential, realTimeFactor, lateness, position, velocity, effort, zeros, bodies};
  });
}

function rows(numbers, width, make) {
  return Array.from({length: numbers.length / width}, (_, k) => make(numbers.subarray(k * width, (k + 1) * width)));
}
