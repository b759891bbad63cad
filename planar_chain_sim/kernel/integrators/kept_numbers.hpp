// The numbers that an integrator keeps for a checkpoint, and how they are read back.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace planar_chain {

// The first of the numbers: the kind of integrator that kept them.
enum class Kept { nothing = 1, gauss, adaptive, events };

// Reads such numbers one by one, and notes whether each was there and is possible.
class KeptNumbers {
 public:
  KeptNumbers(const double* begin, const double* end) : at_(begin), end_(end) {}

  bool cut = false;  // whether events cut the motion short: its times are then known up to rounding

  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }
  const double* at() const { return at_; }

  bool is(Kept kind) {
    double value;
    return number(value) && value == static_cast<double>(kind);
  }
  bool number(double& value) {
    if (at_ == end_ || !std::isfinite(*at_)) return false;
    value = *at_++;
    return true;
  }
  bool at_least_zero(double& value) { return number(value) && value >= 0.0; }

  // A whole number from `least` to `most`, both exact as a double.
  template <class Whole>
  bool whole(Whole& value, double least, double most) {
    double given;
    if (!number(given) || given < least || given > most || given != std::floor(given)) return false;
    value = static_cast<Whole>(given);
    return true;
  }
  bool numbers(std::vector<double>& values) {
    for (double& value : values)
      if (!number(value)) return false;
    return true;
  }

 private:
  const double *at_, *end_;
};

}  // namespace planar_chain
