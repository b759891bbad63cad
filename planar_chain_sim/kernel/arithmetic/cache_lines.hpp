// Vectors of numbers that begin at a cache line, so that reading them takes the same time wherever the heap put them.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace planar_chain {

template <class Number>
struct CacheLines {
  using value_type = Number;
  static constexpr std::align_val_t line{64};

  CacheLines() = default;
  template <class Other>
  CacheLines(const CacheLines<Other>&) {}

  Number* allocate(std::size_t count) { return static_cast<Number*>(::operator new(count * sizeof(Number), line)); }
  void deallocate(Number* numbers, std::size_t) { ::operator delete(numbers, line); }
  template <class Other>
  bool operator==(const CacheLines<Other>&) const {
    return true;
  }
  template <class Other>
  bool operator!=(const CacheLines<Other>&) const {
    return false;
  }
};

template <class Number>
using AlignedVector = std::vector<Number, CacheLines<Number>>;

}  // namespace planar_chain
