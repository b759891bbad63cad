// Sums that keep what rounding loses.
#pragma once

namespace planar_chain {

// Two-sum (Knuth, TAOCP 2, 4.2.2): what rounding loses goes into the remainder, so that error grows with steps^(1/2).
template <class Real>
inline void add_compensated(const Real& value, const Real& remainder, const Real& increment, Real& sum, Real& lost) {
  const Real term = increment + remainder, whole = value + term, back = whole - value;
  lost = (value - (whole - back)) + (term - back);
  sum = whole;
}

}  // namespace planar_chain
