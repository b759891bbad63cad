// H^-1 times many columns of joint efforts, by the factors that a recursion keeps from its last evaluation
// (equations.md 6.2 and 6.3): a recursion of its own, leaf to root and back, with the columns in lanes. It takes time
// O(links) a column and is as exact as the recursion.
#pragma once

#include <cstddef>
#include <vector>

#include "../arithmetic/cache_lines.hpp"
#include "../arithmetic/lanes.hpp"
#include "../arithmetic/plane_vectors.hpp"
#include "../arithmetic/vector_width.hpp"
#include "../model/chain.hpp"
#include "recursive.hpp"

namespace planar_chain {

class Response {
 public:
  // Row j of the columns is that of joint j. Rows are `stride()` numbers long, of which the last may be idle.
  Response(const Recursion& recursion, int columns)
      : recursion_(recursion), chain_(recursion.chain()), stride_((columns + widest - 1) / widest * widest),
        columns_(static_cast<std::size_t>(chain_.joint_count) * stride_),
        work_(chain_.links.size() * sizeof(LinkShare<Lanes<widest>>) / sizeof(double)), width_(vector_widths().back()) {
  }

  double* row(int joint) { return &columns_[static_cast<std::size_t>(joint) * stride_]; }

  // Replaces the efforts in the columns by the accelerations that they alone cause. False if one is not finite.
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
  static constexpr int widest = 8;  // numbers in a vector

  // A link's factors of the recursion, the same in every lane, and its numbers for one block of columns. Slot 0 is the
  // base.
  template <class Real>
  struct LinkShare {
    VecOf<Real> across, turn_row, slide_axis, slide_row;  // `across`: the lever, turned by a quarter
    Real sign, turn_inverse, rotor, through, slide_inverse, slide_coupling;
    VecOf<Real> bias, linear;  // of children that are not the next link; of its joint point
    Real torque, turned_by, slid_by, angular;
  };

  template <class Real>
  struct Work {
    Response& response;
    bool finite;
    void run() {
      response.template spread<Real>();
      Real lost = 0.0;
      for (int first = 0; first < response.stride_; first += lanes_in<Real>) response.template block<Real>(first, lost);
      finite = true;
      for (int i = 0; i < lanes_in<Real>; ++i) finite &= lane(lost, i) == 0.0;
    }
  };

  template <class Real>
  PLANAR_CHAIN_INLINE LinkShare<Real>* shares() {
    return reinterpret_cast<LinkShare<Real>*>(work_.data());
  }
  template <class Real>
  PLANAR_CHAIN_INLINE Real& at(int joint, int column) {
    return *reinterpret_cast<Real*>(&columns_[static_cast<std::size_t>(joint) * stride_ + column]);
  }

  template <class Real>
  PLANAR_CHAIN_INLINE void spread() {
    const auto everywhere = [](const VecOf<double>& a) { return VecOf<Real>{a.x, a.y}; };
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      const LinkStateOf<double>& s = recursion_.state(i);
      LinkShare<Real>& own = shares<Real>()[i];
      own.across = everywhere(perp(s.lever));
      if (link.turns()) {
        own.sign = link.sign, own.turn_inverse = s.turn_inverse, own.turn_row = everywhere(s.turn_row);
        own.rotor = link.rotor, own.through = link.rotor * s.turn_inverse;
      }
      if (link.slides()) {
        own.slide_inverse = s.slide_inverse, own.slide_coupling = s.slide_coupling;
        own.slide_axis = everywhere(s.slide_axis), own.slide_row = everywhere(s.slide_row);
      }
    }
  }

  template <class Real>
  PLANAR_CHAIN_INLINE void block(int column, Real& lost) {
    using Vec = VecOf<Real>;
    LinkShare<Real>* const share = shares<Real>();
    const int links = chain_.link_count();
    for (int i = 0; i <= links; ++i)
      if (i == 0 || chain_.links[i].has_branches)
        share[i].bias = share[i].linear = Vec{}, share[i].torque = share[i].angular = Real(0.0);

    Vec bias;
    Real torque = 0.0;
    for (int i = links; i >= 1; --i) {  // leaf to root
      const Link& link = chain_.links[i];
      LinkShare<Real>& own = share[i];
      if (link.has_branches) bias = bias + own.bias, torque += own.torque;
      const Real zero = 0.0;
      Real reaction = zero;
      if (link.turns()) {
        reaction = own.sign * at<Real>(link.rotation, column);
        torque += reaction;
        own.turned_by = torque;
        bias = bias + (own.turn_inverse * torque) * own.turn_row;
        torque = link.has_rotor() ? own.through * torque : zero;
      }
      if (link.slides()) {
        const Real nu = at<Real>(link.slide, column) - dot(own.slide_axis, bias);
        own.slid_by = own.slide_inverse * nu;
        if (!link.turns() || link.has_rotor()) torque -= nu * own.slide_coupling;
        bias = bias + nu * own.slide_row;
      }
      torque = torque - reaction - dot(own.across, bias);
      if (link.carrier != i - 1) {
        if (link.carrier != 0) {
          LinkShare<Real>& carrier = share[link.carrier];
          carrier.bias = carrier.bias + bias, carrier.torque += torque;
        }
        bias = Vec{}, torque = zero;
      }
    }

    Vec linear;
    Real angular = 0.0;
    for (int i = 1; i <= links; ++i) {  // root to leaf
      const Link& link = chain_.links[i];
      LinkShare<Real>& own = share[i];
      if (link.carrier != i - 1) linear = share[link.carrier].linear, angular = share[link.carrier].angular;
      linear = linear + angular * own.across;
      if (link.slides()) {
        const Real slide = own.slid_by - dot(own.slide_row, linear) - own.slide_coupling * angular;
        linear = linear + slide * own.slide_axis;
        at<Real>(link.slide, column) = slide;
        lost += slide - slide;
      }
      if (link.turns()) {
        Real driven = own.turned_by - dot(own.turn_row, linear);
        if (link.has_rotor()) driven += own.rotor * angular;
        const Real turned = driven * own.turn_inverse, relative = own.sign * (turned - angular);
        at<Real>(link.rotation, column) = relative;
        lost += relative - relative;
        angular = turned;
      }
      if (link.has_branches) own.linear = linear, own.angular = angular;
    }
  }

  const Recursion& recursion_;
  const Chain& chain_;
  const int stride_;
  AlignedVector<double> columns_, work_;
  const int width_;
};

}  // namespace planar_chain
