// The width of the processor's vectors, determined at run time: a plain build runs on every machine and uses what that
// has. The bits do not depend on it.
#pragma once

#include <vector>

#include "lanes.hpp"

// -DPLANAR_CHAIN_NARROW leaves wide vectors out and inlines less, for builds that take long, as with a sanitizer.
#ifdef PLANAR_CHAIN_NARROW
#define PLANAR_CHAIN_FLAT
#elif defined(__x86_64__)
#define PLANAR_CHAIN_VECTORS
#define PLANAR_CHAIN_FLAT __attribute__((flatten, cold))  // of processors of before 2013: small, which compiles faster
#else
#define PLANAR_CHAIN_FLAT __attribute__((flatten))
#endif

namespace planar_chain {

// run(work) compiles work.run(), with all that it calls, for vectors of `count` numbers.
template <int count>
struct VectorWidth;

template <>
struct VectorWidth<2> {
  static bool exists() { return true; }
  template <class Work>
  PLANAR_CHAIN_FLAT static void run(Work& work) {
    work.run();
  }
};

#ifdef PLANAR_CHAIN_VECTORS
template <>
struct VectorWidth<4> {
  static bool exists() { return __builtin_cpu_supports("avx2"); }
  template <class Work>
  __attribute__((target("avx2"), flatten)) static void run(Work& work) {
    work.run();
  }
};

template <>
struct VectorWidth<8> {
  static bool exists() { return __builtin_cpu_supports("avx512f"); }
  template <class Work>
  __attribute__((target("avx512f"), flatten)) static void run(Work& work) {
    work.run();
  }
};
#endif

// The available widths, the widest last.
inline std::vector<int> vector_widths() {
  std::vector<int> widths = {2};
#ifdef PLANAR_CHAIN_VECTORS
  if (VectorWidth<4>::exists()) widths.push_back(4);
  if (VectorWidth<8>::exists()) widths.push_back(8);
#endif
  return widths;
}

template <int count>
struct OfWidth {
  using Real = Lanes<count>;
  using Vectors = VectorWidth<count>;
};

// task(OfWidth<width>()) for one of these widths.
template <class Task>
void with_width(int width, const Task& task) {
#ifdef PLANAR_CHAIN_VECTORS
  if (width == 8) return task(OfWidth<8>());
  if (width == 4) return task(OfWidth<4>());
#endif
  task(OfWidth<2>());
}

}  // namespace planar_chain
