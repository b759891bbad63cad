// Sums that keep their rounding errors.
#pragma once

namespace planar_chain {

// Two-sum (Knuth, TAOCP 2, 4.2.2): the rounding error goes into the remainder, so the error grows like steps^(1/2).
template <class Real>
inline void add_compensated(const Real& value, const Real& remainder, const Real& increment, Real& sum, Real& lost) {
  const Real term = increment + remainder, whole = value + term, back = whole - value;
  lost = (value - (whole - back)) + (term - back);
  sum = whole;
}

}  // namespace planar_chain
