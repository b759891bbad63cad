// Numbers of several scenes side by side in the lanes of one vector. Formulas are written once, for a type Real that is
// double or Lanes<n>. Without contraction each lane gets the bits that double alone would get.
#pragma once

#include <cstdint>
#include <cstring>

namespace planar_chain {

template <class Number, int count>
struct alignas(count * sizeof(Number)) LanesOf {
  typedef Number Numbers __attribute__((vector_size(count * sizeof(Number))));
  Numbers at;

#define PLANAR_CHAIN_INLINE __attribute__((always_inline)) inline
  PLANAR_CHAIN_INLINE LanesOf() : at{} {}
  PLANAR_CHAIN_INLINE LanesOf(Number everywhere) : at(everywhere - Numbers{}) {}  // x - 0 is x, also for x = -0
  PLANAR_CHAIN_INLINE explicit LanesOf(const Numbers& numbers) : at(numbers) {}

  // clang-format off: it would part ## and =
#define PLANAR_CHAIN_OPERATOR(symbol)                                                                             \
  PLANAR_CHAIN_INLINE friend LanesOf operator symbol(const LanesOf& a, const LanesOf& b) {                        \
    return LanesOf(a.at symbol b.at);                                                                             \
  }                                                                                                               \
  PLANAR_CHAIN_INLINE LanesOf& operator symbol##=(const LanesOf& b) { return *this = *this symbol b; }
  // clang-format on
  PLANAR_CHAIN_OPERATOR(+)
  PLANAR_CHAIN_OPERATOR(-)
  PLANAR_CHAIN_OPERATOR(*)
  PLANAR_CHAIN_OPERATOR(/)
  PLANAR_CHAIN_OPERATOR(&)
  PLANAR_CHAIN_OPERATOR(|)
  PLANAR_CHAIN_OPERATOR(^)
#undef PLANAR_CHAIN_OPERATOR
  PLANAR_CHAIN_INLINE friend LanesOf operator-(const LanesOf& a) { return LanesOf(-a.at); }
  PLANAR_CHAIN_INLINE friend LanesOf operator<<(const LanesOf& a, int bits) { return LanesOf(a.at << bits); }
  PLANAR_CHAIN_INLINE friend LanesOf operator>>(const LanesOf& a, int bits) { return LanesOf(a.at >> bits); }

  // True: all bits of the lane.
#define PLANAR_CHAIN_COMPARISON(symbol)                                                                         \
  PLANAR_CHAIN_INLINE friend LanesOf<std::int64_t, count> operator symbol(const LanesOf& a, const LanesOf& b) { \
    return LanesOf<std::int64_t, count>(a.at symbol b.at);                                                      \
  }
  PLANAR_CHAIN_COMPARISON(<)
  PLANAR_CHAIN_COMPARISON(>)
  PLANAR_CHAIN_COMPARISON(!=)
#undef PLANAR_CHAIN_COMPARISON
};

template <int count>
using Lanes = LanesOf<double, count>;

template <class Real>
constexpr int lanes_in = static_cast<int>(sizeof(Real) / sizeof(double));

// What a comparison of Reals gives, and their bits.
template <class Real>
using Truth = decltype(Real() < Real());
template <class Real>
struct BitsOf {
  using type = LanesOf<std::uint64_t, lanes_in<Real>>;
};
template <>
struct BitsOf<double> {
  using type = std::uint64_t;
};
template <class Real>
using Bits = typename BitsOf<Real>::type;

template <class To, class From>
PLANAR_CHAIN_INLINE To same_bits(const From& from) {
  static_assert(sizeof(To) == sizeof(From), "bits of one size");
  To to;
  std::memcpy(static_cast<void*>(&to), static_cast<const void*>(&from), sizeof to);
  return to;
}

PLANAR_CHAIN_INLINE double select(bool truth, double a, double b) { return truth ? a : b; }
template <int count>
PLANAR_CHAIN_INLINE Lanes<count> select(const LanesOf<std::int64_t, count>& truth, const Lanes<count>& a,
                                        const Lanes<count>& b) {
  return Lanes<count>(truth.at ? a.at : b.at);
}

PLANAR_CHAIN_INLINE bool any(bool truth) { return truth; }
template <int count>
PLANAR_CHAIN_INLINE bool any(const LanesOf<std::int64_t, count>& truth) {
  std::int64_t found = 0;
  for (int i = 0; i < count; ++i) found |= truth.at[i];
  return found != 0;
}

// One lane of a Real, for reading and for writing.
PLANAR_CHAIN_INLINE double lane(double number, int) { return number; }
template <int count>
PLANAR_CHAIN_INLINE double lane(const Lanes<count>& numbers, int i) {
  return numbers.at[i];
}
PLANAR_CHAIN_INLINE void set_lane(double& number, int, double value) { number = value; }
template <int count>
PLANAR_CHAIN_INLINE void set_lane(Lanes<count>& numbers, int i, double value) {
  numbers.at[i] = value;
}

}  // namespace planar_chain
