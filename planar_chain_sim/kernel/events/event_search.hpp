// The first time at which one of several smooth functions becomes negative.
//
// Signs at samples alone would miss a function that dips below zero between two of them. So each function is taken as
// the polynomial through its samples, in Bernstein's form: no value lies below the smallest coefficient, and if the
// coefficients only fall, the function only falls (G. Farin, Curves and Surfaces for CAGD, 5.1). An interval is halved
// until each function is certainly positive, only rises or only falls in it. The error of the polynomial is estimated
// conservatively.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace planar_chain {

// poor: the values were too inexact for a decision; more exact ones are known now.
enum class Found { nothing, crossing, failed, poor };

class EventSearch {
 public:
  double low = 0.0, high = 0.0;  // after Found::crossing: the interval in which they fall through zero
  std::vector<int> crossing;     // the functions that do

  // For functions numbered 0 .. count - 1.
  void resize(int count) {
    count_ = count;
    values_.resize(static_cast<std::size_t>(count) * most_samples);
    forget();
  }

  // The functions at `a`, if the next search begins there.
  double* known_at(double a) { return known_ = a, sample(1); }
  void forget() { known_ = nowhere; }

  // Values at `high` and `low`.
  const double* high_values() const { return &values_[0]; }
  const double* low_values() const { return &values_[count_]; }

  // `evaluate(time, values)` gives all functions at a time, or false. At `a` they are not negative, except by rounding.
  template <class Evaluate>
  Found find(Evaluate&& evaluate, double a, double b) {
    used_ = kept_samples, left_ = most_evaluations;
    least_width_ = 1e-14 * b;
    const int at_a = take(), at_b = take();
    const bool known = a == known_;
    forget();
    if (known) std::copy_n(sample(1), count_, sample(at_a));
    else if (!evaluate(a, sample(at_a))) return Found::failed;
    if (!evaluate(b, sample(at_b))) return Found::failed;
    const Found found = find_within(evaluate, a, at_a, b, at_b, none, most_depth);
    if (found == Found::nothing) std::copy_n(sample(at_b), count_, known_at(b));
    return found;
  }

  // Between low, where function `which` is not negative, and high, where it is: moves both towards each other until
  // they are neighbours, by inverse quadratic interpolation where that is safe, else by halving: T. R. Chandrupatla,
  // Advances in Engineering Software 28 (1997), 145-149. `value(time, f)` gives the function, or false.
  template <class Value>
  static bool close_in(Value&& value, double& low, double f_low, double& high, double f_high) {
    double a = high, f_a = f_high, b = low, f_b = f_low, t = 0.5;  // a is the newest
    for (int rounds = 0; rounds < 200; ++rounds) {
      const double width = std::fabs(b - a), least = spacing(std::fmax(std::fabs(a), std::fabs(b)));
      if (width <= least) break;
      t = std::fmin(std::fmax(t, least / width), 1.0 - least / width);
      const double x = a + t * (b - a);
      double f;
      if (x == a || x == b) break;
      if (!value(x, f)) return false;
      double c = a, f_c = f_a;
      if ((f < 0.0) != (f_a < 0.0)) c = b, f_c = f_b, b = a, f_b = f_a;
      a = x, f_a = f;
      const double xi = (a - b) / (c - b), phi = (f_a - f_b) / (f_c - f_b);
      t = 0.5;
      if (phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi)
        t = f_a / (f_b - f_a) * (f_c / (f_b - f_c)) + (c - a) / (b - a) * (f_a / (f_c - f_a)) * (f_b / (f_c - f_b));
      if (!(t > 0.0 && t < 1.0)) t = 0.5;
    }
    low = f_a < 0.0 ? b : a, high = f_a < 0.0 ? a : b;
    return true;
  }

 private:
  static constexpr int none = -1, kept_samples = 2, most_depth = 44, most_samples = 2 + 2 + 4 * (most_depth + 1);
  static constexpr int most_evaluations = 600;  // beyond, only the ends of intervals are evaluated

  static constexpr double nowhere = -1.0;

  static double spacing(double x) { return 2.0 * std::numeric_limits<double>::epsilon() * x; }

  double* sample(int k) { return &values_[static_cast<std::size_t>(k) * count_]; }
  int take() { return used_++; }

  template <class Evaluate>
  Found find_within(Evaluate& evaluate, double a, int at_a, double b, int at_b, int at_middle, int depth) {
    const int used = used_;
    const double middle = a + 0.5 * (b - a);
    if (at_middle == none) {
      at_middle = take(), --left_;
      if (!evaluate(middle, sample(at_middle))) return Found::failed;
    }
    const double *f_a = sample(at_a), *f_m = sample(at_middle), *f_b = sample(at_b);
    bool safe = true;
    for (int w = 0; w < count_ && safe; ++w) safe = positive(f_a[w], f_m[w], f_b[w]);
    if (safe) return used_ = used, Found::nothing;
    if (depth == 0 || left_ < 0 || b - a <= least_width_) return used_ = used, judge_ends(a, at_a, b, at_b);

    const int at_first = take(), at_last = take();
    left_ -= 2;
    if (!evaluate(a + 0.5 * (middle - a), sample(at_first)) || !evaluate(middle + 0.5 * (b - middle), sample(at_last)))
      return Found::failed;
    bool clear = true;
    std::vector<int>& fall = crossing;
    fall.clear();
    for (int w = 0; w < count_ && clear; ++w) {
      if (positive(f_a[w], f_m[w], f_b[w])) continue;
      const Course course = course_of(f_a[w], sample(at_first)[w], f_m[w], sample(at_last)[w], f_b[w]);
      clear = course != Course::unclear;
      if (course == Course::falls && f_b[w] < 0.0) fall.push_back(w);
    }
    if (clear) return used_ = used, fall.empty() ? Found::nothing : keep(a, at_a, b, at_b);
    Found found = find_within(evaluate, a, at_a, middle, at_middle, at_first, depth - 1);
    if (found == Found::nothing) found = find_within(evaluate, middle, at_middle, b, at_b, at_last, depth - 1);
    used_ = used;
    return found;
  }

  Found judge_ends(double a, int at_a, double b, int at_b) {
    crossing.clear();
    for (int w = 0; w < count_; ++w)
      if (sample(at_b)[w] < 0.0) crossing.push_back(w);
    return crossing.empty() ? Found::nothing : keep(a, at_a, b, at_b);
  }

  Found keep(double a, int at_a, double b, int at_b) {
    low = a, high = b;
    std::copy_n(sample(at_b), count_, sample(0));
    std::copy_n(sample(at_a), count_, sample(1));
    return Found::crossing;
  }

  // Whether the parabola through three samples is positive, with a margin for its error.
  static bool positive(double f_a, double f_m, double f_b) {
    const double bend = std::fabs(f_a - 2.0 * f_m + f_b), inner = 2.0 * f_m - 0.5 * (f_a + f_b);
    return std::fmin(std::fmin(f_a, f_b), inner) > 0.25 * bend + 0.02 * (std::fabs(f_b - f_a) + bend);
  }

  enum class Course { positive, rises, falls, unclear };

  // The same of the quartic through five samples.
  static Course course_of(double f0, double f1, double f2, double f3, double f4) {
    const double A = 256.0 * f1 - 81.0 * f0 - f4, B = 16.0 * f2 - f0 - f4, C = 256.0 * f3 - f0 - 81.0 * f4;
    const double sum = (A + C - 18.0 * B) / 48.0, difference = (A - C) / 96.0;
    const double b[5] = {f0, 0.5 * (sum + difference), (B - 4.0 * sum) / 6.0, 0.5 * (sum - difference), f4};
    const double third = std::fmax(std::fabs(f3 - 3.0 * f2 + 3.0 * f1 - f0), std::fabs(f4 - 3.0 * f3 + 3.0 * f2 - f1));
    const double largest = std::fmax(std::fmax(std::fabs(f0), std::fabs(f2)), std::fabs(f4));
    const double left_out = 0.06 * std::fabs(f0 - 4.0 * f1 + 6.0 * f2 - 4.0 * f3 + f4) + 0.004 * third +
                            4.0 * std::numeric_limits<double>::epsilon() * largest;
    bool rises = true, falls = true;
    double least = b[0];
    for (int k = 1; k < 5; ++k) {
      least = std::fmin(least, b[k]);
      rises = rises && b[k] - b[k - 1] > 4.0 * left_out;
      falls = falls && b[k - 1] - b[k] > 4.0 * left_out;
    }
    // From zero it may begin like a square or a cube.
    rises = rises || (f0 == 0.0 && std::fmin(b[1], b[2]) >= -left_out &&
                      b[3] - std::fmax(b[1], b[2]) > 4.0 * left_out && b[4] - b[3] > 4.0 * left_out);
    return least > left_out ? Course::positive : rises ? Course::rises : falls ? Course::falls : Course::unclear;
  }

  int count_ = 0, used_ = 0, left_ = 0;
  double least_width_ = 0.0;
  double known_ = nowhere;      // where the functions are those in row 1
  std::vector<double> values_;  // a row for each sample; the first two are those at `high` and `low`
};

}  // namespace planar_chain
