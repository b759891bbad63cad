// H^-1 times many columns of joint efforts, by the factors that a recursion keeps from its last evaluation (equations.md
// 6.2 and 6.3): its own way out and back, with the columns in lanes. Time O(links) a column, and the recursion's digits.
#pragma once

#include <cstddef>
#include <vector>

#include "cache_lines.hpp"
#include "chain.hpp"
#include "lanes.hpp"
#include "recursive.hpp"
#include "vector_width.hpp"

namespace planar_chain {

class Response {
 public:
  // Row j of the columns is that of joint j. Rows are `stride()` numbers long, of which the last may be idle.
  Response(const Recursion& recursion, int columns)
      : recursion_(recursion), chain_(recursion.chain()), stride_((columns + widest - 1) / widest * widest),
        columns_(static_cast<std::size_t>(chain_.joint_count) * stride_),
        work_(chain_.links.size() * sizeof(LinkShare<Lanes<widest>>) / sizeof(double)), width_(vector_widths().back()) {}

  double* row(int joint) { return &columns_[static_cast<std::size_t>(joint) * stride_]; }

  // Efforts in the columns give way to the accelerations that they alone cause. False where one is not finite.
  bool solve() {
    bool finite = false;
    with_width(width_, [&](auto vectors) {
      Work<typename decltype(vectors)::Real> work{*this, false};
      decltype(vectors)::Vectors::run(work);
      finite = work.finite;
    });
    return finite;
  }

 private:
  static constexpr int widest = 8;   // numbers in a vector

  // What a link keeps of one block of columns; slot 0 is the base.
  template <class Real>
  struct LinkShare {
    VecOf<Real> bias, linear;        // of children that are not the next link; of its joint point
    Real torque, turned_by, slid_by, angular;
  };

  template <class Real>
  struct Work {
    Response& response;
    bool finite;
    void run() {
      Real lost = 0.0;
      for (int first = 0; first < response.stride_; first += lanes_in<Real>) response.template block<Real>(first, lost);
      finite = true;
      for (int i = 0; i < lanes_in<Real>; ++i) finite &= lane(lost, i) == 0.0;
    }
  };

  template <class Real>
  PLANAR_CHAIN_INLINE Real& at(int joint, int column) {
    return *reinterpret_cast<Real*>(&columns_[static_cast<std::size_t>(joint) * stride_ + column]);
  }

  template <class Real>
  PLANAR_CHAIN_INLINE void block(int column, Real& lost) {
    using Vec = VecOf<Real>;
    LinkShare<Real>* const shares = reinterpret_cast<LinkShare<Real>*>(work_.data());
    const int links = chain_.link_count();
    for (int i = 0; i <= links; ++i)
      if (i == 0 || chain_.links[i].has_branches) shares[i] = LinkShare<Real>{};

    Vec bias;
    Real torque = 0.0;
    for (int i = links; i >= 1; --i) {   // leaf to root
      const Link& link = chain_.links[i];
      const LinkStateOf<double>& s = recursion_.state(i);
      LinkShare<Real>& own = shares[i];
      if (link.has_branches) bias = bias + own.bias, torque += own.torque;
      const bool three = !link.turns() || link.has_rotor();
      Real reaction = 0.0;
      if (link.turns()) {
        reaction = Real(link.sign) * at<Real>(link.rotation, column);
        torque += reaction;
        own.turned_by = torque;
        bias = bias + times(Real(s.turn_inverse) * torque, s.turn_row);
        torque *= Real(link.rotor * s.turn_inverse);
      }
      if (link.slides()) {
        const Real nu = at<Real>(link.slide, column) - along(s.slide_axis, bias);
        own.slid_by = Real(s.slide_inverse) * nu;
        torque -= nu * Real(s.slide_coupling);
        bias = bias + times(nu, s.slide_row);
      }
      torque = (three ? torque : Real(0.0)) - along(perp(s.lever), bias) - reaction;
      if (link.carrier != i - 1) {
        if (link.carrier != 0) {
          LinkShare<Real>& carrier = shares[link.carrier];
          carrier.bias = carrier.bias + bias;
          carrier.torque += torque;
        }
        bias = Vec{}, torque = 0.0;
      }
    }

    Vec linear;
    Real angular = 0.0;
    for (int i = 1; i <= links; ++i) {   // root to leaf
      const Link& link = chain_.links[i];
      const LinkStateOf<double>& s = recursion_.state(i);
      LinkShare<Real>& own = shares[i];
      if (link.carrier != i - 1) linear = shares[link.carrier].linear, angular = shares[link.carrier].angular;
      linear = linear + times(angular, perp(s.lever));
      if (link.slides()) {
        const Real slide = own.slid_by - along(s.slide_row, linear) - Real(s.slide_coupling) * angular;
        linear = linear + times(slide, s.slide_axis);
        at<Real>(link.slide, column) = slide;
        lost += slide - slide;
      }
      if (link.turns()) {
        const Real turned = (own.turned_by - along(s.turn_row, linear) + Real(link.rotor) * angular) * Real(s.turn_inverse);
        const Real relative = Real(link.sign) * (turned - angular);
        at<Real>(link.rotation, column) = relative;
        lost += relative - relative;
        angular = turned;
      }
      if (link.has_branches) own.linear = linear, own.angular = angular;
    }
  }

  template <class Real>
  static PLANAR_CHAIN_INLINE VecOf<Real> times(const Real& scale, const VecOf<double>& a) {
    return {scale * Real(a.x), scale * Real(a.y)};
  }
  template <class Real>
  static PLANAR_CHAIN_INLINE Real along(const VecOf<double>& a, const VecOf<Real>& b) {
    return Real(a.x) * b.x + Real(a.y) * b.y;
  }

  const Recursion& recursion_;
  const Chain& chain_;
  const int stride_;
  AlignedVector<double> columns_, work_;
  const int width_;
};

}  // namespace planar_chain
