// MuJoCo as a peer: mj_forward and mj_step in compiled loops, on a model and data that its Python package owns.
// A C interface for ctypes; benchmark/peers/mujoco_peer.py compiles it against the header of the wheel.
#include <mujoco/mujoco.h>

#define EXPORTED extern "C" __attribute__((visibility("default")))

// `count` forward dynamics of one state, each from a slightly different angle.
EXPORTED void evaluate(const mjModel* model, mjData* data, long count) {
  for (long k = 0; k < count; ++k) {
    mj_forward(model, data);
    data->qpos[0] += 1e-9;
  }
}

EXPORTED void step(const mjModel* model, mjData* data, long count) {
  for (long k = 0; k < count; ++k) mj_step(model, data);
}
