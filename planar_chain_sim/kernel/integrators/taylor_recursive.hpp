// Coefficients of the motion for every chain, in O(order^2 n).
//
// Normalised coefficients f_k = f^(k)(t_0) / k!, products are convolutions (equations.md 11). The equations are the
// path-matrix equations with unit vectors E_i = e^(j phi_i) as unknowns of their own, so that every sum along a path,
// P^T and P of (5.56) and 6.1, stays a plain sum of coefficients and each link costs two complex convolutions an order:
//
//   E_i' = j phi_i' E_i                                  angle to unit vector
//   a_i  = a_i- + rho_i E_i-'' + e^(j eps_i) (x_i E_i-)''          root to leaf, a_0 = -g
//   F_i  = m_i a_i + m_i c_i E_i'' + sum over children F_w         leaf to root
//   N_i  = J_i phi_i'' + (j E_i) . [conj(m_i c_i) a_i + sum conj(rho_w) F_w] + sum (j x_w E_i) . e^(-j eps_w) F_w
//   tau  = P N at a rotation,  f_i = E_i- . e^(-j eps_i) F_i at a slide                    (equations.md 6.1)
//
// At order k the highest coefficients of the accelerations stand in these linearly with the mass matrix at t_0, so the
// factors of one O(n) elimination serve every order.
#pragma once

#include <cstring>
#include <vector>

#include "../forms/recursive.hpp"
#include "taylor.hpp"

namespace planar_chain {

class TaylorRecursive final : public Taylor {
 public:
  TaylorRecursive(const Chain& chain, const JointForces& forces, double tick_length, int order, double tolerance,
                  double fixed)
      : Taylor(chain, forces, tick_length, order, tolerance, fixed), chain_(chain), recursion_(chain),
        lanes_((chain.link_count() + 4) / 4 * 4), response_(joints_), rate_(rows(order + 2, lanes_)),
        unit_x_(rows(order + 3, lanes_)), unit_y_(unit_x_), pull_x_(rows(order + 1, lanes_)), pull_y_(pull_x_),
        bend_x_(lanes_), bend_y_(lanes_), turn_x_(lanes_), turn_y_(lanes_), torque_(lanes_), force_x_(lanes_),
        force_y_(lanes_), linear_x_(lanes_), linear_y_(lanes_), angular_(lanes_) {
    unit_x_[0] = 1.0;  // the base
    for (int i = 1; i <= chain.link_count(); ++i)
      if (chain.links[i].slides()) slides_.emplace_back(i, order);
  }

 protected:
  int expand(const JointState& base) override {
    const int joint = recursion_.forward(base.position.data(), base.position_remainder.data(), base.velocity.data(),
                                         effort_.data(), response_.data());
    if (joint >= 0) return joint;
    begin(base);
    for (int k = 0; k < order_; ++k) {
      if (k > 0) resolve(k);
      finish(k);
    }
    return -1;
  }

 private:
  // Additional series of a slide: x_i, Y_i = x_i E_i-, and its force in the carrier's frame, e^(-j eps_i) F_i.
  struct SlideSeries {
    int link;
    std::vector<double> place, arm_x, arm_y, force_x, force_y;
    double bend_x = 0.0, bend_y = 0.0;  // Y_k''

    SlideSeries(int index, int order)
        : link(index), place(order + 3), arm_x(order + 3), arm_y(order + 3), force_x(order + 1), force_y(order + 1) {}
  };

  static AlignedVector<double> rows(int orders, int lanes) {
    return AlignedVector<double>(std::size_t(orders) * lanes);
  }
  double* row(AlignedVector<double>& series, int k) { return &series[static_cast<std::size_t>(k) * lanes_]; }

  // Coefficients of order 0, and E_1.
  void begin(const JointState& base) {
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const double c = recursion_.cosine(i), s = recursion_.sine(i), rate = recursion_.rate(i);
      row(rate_, 0)[i] = rate;
      row(unit_x_, 0)[i] = c, row(unit_y_, 0)[i] = s;
      row(unit_x_, 1)[i] = -rate * s, row(unit_y_, 1)[i] = rate * c;
    }
    for (SlideSeries& slide : slides_) {
      const Link& link = chain_.links[slide.link];
      const int p = link.carrier;
      slide.place[0] = base.position[link.slide], slide.place[1] = base.velocity[link.slide];
      slide.arm_x[0] = slide.place[0] * row(unit_x_, 0)[p], slide.arm_y[0] = slide.place[0] * row(unit_y_, 0)[p];
      slide.arm_x[1] = slide.place[0] * row(unit_x_, 1)[p] + slide.place[1] * row(unit_x_, 0)[p];
      slide.arm_y[1] = slide.place[0] * row(unit_y_, 1)[p] + slide.place[1] * row(unit_y_, 0)[p];
    }
    turn(0);
  }

  // turn_ <- sum over m <= k of phi'_m E_(k+1-m): what is known of (j E)^-1 E_(k+2) (k+2).
  void turn(int k) {
    for (int l = 0; l < lanes_; l += 4) {
      Four x0{}, y0{}, x1{}, y1{};
      const double *rate = &rate_[l], *x = row(unit_x_, k + 1) + l, *y = row(unit_y_, k + 1) + l;
      int m = 0;
      for (; m + 1 <= k; m += 2, rate += 2 * lanes_, x -= 2 * lanes_, y -= 2 * lanes_) {
        const Four r0 = four(rate), r1 = four(rate + lanes_);
        x0 += r0 * four(x), y0 += r0 * four(y);
        x1 += r1 * four(x - lanes_), y1 += r1 * four(y - lanes_);
      }
      if (m <= k) x0 += four(rate) * four(x), y0 += four(rate) * four(y);
      four(&turn_x_[l]) = x0 + x1, four(&turn_y_[l]) = y0 + y1;
    }
  }

  // torque_ <- sum over m = 1..k of (j E_m) . G_(k-m)
  void pull(int k) {
    for (int l = 0; l < lanes_; l += 4) {
      Four t0{}, t1{};
      const double *x = row(unit_x_, 1) + l, *y = row(unit_y_, 1) + l;
      const double *gx = row(pull_x_, k - 1) + l, *gy = row(pull_y_, k - 1) + l;
      for (int m = 1; m <= k; ++m, x += lanes_, y += lanes_, gx -= lanes_, gy -= lanes_) {
        t0 += four(x) * four(gy);
        t1 += four(y) * four(gx);
      }
      four(&torque_[l]) = t0 - t1;
    }
  }

  // Accelerations of order k >= 1 into response_: the mass matrix at t_0 times them is what the known terms leave.
  void resolve(int k) {
    turn(k);
    for (SlideSeries& slide : slides_) {
      const int p = chain_.links[slide.link].carrier;
      slide.place[k + 2] = 0.0;
      row(unit_x_, k + 2)[p] = -turn_y_[p] / (k + 2), row(unit_y_, k + 2)[p] = turn_x_[p] / (k + 2);
    }
    for (SlideSeries& slide : slides_) bend_arm(slide, k);
    for (int i = 0; i < lanes_; ++i) bend_x_[i] = -(k + 1) * turn_y_[i], bend_y_[i] = (k + 1) * turn_x_[i];
    sum_forces(k);
    pull(k);
    const double *ex = row(unit_x_, 0), *ey = row(unit_y_, 0), *gx = row(pull_x_, k), *gy = row(pull_y_, k);
    for (int i = 0; i < lanes_; ++i) torque_[i] += ex[i] * gy[i] - ey[i] * gx[i];
    add_passive(k);
    for (SlideSeries& slide : slides_) {
      const Link& link = chain_.links[slide.link];
      double torque = 0.0, force = 0.0;
      for (int m = 0; m <= k; ++m) {
        torque += slide.arm_x[m] * slide.force_y[k - m] - slide.arm_y[m] * slide.force_x[k - m];
        force +=
            row(unit_x_, m)[link.carrier] * slide.force_x[k - m] + row(unit_y_, m)[link.carrier] * slide.force_y[k - m];
      }
      if (link.carrier > 0) torque_[link.carrier] += torque;
      effort_[link.slide] -= force;
    }
    for (int i = chain_.link_count(); i >= 1; --i) {  // tau = P N
      const Link& link = chain_.links[i];
      if (link.turns()) effort_[link.rotation] -= link.sign * torque_[i];
      torque_[link.carrier] += torque_[i];
    }
    recursion_.respond(effort_.data(), response_.data());
  }

  // Coefficient k of the smooth laws; actuators, friction, moments and gravity are constant and have none.
  void add_passive(int k) {
    std::memset(effort_.data(), 0, effort_.size() * sizeof(double));
    const double *v = velocity(k), *before = velocity(k - 1);
    forces_.each_smooth(
        [&](const auto& law) { effort_[law.joint] += law.coefficient(k, v[law.joint], before[law.joint]); });
  }

  // With the accelerations of order k in response_: all other coefficients that follow from them.
  void finish(int k) {
    double* const next = velocity(k + 1);
    for (int i = 0; i < joints_; ++i) next[i] = response_[i] / (k + 1);
    double *rate = row(rate_, k + 1), *ex = row(unit_x_, k + 2), *ey = row(unit_y_, k + 2);
    const double *cx = row(unit_x_, 0), *cy = row(unit_y_, 0);
    angular_[0] = 0.0;
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      angular_[i] = angular_[link.carrier];
      if (link.turns()) angular_[i] += link.sign * response_[link.rotation];
    }
    const double inverse = 1.0 / (k + 2), share = 1.0 / (k + 1);
    for (int i = 0; i < lanes_; ++i) {
      rate[i] = angular_[i] * share;
      const double x = turn_x_[i] + rate[i] * cx[i], y = turn_y_[i] + rate[i] * cy[i];
      ex[i] = -y * inverse, ey[i] = x * inverse;
      bend_x_[i] = -(k + 1) * y, bend_y_[i] = (k + 1) * x;
    }
    for (SlideSeries& slide : slides_) {
      slide.place[k + 2] = response_[chain_.links[slide.link].slide] / ((k + 1) * (k + 2));
      bend_arm(slide, k);
    }
    sum_forces(k);
  }

  // Y_(k+2) and Y_k'' of a slide from x and E up to order k + 2.
  void bend_arm(SlideSeries& slide, int k) {
    const int p = chain_.links[slide.link].carrier;
    double x = 0.0, y = 0.0;
    for (int m = 0; m <= k + 2; ++m) {
      x += slide.place[m] * row(unit_x_, k + 2 - m)[p];
      y += slide.place[m] * row(unit_y_, k + 2 - m)[p];
    }
    slide.arm_x[k + 2] = x, slide.arm_y[k + 2] = y;
    slide.bend_x = (k + 1) * (k + 2) * x, slide.bend_y = (k + 1) * (k + 2) * y;
  }

  // Accelerations of joint points, then forces, and G_i = conj(m_i c_i) a_i + sum conj(rho_w) F_w, all of order k.
  void sum_forces(int k) {
    const int n = chain_.link_count();
    linear_x_[0] = k == 0 ? -chain_.gravity_x : 0.0, linear_y_[0] = k == 0 ? -chain_.gravity_y : 0.0;
    double *gx = row(pull_x_, k), *gy = row(pull_y_, k);
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      const int p = link.carrier;
      linear_x_[i] = linear_x_[p] + (link.offset_x * bend_x_[p] - link.offset_y * bend_y_[p]);
      linear_y_[i] = linear_y_[p] + (link.offset_x * bend_y_[p] + link.offset_y * bend_x_[p]);
      if (link.slides()) {
        const SlideSeries& slide = series_of(i);
        linear_x_[i] += link.axis_x * slide.bend_x - link.axis_y * slide.bend_y;
        linear_y_[i] += link.axis_x * slide.bend_y + link.axis_y * slide.bend_x;
      }
      force_x_[i] = link.mass * linear_x_[i] + (link.moment_x * bend_x_[i] - link.moment_y * bend_y_[i]);
      force_y_[i] = link.mass * linear_y_[i] + (link.moment_x * bend_y_[i] + link.moment_y * bend_x_[i]);
      gx[i] = link.moment_x * linear_x_[i] + link.moment_y * linear_y_[i];
      gy[i] = link.moment_x * linear_y_[i] - link.moment_y * linear_x_[i];
    }
    for (const Wrench& wrench :
         forces_.wrenches) {  // a force f E_i or f at a point p: F_i -= f .., G_i -= conj(p) f ..
      const int i = wrench.link, axes = wrench.turns ? i : 0;
      const double x = row(unit_x_, k)[axes], y = row(unit_y_, k)[axes];
      const double fx = wrench.force_x * x - wrench.force_y * y, fy = wrench.force_x * y + wrench.force_y * x;
      force_x_[i] -= fx, force_y_[i] -= fy;
      gx[i] -= wrench.point_x * fx + wrench.point_y * fy, gy[i] -= wrench.point_x * fy - wrench.point_y * fx;
    }
    for (int i = n; i >= 1; --i) {
      const Link& link = chain_.links[i];
      const int p = link.carrier;
      force_x_[p] += force_x_[i], force_y_[p] += force_y_[i];
      gx[p] += link.offset_x * force_x_[i] + link.offset_y * force_y_[i];
      gy[p] += link.offset_x * force_y_[i] - link.offset_y * force_x_[i];
      if (link.slides()) {
        SlideSeries& slide = series_of(i);
        slide.force_x[k] = link.axis_x * force_x_[i] + link.axis_y * force_y_[i];
        slide.force_y[k] = link.axis_x * force_y_[i] - link.axis_y * force_x_[i];
      }
    }
    gx[0] = gy[0] = 0.0;
  }

  SlideSeries& series_of(int link) {
    for (SlideSeries& slide : slides_)
      if (slide.link == link) return slide;
    return slides_.front();
  }

  const Chain& chain_;
  Recursion recursion_;
  const int lanes_;
  std::vector<double> response_;                                    // joint accelerations of one order
  AlignedVector<double> rate_, unit_x_, unit_y_, pull_x_, pull_y_;  // links, a row for each order: phi', E, G
  AlignedVector<double> bend_x_, bend_y_, turn_x_, turn_y_, torque_, force_x_, force_y_, linear_x_, linear_y_, angular_;
  std::vector<SlideSeries> slides_;
};

}  // namespace planar_chain
