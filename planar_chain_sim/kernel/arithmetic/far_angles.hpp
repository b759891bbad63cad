// Angles of many turns, reduced to a quarter turn with integers, after M. H. Payne and R. N. Hanek, Radian reduction
// for trigonometric functions, SIGNUM Newsletter 18 (1983), 19-24: of angle * 2/pi only the bits that are no multiple
// of four quarter turns are computed, 190 of them behind the point.
#pragma once

#include <cstdint>
#include <cstring>

namespace planar_chain {

namespace trigonometry {

// The bits of 2 / pi behind the point.
constexpr std::uint64_t two_over_pi[] = {0xa2f9836e4e441529, 0xfc2757d1f534ddc0, 0xdb6295993c439041, 0xfe5163abdebbc561,
                                         0xb7246e3a424dd2e0, 0x06492eea09d1921c, 0xfe1deb1cb129a73e, 0xe88235f52ebb4484,
                                         0xe99c7026b45f7e41, 0x3991d639835339f4, 0x9c845f8bbdf9283b, 0x1ff897ffde05980f,
                                         0xef2f118b5a0a6d1f, 0x6d367ecf27cb09b7, 0x4f463f669e5fea2d, 0x7527bac7ebe5f17b,
                                         0x3d0739f78a5292ea, 0x6bfb5fb11f8d5d08, 0x56033046fc7b6bab};

// 64 bits of 2/pi from bit `first` on, bit 0 being the first behind the point; zeros before it.
inline std::uint64_t bits_of_two_over_pi(int first) {
  const auto word = [](int i) { return i < 0 ? std::uint64_t(0) : two_over_pi[i]; };
  const int whole = (first + 128) / 64 - 2, rest = (first + 128) % 64;
  return rest == 0 ? word(whole) : word(whole) << rest | word(whole + 1) >> (64 - rest);
}

// angle - quarter pi/2 = r + tail with |r| <= pi/4, for finite |angle| >= 1; correct to 2^-110.
inline void reduce_far(double angle, double& r, double& tail, std::uint64_t& quarter) {
  std::uint64_t bits;
  std::memcpy(&bits, &angle, sizeof bits);
  const std::uint64_t mantissa = (bits & 0xFFFFFFFFFFFFF) | 0x10000000000000;  // |angle| = mantissa 2^exponent
  const int exponent = static_cast<int>(bits >> 52 & 0x7FF) - 1075;
  // mantissa times 192 bits of 2/pi that begin with the weight 2: fixed point, two bits before the point.
  const int first = exponent - 2;
  __extension__ typedef unsigned __int128 Wide;
  const Wide low = Wide(mantissa) * bits_of_two_over_pi(first + 128);
  const Wide middle = Wide(mantissa) * bits_of_two_over_pi(first + 64) + (low >> 64);
  const std::uint64_t high = mantissa * bits_of_two_over_pi(first) + static_cast<std::uint64_t>(middle >> 64);
  std::uint64_t fraction = high << 2 | static_cast<std::uint64_t>(middle) >> 62;
  std::uint64_t rest = static_cast<std::uint64_t>(middle) << 2 | static_cast<std::uint64_t>(low) >> 62;
  quarter = high >> 62;
  bool negative = false;
  if (fraction >> 63 != 0) {  // nearer to the next quarter
    ++quarter, negative = true;
    fraction = ~fraction, rest = ~rest;
  }
  // fraction 2^-64 + rest 2^-128 of a quarter, as four exact doubles of 32 bits, times pi/2 = half_1 + half_2
  constexpr double half_1 = 0x1.921fb54442d18p+0, half_2 = 0x1.1a62633145c07p-54;
  const double a = static_cast<double>(fraction >> 32) * 0x1p-32,
               b = static_cast<double>(fraction & 0xFFFFFFFF) * 0x1p-64;
  const double c = static_cast<double>(rest >> 32) * 0x1p-96, d = static_cast<double>(rest & 0xFFFFFFFF) * 0x1p-128;
  const double ab = a + b, ab_low = b - (ab - a);
  const double x = ab + (ab_low + (c + d)), x_low = (ab - x) + (ab_low + (c + d));
  // x half_1 exactly, by Dekker's splitting (Numer. Math. 18 (1971), 224-242)
  const double split = 134217729.0;
  const double x_high = x * split - (x * split - x), x_rest = x - x_high;
  const double p_high = half_1 * split - (half_1 * split - half_1), p_rest = half_1 - p_high;
  const double product = x * half_1;
  const double lost = ((x_high * p_high - product) + x_high * p_rest + x_rest * p_high) + x_rest * p_rest;
  const double correction = lost + (x * half_2 + x_low * half_1);
  r = product + correction;
  tail = (product - r) + correction;
  if (negative) r = -r, tail = -tail;
  if (bits >> 63 != 0) r = -r, tail = -tail, quarter = 0 - quarter;
}

}  // namespace trigonometry

}  // namespace planar_chain
