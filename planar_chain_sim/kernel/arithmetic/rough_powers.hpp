// Logarithms and powers, exact enough to choose a step or a warning. Unlike libm's they have the same bits on every
// machine.
#pragma once

#include <cstdint>
#include <cstring>

namespace planar_chain {

// log2 x within 0.01 for positive normal x, and 2^x within 0.3 %.
inline double rough_log2(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const int exponent = static_cast<int>(bits >> 52) - 1023;
  bits = (bits & 0xFFFFFFFFFFFFFu) | 0x3FF0000000000000u;
  double m;  // x = m 2^e, 1 <= m < 2
  std::memcpy(&m, &bits, sizeof m);
  return exponent + (m - 1.0) * (1.34 - 0.34 * (m - 1.0));
}
inline double rough_power_of_2(double x) {
  if (!(x > -1000.0)) return 0.0;
  if (x > 1000.0) x = 1000.0;
  const int whole = static_cast<int>(x + 1024.0) - 1024;  // rounds down
  const double part = x - whole;
  const std::uint64_t bits = static_cast<std::uint64_t>(whole + 1023) << 52;
  double power;
  std::memcpy(&power, &bits, sizeof power);
  return power * (1.0 + part * (0.6565 + 0.3435 * part));
}

// x^(1/n) for x >= 0, within 1 %.
inline double rough_root(double x, int n) { return x > 0.0 ? rough_power_of_2(rough_log2(x) / n) : 0.0; }

// x^n, n >= 0.
inline double power(double x, int n) {
  double product = 1.0;
  for (; n > 0; --n) product *= x;
  return product;
}

// e^x for |x| <= 100, within 15 %, and within 1e-5 up to 1.
inline double rough_exponential(double x) {
  const double part = x / 1024.0;
  double result = 1.0 + part * (1.0 + 0.5 * part);
  for (int k = 0; k < 10; ++k) result *= result;
  return result;
}

}  // namespace planar_chain
