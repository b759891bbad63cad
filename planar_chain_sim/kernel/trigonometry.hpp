// Sine and cosine: the one place where the kernel and the loader take them from. Additions and multiplications alone,
// so the bits are the same with every math library and every vector width. Checked against 50 digits in
// test_trigonometry.py: below 1 ulp.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

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
inline double sine_series(double z) {
  const double z2 = z * z;
  return (-0x1.5555555555555p-3 + z * 0x1.1111111110bb2p-7)
         + z2 * ((-0x1.a01a019e83816p-13 + z * 0x1.71de379654304p-19)
         + z2 * (-0x1.ae600aca92c64p-26 + z * 0x1.5e0b05bff20f2p-33));
}
inline double cosine_series(double z) {
  const double z2 = z * z;
  return (0x1.5555555555555p-5 + z * -0x1.6c16c16c16967p-10)
         + z2 * ((0x1.a01a019f4e9b4p-16 + z * -0x1.27e4fa17bf139p-22)
         + z2 * (0x1.1eeb68cd22f56p-29 + z * -0x1.907d8f29fe831p-37));
}

inline double with_sign(double value, std::uint64_t negative) {
  std::uint64_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  bits ^= negative << 63;
  std::memcpy(&value, &bits, sizeof bits);
  return value;
}

// Angle + low, |low| small beside it, of at most most_quarters quarter turns; returns 1 if the angle is farther and the result is to be thrown away.
inline int near_sine_cosine(double angle, double low, double& sine, double& cosine) {
  const double shifted = angle * quarters_per_radian + to_nearest;
  const double k = shifted - to_nearest;
  // angle - k pi/2 = r + tail, |r| <= pi/4, |tail| < 2^-50, correct to 2^-99
  const double first = angle - k * quarter_1;
  const double second = k * quarter_2;
  const double r = first - second;
  const double back = first - r;
  const double tail = ((first - (r + back)) + (back - second)) - k * quarter_3 + low;

  const double z = r * r;
  const double half = 0.5 * z;
  const double s = r + (r * z * sine_series(z) + tail * (1.0 - half));
  const double c0 = 1.0 - half;
  const double c = c0 + (z * z * cosine_series(z) + (((1.0 - c0) - half) - tail * (r - r * z * sixth)));

  std::uint64_t quarter;
  std::memcpy(&quarter, &shifted, sizeof quarter);
  const bool odd = quarter & 1;
  sine = with_sign(odd ? c : s, quarter >> 1 & 1);
  cosine = with_sign(odd ? s : c, (quarter + 1) >> 1 & 1);
  return std::fabs(k) > most_quarters;  // NaN needs no other road: it stays NaN
}

}  // namespace trigonometry

// Of angle + low, where low is what a sum of angles has lost by rounding.
inline void sine_cosine(double angle, double low, double& sine, double& cosine) {
  if (trigonometry::near_sine_cosine(angle, low, sine, cosine)) {  // far angles are left to the math library
    sine = std::sin(angle);
    cosine = std::cos(angle);
  }
}

inline void sine_cosine(double angle, double& sine, double& cosine) { sine_cosine(angle, 0.0, sine, cosine); }

// The same for `blocks` times 8 angles, with the machine's widest vectors; without contraction that changes no bit.
constexpr int sine_block = 8;
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
__attribute__((target_clones("avx2", "default")))
#endif
inline void sine_cosine(const double* __restrict angle, double* __restrict sine, double* __restrict cosine,
                        int blocks) {
  int far = 0;
  for (int i = 0; i < blocks * sine_block; ++i) far |= trigonometry::near_sine_cosine(angle[i], 0.0, sine[i], cosine[i]);
  if (far == 0) return;
  for (int i = 0; i < blocks * sine_block; ++i) sine_cosine(angle[i], sine[i], cosine[i]);
}

}  // namespace planar_chain
