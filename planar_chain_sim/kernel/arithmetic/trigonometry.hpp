// Sine and cosine, the only ones that the kernel and the loader use. They need additions and multiplications alone, so
// the bits are the same with every math library and every vector width. Checked against 50 digits in
// test_trigonometry.py: below 1 ulp.
#pragma once

#include <cmath>
#include <type_traits>

#include "far_angles.hpp"
#include "lanes.hpp"

namespace planar_chain {

// Beyond this many quarter turns k the products k * quarter_1, k * quarter_2 are no longer exact.
constexpr double most_quarters = 524288.0;

namespace trigonometry {

// pi/2 as a sum of 33 + 33 + 53 bits (Cody and Waite 1980), and 2/pi.
constexpr double quarter_1 = 0x1.921fb544p+0, quarter_2 = 0x1.0b4611a6p-34, quarter_3 = 0x1.3198a2e037073p-69;
constexpr double quarters_per_radian = 0x1.45f306dc9c883p-1, sixth = 0x1.5555555555555p-3;
constexpr double to_nearest = 0x1.8p52;  // adding it leaves no bits behind the point; its low bits are then the integer

// Chebyshev fits on |r| <= pi/4, z = r^2: sin r = r + r z S(z), error 2e-20 z; cos r = 1 - z/2 + z^2 C(z), error
// 2e-18 z^2. Summed in pairs (Estrin): half the waiting of Horner's scheme.
template <class Real>
inline Real sine_series(const Real& z) {
  const Real z2 = z * z;
  return (-0x1.5555555555555p-3 + z * 0x1.1111111110bb2p-7) +
         z2 * ((-0x1.a01a019e83816p-13 + z * 0x1.71de379654304p-19) +
               z2 * (-0x1.ae600aca92c64p-26 + z * 0x1.5e0b05bff20f2p-33));
}
template <class Real>
inline Real cosine_series(const Real& z) {
  const Real z2 = z * z;
  return (0x1.5555555555555p-5 + z * -0x1.6c16c16c16967p-10) +
         z2 * ((0x1.a01a019f4e9b4p-16 + z * -0x1.27e4fa17bf139p-22) +
               z2 * (0x1.1eeb68cd22f56p-29 + z * -0x1.907d8f29fe831p-37));
}

// `negative`: 0 or 1.
template <class Real>
inline Real with_sign(const Real& value, const Bits<Real>& negative) {
  return same_bits<Real>(same_bits<Bits<Real>>(value) ^ negative << 63);
}

// Of r + tail + quarter pi/2, |r| <= pi/4.
template <class Real>
inline void reduced_sine_cosine(const Real& r, const Real& tail, const Bits<Real>& quarter, Real& sine, Real& cosine) {
  const Real z = r * r;
  const Real half = 0.5 * z;
  const Real s = r + (r * z * sine_series(z) + tail * (1.0 - half));
  const Real c0 = 1.0 - half;
  const Real c = c0 + (z * z * cosine_series(z) + (((1.0 - c0) - half) - tail * (r - r * z * sixth)));
  const Truth<Real> odd = (quarter & 1) != 0;
  sine = with_sign<Real>(select(odd, c, s), quarter >> 1 & 1);
  cosine = with_sign<Real>(select(odd, s, c), (quarter + 1) >> 1 & 1);
}

// Of angle + low, |low| small beside it, of at most most_quarters quarter turns; true where the angle is farther and
// the result must not be used.
template <class Real>
PLANAR_CHAIN_INLINE Truth<Real> near_sine_cosine(const Real& angle, const Real& low, Real& sine, Real& cosine) {
  const Real shifted = angle * quarters_per_radian + to_nearest;
  const Real k = shifted - to_nearest;
  // angle - k pi/2 = r + tail, |r| <= pi/4, |tail| < 2^-50, correct to 2^-99
  const Real first = angle - k * quarter_1;
  const Real second = k * quarter_2;
  const Real r = first - second;
  const Real back = first - r;
  const Real tail = ((first - (r + back)) + (back - second)) - k * quarter_3 + low;

  reduced_sine_cosine<Real>(r, tail, same_bits<Bits<Real>>(shifted), sine, cosine);
  return k * k > most_quarters * most_quarters;  // false for NaN, which stays NaN
}

}  // namespace trigonometry

// Of angle + low, where low is the rounding error of a sum of angles.
inline void sine_cosine(double angle, double low, double& sine, double& cosine) {
  if (!trigonometry::near_sine_cosine(angle, low, sine, cosine)) return;
  double r = angle - angle, tail = 0.0;  // of an infinite angle, no number
  std::uint64_t quarter = 0;
  if (r == 0.0) trigonometry::reduce_far(angle, r, tail, quarter);
  trigonometry::reduced_sine_cosine<double>(r, tail + low, quarter, sine, cosine);
}

template <int count>
inline void sine_cosine(const Lanes<count>& angle, const Lanes<count>& low, Lanes<count>& sine, Lanes<count>& cosine) {
  if (!any(trigonometry::near_sine_cosine(angle, low, sine, cosine))) return;
  for (int i = 0; i < count; ++i) {
    double s, c;
    sine_cosine(lane(angle, i), lane(low, i), s, c);
    set_lane(sine, i, s), set_lane(cosine, i, c);
  }
}

template <class Real>
inline void sine_cosine(const Real& angle, Real& sine, Real& cosine) {
  sine_cosine(angle, Real(0.0), sine, cosine);
}

// The same for `count` angles, of which few are far. `low`: rounding errors of their sums, an array or NothingLost.
struct NothingLost {
  double operator[](int) const { return 0.0; }
};
template <class Real, class Low>
PLANAR_CHAIN_INLINE void sine_cosine_each(const Real* __restrict angle, const Low& low, Real* __restrict sine,
                                          Real* __restrict cosine, int count) {
  std::conditional_t<lanes_in<Real> == 1, int, Truth<Real>> far = 0;  // an int, for the loop to become vectors
  for (int i = 0; i < count; ++i) far |= trigonometry::near_sine_cosine(angle[i], Real(low[i]), sine[i], cosine[i]);
  if (!any(Truth<Real>(far))) return;
  for (int i = 0; i < count; ++i) sine_cosine(angle[i], Real(low[i]), sine[i], cosine[i]);
}

// The same for `blocks` times 8 angles, with the machine's widest vectors; without contraction that changes no bit.
constexpr int sine_block = 8;
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(PLANAR_CHAIN_NARROW)
__attribute__((target_clones("avx2", "default")))
#endif
inline void sine_cosine(const double* __restrict angle, double* __restrict sine, double* __restrict cosine,
                        int blocks) {
  int far = 0;
  for (int i = 0; i < blocks * sine_block; ++i)
    far |= trigonometry::near_sine_cosine(angle[i], 0.0, sine[i], cosine[i]);
  if (far == 0) return;
  for (int i = 0; i < blocks * sine_block; ++i) sine_cosine(angle[i], sine[i], cosine[i]);
}

}  // namespace planar_chain
