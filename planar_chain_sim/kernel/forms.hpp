// Which class evaluates a form for a chain: the shape of the chain decides, once.
#pragma once

#include <memory>

#include "dense.hpp"
#include "dense_unrolled.hpp"
#include "recursive.hpp"
#include "recursive_serial.hpp"
#include "refined.hpp"

namespace planar_chain {

constexpr int most_unrolled = 8;  // links; beyond, the recursion is faster than any dense form

template <class Real, int N = most_unrolled>
std::unique_ptr<FormOf<Real>> make_unrolled(const Chain& chain) {
  if constexpr (N > 1)
    if (chain.link_count() < N) return make_unrolled<Real, N - 1>(chain);
  return std::make_unique<UnrolledDenseOf<N, Real>>(chain);
}

template <class Real>
std::unique_ptr<FormOf<Real>> make_form(const Chain& chain, bool dense) {
  const bool serial = SerialRecursionOf<Real>::holds_for(chain);
  if (dense && serial && chain.link_count() <= most_unrolled) return make_unrolled<Real>(chain);
  if (dense) return std::make_unique<DenseOf<Real>>(chain);
  if (chain.refined) return std::make_unique<RefinedRecursionOf<Real>>(chain);
  if (serial) return std::make_unique<SerialRecursionOf<Real>>(chain);
  return std::make_unique<RecursionOf<Real>>(chain);
}

}  // namespace planar_chain
