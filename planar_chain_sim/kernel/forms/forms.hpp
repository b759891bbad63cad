// Which class evaluates a form for a chain: the shape of the chain decides, once.
#pragma once

#include <memory>

#include "dense.hpp"
#include "dense_unrolled.hpp"
#include "recursive.hpp"
#include "recursive_serial.hpp"
#include "refined.hpp"

namespace planar_chain {

// Links up to which `auto` takes the dense form of a serial chain that only turns. Measured once: uniform rods, gcc 12,
// a 3 GHz x86-64 core with AVX2, dense and recursion in ns: 170, 194 at 6 links, 205, 215 at 7, 243, 241 at 8. The
// recursion keeps about a digit more, so what is nearly a tie goes to it.
constexpr int most_dense_links = 6;

// Links up to which the dense form is unrolled. In lanes as far as `auto` goes: it takes long to build.
template <class Real>
constexpr int most_unrolled = lanes_in<Real> > 1 ? most_dense_links : 8;

template <class Real, int N = most_unrolled<Real>>
std::unique_ptr<FormOf<Real>> make_unrolled(const ChainOf<Real>& chain) {
  if constexpr (N > 1)
    if (chain.link_count() < N) return make_unrolled<Real, N - 1>(chain);
  return std::make_unique<UnrolledDenseOf<N, Real>>(chain);
}

// Null for a dense form that is not made for lanes.
template <class Real>
std::unique_ptr<FormOf<Real>> make_form(const ChainOf<Real>& chain, bool dense) {
  const bool serial = SerialRecursionOf<Real>::holds_for(chain);
  if (dense && serial && chain.link_count() <= most_unrolled<Real>) return make_unrolled<Real>(chain);
  if constexpr (lanes_in<Real> == 1) {
    if (dense) return std::make_unique<DenseOf<Real>>(chain);
  }
  if (dense) return nullptr;
  if (serial) return std::make_unique<SerialRecursionOf<Real>>(chain);
  if (chain.refined) return std::make_unique<RefinedRecursionOf<Real>>(chain);
  for (int i = 1; i <= chain.link_count(); ++i)
    if (!chain.links[i].turns() || chain.links[i].slides() || chain.links[i].has_rotor())
      return std::make_unique<RecursionOf<Real>>(chain);
  return std::make_unique<RecursionOf<Real, true>>(chain);
}

}  // namespace planar_chain
