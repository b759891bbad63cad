// Form::forward compiled twice, for 256-bit vectors and for those that every machine has; the machine decides which one
// runs. Without contraction both give the same bits.
#pragma once

#include "../arithmetic/lanes.hpp"
#include "form.hpp"

#if defined(__GNUC__) && defined(__x86_64__) && defined(__linux__) && !defined(PLANAR_CHAIN_NARROW)
#define PLANAR_CHAIN_WIDE __attribute__((target("avx2"), flatten))
#define PLANAR_CHAIN_HAS_WIDE static_cast<bool>(__builtin_cpu_supports("avx2"))
#else
#define PLANAR_CHAIN_WIDE
#define PLANAR_CHAIN_HAS_WIDE false
#endif

// Before a loop with independent iterations; only gcc needs this.
#ifdef __clang__
#define PLANAR_CHAIN_APART
#else
#define PLANAR_CHAIN_APART _Pragma("GCC ivdep")
#endif

namespace planar_chain {

// A form whose body is `evaluate` of `Body`.
template <class Body, class Real>
class WideForm : public FormOf<Real> {
 public:
  int forward(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) final {
    this->good_ = Real(0.0) < Real(1.0);
    if constexpr (lanes_in<Real> > 1) return evaluate_in_lanes(body(), position, velocity, effort, acceleration);
    if (wide_) return forward_wide(position, velocity, effort, acceleration);
    return body().evaluate(position, velocity, effort, acceleration);
  }

 private:
  PLANAR_CHAIN_WIDE int forward_wide(const Real* position, const Real* velocity, const Real* effort,
                                     Real* acceleration) {
    return body().evaluate(position, velocity, effort, acceleration);
  }
  Body& body() { return static_cast<Body&>(*this); }

  const bool wide_ = PLANAR_CHAIN_HAS_WIDE;
};

}  // namespace planar_chain
