// LU factors of a square matrix with exchange of rows (Golub, Van Loan, Matrix Computations, 3.4).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace planar_chain {

class LU {
 public:
  explicit LU(int size) : size_(size), rows_(static_cast<std::size_t>(size) * size), pivot_(size) {}

  // The matrix to factorise goes in here, row by row.
  double* matrix() { return rows_.data(); }

  // False where the matrix is singular to working precision or not finite.
  bool factorise() {
    for (int k = 0; k < size_; ++k) {
      int best = k;
      for (int i = k + 1; i < size_; ++i)
        if (std::fabs(row(i)[k]) > std::fabs(row(best)[k])) best = i;
      pivot_[k] = best;
      if (best != k) std::swap_ranges(row(k), row(k) + size_, row(best));
      if (!(std::fabs(row(k)[k]) > 0.0) || !std::isfinite(row(k)[k])) return false;
      const double inverse = 1.0 / row(k)[k];
      for (int i = k + 1; i < size_; ++i) {
        const double factor = row(i)[k] *= inverse;
        for (int j = k + 1; j < size_; ++j) row(i)[j] -= factor * row(k)[j];
      }
    }
    return true;
  }

  // The right side goes in, the solution comes out.
  void solve(double* x) const {
    for (int k = 0; k < size_; ++k) std::swap(x[k], x[pivot_[k]]);
    for (int i = 1; i < size_; ++i)
      for (int j = 0; j < i; ++j) x[i] -= row(i)[j] * x[j];
    for (int i = size_ - 1; i >= 0; --i) {
      for (int j = i + 1; j < size_; ++j) x[i] -= row(i)[j] * x[j];
      x[i] /= row(i)[i];
    }
  }

 private:
  double* row(int i) { return &rows_[static_cast<std::size_t>(i) * size_]; }
  const double* row(int i) const { return &rows_[static_cast<std::size_t>(i) * size_]; }

  const int size_;
  std::vector<double> rows_;
  std::vector<int> pivot_;
};

}  // namespace planar_chain
