// The recursion of equations.md 6.2 for the commonest scene: a serial chain whose links turn and do nothing else.
// Numbers of one kind lie side by side, so whatever depends on one link alone is computed for several links at once.
// The chain of dependent operations from link to link is short: from pivot to pivot one division and two
// multiplications.
#pragma once

#include <vector>

#include "recursive.hpp"
#include "wide.hpp"

namespace planar_chain {

// Scale of the pivot of a link that carries `next` by a plain rotation: J_i + M_w |R_w|^2 (equations.md 7).
template <class Real>
inline Real pivot_scale(const LinkOf<Real>& link, const LinkOf<Real>& next) {
  return link.inertia + next.outboard_mass * (next.offset_x * next.offset_x + next.offset_y * next.offset_y);
}

template <class Real>
class SerialRecursionOf final : public WideForm<SerialRecursionOf<Real>, Real> {
 public:
  static bool holds_for(const ChainOf<Real>& chain) {
    for (int i = 1; i <= chain.link_count(); ++i) {
      const LinkOf<Real>& link = chain.links[i];
      if (link.carrier != i - 1 || !link.turns() || link.slides() || link.has_rotor()) return false;
    }
    return true;
  }

  explicit SerialRecursionOf(const ChainOf<Real>& chain)
      : refined_(chain.refined), count_(chain.link_count()),
        padded_(lanes_in<Real> > 1 ? count_ : (count_ + 3) / 4 * 4), stride_((padded_ + 7) / 8 / 2 * 16 + 8),
        gravity_x_(chain.gravity_x), gravity_y_(chain.gravity_y), constants_(std::size_t(stride_) * constant_rows),
        state_(std::size_t(stride_) * state_rows, Real(0.0)) {
    for (int i = 0; i < count_; ++i) {
      const LinkOf<Real>& link = chain.links[i + 1];
      const LinkOf<Real> next = i + 1 < count_ ? chain.links[i + 2] : LinkOf<Real>();
      const Real row[] = {link.sign,     link.mass,     link.inertia,  singular_pivot * pivot_scale(link, next),
                          link.moment_x, link.moment_y, next.offset_x, next.offset_y};
      for (int k = 0; k < constant_rows; ++k) constants_[std::size_t(k) * stride_ + i] = row[k];
    }
  }

  int evaluate(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
    turn(position, velocity);
    place();
    const int singular = eliminate(effort);
    if (singular >= 0) return singular;
    substitute(acceleration);
    if (refined_) refine(effort, acceleration);
    return -1;
  }

 private:
  enum Constant { sign, mass, inertia, least, moment_x, moment_y, offset_x, offset_y, constant_rows };
  enum State {  // of link i:
    angle,
    turning,
    sine,
    cosine,  // phi, -phi'^2, e^(j phi)
    coupling_x,
    coupling_y,
    bias_x,
    bias_y,  // own part of h and q
    lever_x,
    lever_y,
    carried_x,
    carried_y,  // s and k of the next link
    row_x,
    row_y,
    known,  // kept for the way back: g = h / I, t / I
    reciprocal,
    turned,
    point_x,
    point_y,
    state_rows  // kept for refinement: 1 / I, phi'', a
  };
  const Real* row(Constant kind) const { return &constants_[std::size_t(kind) * stride_]; }
  Real* row(State kind) { return &state_[std::size_t(kind) * stride_]; }

  // Angles and rates by prefix sums, phi = P^T theta.
  void turn(const Real* position, const Real* velocity) {
    Real phi = 0.0, rate = 0.0, *const angles = row(angle), *const turnings = row(turning);
    const Real* const signs = row(sign);
    for (int i = 0; i < count_; ++i) {
      phi += signs[i] * position[i], rate += signs[i] * velocity[i];
      angles[i] = phi, turnings[i] = -rate * rate;
    }
  }

  // First moments and levers in world axes, and what depends on them alone.
  void place() {
    sine_cosine_each(row(angle), NothingLost(), row(sine), row(cosine), padded_);
    const Real *const mx = row(moment_x), *const my = row(moment_y), *const ox = row(offset_x),
                      *const oy = row(offset_y);
    const Real *const s = row(sine), *const c = row(cosine), *const w = row(turning);
    Real *const hx = row(coupling_x), *const hy = row(coupling_y), *const qx = row(bias_x), *const qy = row(bias_y),
                *const sx = row(lever_x), *const sy = row(lever_y), *const kx = row(carried_x),
                *const ky = row(carried_y);
    PLANAR_CHAIN_APART
    for (int i = 0; i < padded_; ++i) {
      const Real x = mx[i] * c[i] - my[i] * s[i], y = mx[i] * s[i] + my[i] * c[i];    // X_i
      const Real rx = ox[i] * c[i] - oy[i] * s[i], ry = ox[i] * s[i] + oy[i] * c[i];  // R_(i+1)
      hx[i] = -y, hy[i] = x, qx[i] = w[i] * x, qy[i] = w[i] * y;
      sx[i] = -ry, sy[i] = rx, kx[i] = w[i] * rx, ky[i] = w[i] * ry;
    }
  }

  // Leaf to root, (1) and (3) of equations.md 6.2. With B, h, I of link i, and s of its lever on the carrier:
  // A = B - h g^T, h_p = A s = B s - h (g.s), I_p = J_p + s.A s = (J_p + s.B s) - (s.h) (g.s).
  int eliminate(const Real* effort) {
    const Real *const m = row(mass), *const own = row(inertia), *const limit = row(least), *const signs = row(sign);
    const Real *const ownx = row(coupling_x), *const owny = row(coupling_y), *const qx = row(bias_x),
                      *const qy = row(bias_y), *const leverx = row(lever_x), *const levery = row(lever_y),
                      *const carriedx = row(carried_x), *const carriedy = row(carried_y);
    Real *const gxs = row(row_x), *const gys = row(row_y), *const knowns = row(known),
                *const inverses = row(reciprocal);
    Real axx = 0.0, axy = 0.0, ayy = 0.0, cx = 0.0, cy = 0.0, bx = 0.0, by = 0.0, torque = 0.0;
    Real pivot = own[count_ - 1];
    for (int i = count_ - 1;; --i) {
      if (this->stops_at(pivot > Real(limit[i]))) return i;
      const Real inverse = 1.0 / pivot;
      const Real bxx = m[i] + axx, byy = m[i] + ayy, hx = cx + ownx[i], hy = cy + owny[i];
      const Real reaction = signs[i] * effort[i], t = torque + reaction;  // Q_phi = S tau
      const Real gx = hx * inverse, gy = hy * inverse;
      gxs[i] = gx, gys[i] = gy, knowns[i] = t * inverse, inverses[i] = inverse;
      if (i == 0) return -1;
      const Real sx = leverx[i - 1], sy = levery[i - 1], kx = carriedx[i - 1], ky = carriedy[i - 1];
      const Real zx = bxx * sx + axy * sy, zy = axy * sx + byy * sy;
      const Real sh = sx * hx + sy * hy, sg = sh * inverse;
      axx = bxx - hx * gx, axy = axy - hx * gy, ayy = byy - hy * gy;
      cx = zx - hx * sg, cy = zy - hy * sg;
      pivot = (own[i - 1] + (sx * zx + sy * zy)) - sh * sg;
      bx = (bx + qx[i]) + (axx * kx + axy * ky), by = (by + qy[i]) + (axy * kx + ayy * ky);
      torque = (-(sx * bx + sy * by) - reaction) - sg * t;
      bx = bx + gx * t, by = by + gy * t;  // beta
    }
  }

  // Root to leaf: phi_i'' = t / I - g.a_i and a_(i+1) = a_i + k + phi_i'' s, the latter without waiting for phi_i''.
  void substitute(Real* acceleration) {
    const Real* const signs = row(sign);
    const Real *const leverx = row(lever_x), *const levery = row(lever_y), *const carriedx = row(carried_x),
                      *const carriedy = row(carried_y), *const gxs = row(row_x), *const gys = row(row_y),
                      *const knowns = row(known);
    Real* const turns = row(turned);
    Real ax = -gravity_x_, ay = -gravity_y_, before = 0.0;
    for (int i = 0; i < count_; ++i) {
      const Real gx = gxs[i], gy = gys[i], sx = leverx[i], sy = levery[i];
      const Real turn = knowns[i] - (gx * ax + gy * ay);
      const Real dx = (sx * gx) * ax + (sx * gy) * ay, dy = (sy * gx) * ax + (sy * gy) * ay;
      ax = (ax + (carriedx[i] + sx * knowns[i])) - dx, ay = (ay + (carriedy[i] + sy * knowns[i])) - dy;
      turns[i] = turn;
      acceleration[i] = signs[i] * (turn - before), before = turn;
    }
  }

  // One step of iterative refinement (equations.md 7): inverse dynamics (6.1) gives the residual of Q, and the same
  // factors solve for the correction.
  void refine(const Real* effort, Real* acceleration) {
    const Real *const m = row(mass), *const own = row(inertia), *const signs = row(sign);
    const Real *const hx = row(coupling_x), *const hy = row(coupling_y), *const qx = row(bias_x),
                      *const qy = row(bias_y), *const sx = row(lever_x), *const sy = row(lever_y),
                      *const kx = row(carried_x), *const ky = row(carried_y), *const gx = row(row_x),
                      *const gy = row(row_y), *const inverses = row(reciprocal);
    Real *const turns = row(turned), *const px = row(point_x), *const py = row(point_y), *const knowns = row(known);
    Real ax = -gravity_x_, ay = -gravity_y_;
    for (int i = 0; i < count_; ++i) {
      px[i] = ax, py[i] = ay;
      ax = ax + (kx[i] + sx[i] * turns[i]), ay = ay + (ky[i] + sy[i] * turns[i]);
    }
    Real fx = 0.0, fy = 0.0, bx = 0.0, by = 0.0, outer = 0.0;
    for (int i = count_ - 1; i >= 0; --i) {
      const Real reaction = signs[i] * effort[i];
      const Real needed = own[i] * turns[i] + (hx[i] * px[i] + hy[i] * py[i]) + (sx[i] * fx + sy[i] * fy);
      const Real t = ((reaction - outer) - needed) - (sx[i] * bx + sy[i] * by);
      fx = fx + (m[i] * px[i] + (hx[i] * turns[i] + qx[i])), fy = fy + (m[i] * py[i] + (hy[i] * turns[i] + qy[i]));
      bx = bx + gx[i] * t, by = by + gy[i] * t;
      knowns[i] = t * inverses[i], outer = reaction;
    }
    ax = 0.0, ay = 0.0;
    Real before = 0.0;
    for (int i = 0; i < count_; ++i) {
      const Real correction = knowns[i] - (gx[i] * ax + gy[i] * ay);
      ax = ax + sx[i] * correction, ay = ay + sy[i] * correction;
      acceleration[i] = acceleration[i] + signs[i] * (correction - before), before = correction;
    }
  }

  const bool refined_;
  const int count_, padded_;  // links; the same rounded up to whole vectors
  const int stride_;          // an odd number of cache lines, so that the rows of a long chain do not collide
  const Real gravity_x_, gravity_y_;
  AlignedVector<Real> constants_, state_;
};

using SerialRecursion = SerialRecursionOf<double>;

}  // namespace planar_chain
