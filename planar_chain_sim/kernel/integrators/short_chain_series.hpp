// The series of a short chain, unrolled for its number of joints: what taylor_short_chain.hpp fills and reads.
//
// Every joint point and mass centre is a sum of constants times a few turning and stretching vectors: E_i = e^(j phi_i)
// of a link that turns, and Y_w = x_w E_p of one that slides on a carrier p (D of equations.md 3 and 5, with its x
// taken out). With Z = (E, Y) the equations of 3 are, for constant complex B and inertia,
//
//   Gamma_a = sum over b of B_ab Z_b'' - conj(C_a) g      B_ab = sum over k of m_k conj(C_ak) C_bk,
//                                                         C_ak: coefficient of Z_a in the mass centre C_k
//   Q_i = H_ii phi_i'' + (j E_i) . Gamma_i + sum over slides on i of (j Y_w) . Gamma_w
//   f_w = E_p . Gamma_w
//   E' = j phi' E,   Y = x E_p
//
// (the part of H_ii that does not change apart, B_ii = 0 for a link that turns; a force f E from outside adds
// -conj(C_a) f E to Gamma_a, C_a being that of the point where it acts), so that an order costs two complex
// convolutions a vector and two small products with matrices of the step: the inverse of H, and that inverse times what
// the left sides make of B Z''.
#pragma once

#include <vector>

#include "../arithmetic/lanes.hpp"

namespace planar_chain {

// A few numbers at a time, with whatever vectors the machine has: the bits do not depend on it.
typedef double Two __attribute__((vector_size(16), aligned(16), may_alias));
typedef double Quad __attribute__((vector_size(32), aligned(32), may_alias));
template <int Width>
struct VectorOf {
  using type = Quad;
};
template <>
struct VectorOf<2> {
  using type = Two;
};

// Slides are few, one as a rule: their loops stay loops. Unrolled as far as there may be slides, each inside the next,
// they took half of the time in which the kernel is compiled, for nothing.
#define PLANAR_CHAIN_SLIDES(w) _Pragma("GCC unroll 1") for (int w = 0; w < slides; ++w)

// `Angles`: at least the links that turn; they lie side by side in the lanes of vectors, from the root to the leaves,
// then idle ones that make the number up: uncoupled, of unit inertia, at rest. `Slides`: whether any joint slides;
// slides are few and go one by one.
//
// A row is made in registers and stored whole: numbers stored one by one could not be loaded as a vector at once.
template <int Angles, bool Slides>
class ShortChainSeries {
 public:
  static constexpr int width = Angles <= 2 ? 2 : 4;  // of a machine's vector
  static constexpr int lanes = (Angles + width - 1) / width * width;
  static constexpr int parts = lanes / width;
  static constexpr int most_orders = 30, most_slides = Slides ? 8 : 1;
  using Vector = typename VectorOf<width>::type;

  struct alignas(sizeof(Vector)) Row {
    double of[lanes];
    Vector& operator()(int p) { return reinterpret_cast<Vector*>(of)[p]; }
    const Vector& operator()(int p) const { return reinterpret_cast<const Vector*>(of)[p]; }
  };
  using Series = Row[most_orders + 3];  // a row for each order
  using Numbers = double[most_slides];  // of each slide

  // Constants of the chain. B_ij = coupling: a row for each column j, lanes i.
  int angles = 0, slides = 0;                           // that are not idle
  int carrier[lanes] = {}, rides_on[most_slides] = {};  // the angle that carries, -1: base
  Row coupling_x[Angles] = {}, coupling_y[Angles] = {};
  bool straight = true;                              // Im B = 0 between angles: gamma = eta = 0
  Row weight_x = {}, weight_y = {};                  // -conj(C_i) g
  Row inertia[Angles] = {};                          // of H what does not change
  Row damping[Angles] = {}, stiffness[Angles] = {};  // S d S^T and S k S^T: a row for each column
  std::vector<int> damped, sprung;                   // columns that are not zero

  // The same of slides: columns with the lanes of the angles, and between slides.
  Row slide_coupling_x[most_slides] = {}, slide_coupling_y[most_slides] = {};
  Numbers between_x[most_slides] = {}, between_y[most_slides] = {};
  Numbers slide_weight_x = {}, slide_weight_y = {}, slide_inertia = {}, slide_damping = {}, slide_stiffness = {};

  // conj(C_a) f of a force from outside, and the angle with which it turns, -1: none.
  struct Push {
    int turns_with;
    Row x = {}, y = {};
    Numbers slide_x = {}, slide_y = {};
  };
  std::vector<Push> pushes;

  // Coefficients. speed: phi'. unit: E. pull: Gamma. acceleration: (phi'')_k.
  Series speed = {}, unit_x = {}, unit_y = {}, pull_x = {}, pull_y = {}, acceleration = {};
  Row known = {};  // Q of joint laws and gravity, of order 0
  struct SlideSeries {
    double place[most_orders + 3] = {};                                    // x
    double unit_x[most_orders + 3] = {1.0}, unit_y[most_orders + 3] = {};  // E of the carrier
    double arm_x[most_orders + 3] = {}, arm_y[most_orders + 3] = {};       // Y
    double pull_x[most_orders + 3] = {}, pull_y[most_orders + 3] = {};     // Gamma
    double acceleration[most_orders + 3] = {};                             // (x'')_k
    double known = 0.0;                                                    // f of order 0
  } slide[most_slides];

  // Matrices of the step from orders 0 of the vectors. Returns -1, or what has no pivot: an angle, or Angles + a slide.
  PLANAR_CHAIN_INLINE int prepare() {
    Column h[Angles], g[most_slides];  // H, column by column: of angles, of slides
    Column arm_x[Angles], arm_y[Angles], slide_arm_x[most_slides], slide_arm_y[most_slides];
    for (int b = 0; b < Angles; ++b) {
      add_effect(coupling_x[b], coupling_y[b], arm_x[b], arm_y[b]);
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w)
      add_effect(w, slide_coupling_x[w].of[b], -slide_coupling_y[w].of[b], arm_x[b], arm_y[b]);  // B = B*
    }
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(v) {
        add_effect(slide_coupling_x[v], slide_coupling_y[v], slide_arm_x[v], slide_arm_y[v]);
        PLANAR_CHAIN_SLIDES(w) add_effect(w, between_x[w][v], between_y[w][v], slide_arm_x[v], slide_arm_y[v]);
      }
    for (int j = 0; j < Angles; ++j) {
      for (int p = 0; p < parts; ++p) h[j].lane[p] = inertia[j](p);
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) h[j].slide[w] = 0.0;
      add(arm_x[j], arm_y[j], -unit_y[0].of[j], unit_x[0].of[j], h[j]);
    }
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
        g[w] = Column{};
        g[w].slide[w] = slide_inertia[w];
        add(slide_arm_x[w], slide_arm_y[w], slide[w].unit_x[0], slide[w].unit_y[0], g[w]);
        for (int j = 0; j < Angles; ++j)
          if (j == rides_on[w]) add(slide_arm_x[w], slide_arm_y[w], -slide[w].arm_y[0], slide[w].arm_x[0], h[j]);
      }
    const int singular = invert(h, g);
    if (singular >= 0) return singular;
    for (int j = 0; j < Angles; ++j)
      for (int p = 0; p < parts; ++p) inverse_[j](p) = h[j].lane[p];
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
        for (int p = 0; p < parts; ++p) slide_inverse_[w](p) = g[w].lane[p];
        PLANAR_CHAIN_SLIDES(v) between_inverse_[w][v] = g[v].slide[w];
      }
    for (int b = 0; b < Angles; ++b) {
      answer(arm_x[b], answer_x_[b]), answer(arm_y[b], answer_y_[b]);
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w)
      row_answer_x_[w].of[b] = answer_of_slide(w, arm_x[b]), row_answer_y_[w].of[b] = answer_of_slide(w, arm_y[b]);
    }
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(v) {
        answer(slide_arm_x[v], slide_answer_x_[v]), answer(slide_arm_y[v], slide_answer_y_[v]);
        PLANAR_CHAIN_SLIDES(w) {
          between_answer_x_[w][v] = answer_of_slide(w, slide_arm_x[v]);
          between_answer_y_[w][v] = answer_of_slide(w, slide_arm_y[v]);
        }
      }
    return -1;
  }

  // Everything of order k from what is known up to it; reciprocal[i] = 1 / i. The newest coefficients come last in each
  // sum, so that most of it can be done while these are still being computed.
  PLANAR_CHAIN_INLINE void advance(int k, const double* reciprocal) {
    Vector turn_x[parts] = {}, turn_y[parts] = {}, torque[parts] = {}, against[parts] = {};
    {
      const Row *rate = &speed[1], *ex = &unit_x[k], *ey = &unit_y[k];  // sum over m <= k of speed_m unit_(k+1-m)
      const Row *zx = &unit_x[2], *zy = &unit_y[2], *gx = &pull_x[k] - 2, *gy = &pull_y[k] - 2;
      for (int m = 1; m < k; ++m, ++rate, --ex, --ey, ++zx, ++zy, --gx, --gy)
        for (int p = 0; p < parts; ++p) {  // sum over m = 1 .. k of (j E_m) . Gamma_(k-m)
          turn_x[p] += (*rate)(p) * (*ex)(p), turn_y[p] += (*rate)(p) * (*ey)(p);
          torque[p] += (*zx)(p) * (*gy)(p), against[p] += (*zy)(p) * (*gx)(p);
        }
    }
    Row bend_x, bend_y, balance;  // E'' as far as it is known, Q less what is known of the left side
    const double order = k + 1;
    for (int p = 0; p < parts; ++p) {
      Vector rest = torque[p] - against[p];
      if (k > 0) {
        turn_x[p] += speed[k](p) * unit_x[1](p), turn_y[p] += speed[k](p) * unit_y[1](p);
        rest += unit_x[1](p) * pull_y[k - 1](p) - unit_y[1](p) * pull_x[k - 1](p);
      }
      turn_x[p] += speed[0](p) * unit_x[k + 1](p), turn_y[p] += speed[0](p) * unit_y[k + 1](p);
      bend_x(p) = -order * turn_y[p], bend_y(p) = order * turn_x[p];
      balance(p) = (k == 0 ? known(p) : Vector{}) - rest;
    }
    if (k > 0 && !(damped.empty() && sprung.empty())) add_laws(k, reciprocal[k], balance);
    Known of[most_slides];
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) of[w] = known_of(w, k, bend_x, bend_y);
    if (k > 0 && !pushes.empty()) push_joints(k, balance, of);

    for (int p = 0; p < parts; ++p) {
      Vector more, less, across;
      multiply(inverse_, balance, p, more);
      multiply(answer_x_, bend_x, p, less), multiply(answer_y_, bend_y, p, across);
      less += across;
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
          more += slide_inverse_[w](p) * of[w].balance;
          less += slide_answer_x_[w](p) * of[w].bend_x + slide_answer_y_[w](p) * of[w].bend_y;
          if (rides_on[w] >= 0) more += inverse_[rides_on[w]](p) * of[w].torque;
        }
      acceleration[k](p) = more - less;
    }
    if constexpr (Slides)
      PLANAR_CHAIN_SLIDES(w) slide[w].acceleration[k] = acceleration_of(w, of, bend_x, bend_y, balance);

    for (int p = 0; p < parts; ++p) {
      speed[k + 1](p) = acceleration[k](p) * reciprocal[k + 1];
      turn_x[p] += speed[k + 1](p) * unit_x[0](p), turn_y[p] += speed[k + 1](p) * unit_y[0](p);
      unit_x[k + 2](p) = -turn_y[p] * reciprocal[k + 2], unit_y[k + 2](p) = turn_x[p] * reciprocal[k + 2];
      bend_x(p) = -order * turn_y[p], bend_y(p) = order * turn_x[p];
    }
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) move(w, k, reciprocal, of[w]);

    for (int p = 0; p < parts; ++p) {
      Vector x, y;
      multiply(coupling_x, bend_x, p, x), multiply(coupling_x, bend_y, p, y);
      if (!straight) {
        Vector minus, plus;
        multiply(coupling_y, bend_y, p, minus), multiply(coupling_y, bend_x, p, plus);
        x -= minus, y += plus;
      }
      if (k == 0) x += weight_x(p), y += weight_y(p);
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
          x += slide_coupling_x[w](p) * of[w].bend_x - slide_coupling_y[w](p) * of[w].bend_y;
          y += slide_coupling_x[w](p) * of[w].bend_y + slide_coupling_y[w](p) * of[w].bend_x;
        }
      pull_x[k](p) = x, pull_y[k](p) = y;
    }
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) pull(w, k, of, bend_x, bend_y);
    if (!pushes.empty()) push_vectors(k);
  }

 private:
  struct Column {  // of a matrix: a number for each angle and each slide
    Vector lane[parts];
    Numbers slide;
  };
  struct Known {             // of a slide at one order
    double arm_x, arm_y;     // Y without its newest terms
    double bend_x, bend_y;   // Y''
    double balance, torque;  // force along the slide; torque that moves on to the carrier
  };

  static double sum(const Vector& of) {
    if constexpr (width == 2) return of[0] + of[1];
    else return (of[0] + of[1]) + (of[2] + of[3]);
  }

  // Sum over j of columns[j] x_j, in pairs: the less there is to wait for. (A returned vector would be a matter of
  // ABI.)
  template <int from = 0, int count = Angles>
  PLANAR_CHAIN_INLINE static void multiply(const Row (&columns)[Angles], const Row& x, int p, Vector& product) {
    if constexpr (count == 1) {
      product = columns[from](p) * x.of[from];
    } else {
      Vector other;
      multiply<from, count / 2>(columns, x, p, product);
      multiply<from + count / 2, count - count / 2>(columns, x, p, other);
      product += other;
    }
  }

  // Effect of z at a vector with column B on the angles: arm . z = (j E_i) . (B_i z).
  PLANAR_CHAIN_INLINE void add_effect(const Row& re, const Row& im, Column& x, Column& y) const {
    for (int p = 0; p < parts; ++p) {
      x.lane[p] = unit_x[0](p) * im(p) - unit_y[0](p) * re(p);
      y.lane[p] = unit_x[0](p) * re(p) + unit_y[0](p) * im(p);
    }
  }

  // Effect on slide w, E . (B_w z), and on its carrier, (j Y_w) . (B_w z).
  PLANAR_CHAIN_INLINE void add_effect(int w, double re, double im, Column& x, Column& y) const {
    const SlideSeries& s = slide[w];
    x.slide[w] = s.unit_x[0] * re + s.unit_y[0] * im, y.slide[w] = s.unit_y[0] * re - s.unit_x[0] * im;
    for (int j = 0; j < Angles; ++j)
      if (j == rides_on[w]) {
        x.lane[j / width][j % width] += s.arm_x[0] * im - s.arm_y[0] * re;
        y.lane[j / width][j % width] += s.arm_x[0] * re + s.arm_y[0] * im;
      }
  }

  PLANAR_CHAIN_INLINE void add(const Column& arm_x, const Column& arm_y, double x, double y, Column& sum) const {
    for (int p = 0; p < parts; ++p) sum.lane[p] += arm_x.lane[p] * x + arm_y.lane[p] * y;
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) sum.slide[w] += arm_x.slide[w] * x + arm_y.slide[w] * y;
  }

  // Gauss and Jordan, slides first, then angles from the leaves, in registers; with the guard of equations.md 7.
  PLANAR_CHAIN_INLINE int invert(Column (&h)[Angles], Column (&g)[most_slides]) const {
    double least[Angles], least_of_slide[most_slides];
#pragma GCC unroll 8
    for (int i = 0; i < Angles; ++i) least[i] = 100.0 * 2.220446049250313e-16 * h[i].lane[i / width][i % width];
    if constexpr (Slides) {
      PLANAR_CHAIN_SLIDES(w) least_of_slide[w] = 100.0 * 2.220446049250313e-16 * g[w].slide[w];
      PLANAR_CHAIN_SLIDES(w) {
        const double pivot = g[w].slide[w];
        if (!(pivot > least_of_slide[w])) return Angles + w;
        g[w].slide[w] = 1.0;
        scale(g[w], 1.0 / pivot);
        PLANAR_CHAIN_SLIDES(v)
        if (v != w) eliminate(g[w], g[v], take_slide(g[v], w));
        for (int j = 0; j < Angles; ++j) eliminate(g[w], h[j], take_slide(h[j], w));
      }
    }
#pragma GCC unroll 8
    for (int k = Angles - 1; k >= 0; --k) {
      if (k >= angles) continue;
      const double pivot = h[k].lane[k / width][k % width];
      if (!(pivot > least[k])) return k;
      h[k].lane[k / width][k % width] = 1.0;
      scale(h[k], 1.0 / pivot);
#pragma GCC unroll 8
      for (int i = 0; i < Angles; ++i)
        if (i != k) eliminate(h[k], h[i], take_angle(h[i], k));
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) eliminate(h[k], g[w], take_angle(g[w], k));
    }
    return -1;
  }

  PLANAR_CHAIN_INLINE void scale(Column& column, double factor) const {
    for (int p = 0; p < parts; ++p) column.lane[p] *= factor;
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) column.slide[w] *= factor;
  }

  // What a column has in the pivot's row, which becomes zero. (clang refuses a reference to a part of a vector.)
  PLANAR_CHAIN_INLINE double take_angle(Column& column, int k) const {
    const double entry = column.lane[k / width][k % width];
    column.lane[k / width][k % width] = 0.0;
    return entry;
  }
  PLANAR_CHAIN_INLINE double take_slide(Column& column, int w) const {
    const double entry = column.slide[w];
    column.slide[w] = 0.0;
    return entry;
  }

  // Takes the pivot's column out of another, `factor` times.
  PLANAR_CHAIN_INLINE void eliminate(const Column& pivot, Column& other, double factor) const {
    for (int p = 0; p < parts; ++p) other.lane[p] -= factor * pivot.lane[p];
    if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) other.slide[w] -= factor * pivot.slide[w];
  }

  // The inverse of H times an arm: its angles, and one of its slides, whose row is its column.
  PLANAR_CHAIN_INLINE void answer(const Column& arm, Row& out) const {
    for (int p = 0; p < parts; ++p) {
      Vector sum = {};
#pragma GCC unroll 8
      for (int l = 0; l < Angles; ++l) sum += inverse_[l](p) * arm.lane[l / width][l % width];
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) sum += slide_inverse_[w](p) * arm.slide[w];
      out(p) = sum;
    }
  }
  PLANAR_CHAIN_INLINE double answer_of_slide(int w, const Column& arm) const {
    double total = 0.0;
    for (int p = 0; p < parts; ++p) total += sum(slide_inverse_[w](p) * arm.lane[p]);
    PLANAR_CHAIN_SLIDES(v) total += between_inverse_[w][v] * arm.slide[v];
    return total;
  }

  // Efforts of dampers and springs of angles at order k.
  PLANAR_CHAIN_INLINE void add_laws(int k, double reciprocal, Row& balance) const {
    for (int p = 0; p < parts; ++p) {
      Vector damp = {}, draw = {};
      for (int j : damped) damp += damping[j](p) * speed[k].of[j];
      for (int j : sprung) draw += stiffness[j](p) * (speed[k - 1].of[j] * reciprocal);
      balance(p) -= damp + draw;
    }
  }

  // E of a push, its coefficient k.
  double push_x(const Push& push, int k) const { return push.turns_with >= 0 ? unit_x[k].of[push.turns_with] : k == 0; }
  double push_y(const Push& push, int k) const { return push.turns_with >= 0 ? unit_y[k].of[push.turns_with] : 0.0; }

  // Joint efforts of pushes at order k; at order 0 they are among the known efforts.
  PLANAR_CHAIN_INLINE void push_joints(int k, Row& balance, Known* of) const {
    for (const Push& push : pushes) {
      const double ex = push_x(push, k), ey = push_y(push, k);
      for (int p = 0; p < parts; ++p)
        balance(p) +=
            unit_x[0](p) * (push.x(p) * ey + push.y(p) * ex) - unit_y[0](p) * (push.x(p) * ex - push.y(p) * ey);
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
          const SlideSeries& s = slide[w];
          const double fx = push.slide_x[w] * ex - push.slide_y[w] * ey,
                       fy = push.slide_x[w] * ey + push.slide_y[w] * ex;
          of[w].balance += s.unit_x[0] * fx + s.unit_y[0] * fy;
          of[w].torque += s.arm_x[0] * fy - s.arm_y[0] * fx;
        }
    }
  }

  // Their share in Gamma of order k.
  PLANAR_CHAIN_INLINE void push_vectors(int k) {
    for (const Push& push : pushes) {
      const double ex = push_x(push, k), ey = push_y(push, k);
      for (int p = 0; p < parts; ++p) {
        pull_x[k](p) -= push.x(p) * ex - push.y(p) * ey;
        pull_y[k](p) -= push.x(p) * ey + push.y(p) * ex;
      }
      if constexpr (Slides) PLANAR_CHAIN_SLIDES(w) {
          slide[w].pull_x[k] -= push.slide_x[w] * ex - push.slide_y[w] * ey;
          slide[w].pull_y[k] -= push.slide_x[w] * ey + push.slide_y[w] * ex;
        }
    }
  }

  // The part of slide w at order k that follows from lower orders. bend_x and bend_y have its carrier's bend, 0 for the
  // base.
  PLANAR_CHAIN_INLINE Known known_of(int w, int k, const Row& bend_x, const Row& bend_y) const {
    const SlideSeries& s = slide[w];
    Known out = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    double force = 0.0;
    if (const int i = rides_on[w]; i >= 0) {
      double along[2] = {}, across[2] = {};
      for (int m = 1; m <= k; ++m) {  // sums over m = 1 .. k of E_m . Gamma_(k-m) and (j Y_m) . Gamma_(k-m)
        along[0] += s.unit_x[m] * s.pull_x[k - m], along[1] += s.unit_y[m] * s.pull_y[k - m];
        across[0] += s.arm_x[m] * s.pull_y[k - m], across[1] += s.arm_y[m] * s.pull_x[k - m];
      }
      for (int m = 1; m <= k + 1; ++m)  // sum over m = 1 .. k + 1 of x_m E_(k+2-m)
        out.arm_x += s.place[m] * s.unit_x[k + 2 - m], out.arm_y += s.place[m] * s.unit_y[k + 2 - m];
      force = along[0] + along[1], out.torque = across[1] - across[0];
      const double factor = (k + 1) * (k + 2);
      out.bend_x = factor * out.arm_x + s.place[0] * bend_x.of[i];
      out.bend_y = factor * out.arm_y + s.place[0] * bend_y.of[i];
    }
    out.balance = k == 0 ? s.known : -(slide_damping[w] * ((k + 1) * s.place[k + 1]) + slide_stiffness[w] * s.place[k]);
    out.balance -= force;
    return out;
  }

  // (x_w'')_k, by the row of slide w.
  PLANAR_CHAIN_INLINE double acceleration_of(int w, const Known* of, const Row& bend_x, const Row& bend_y,
                                             const Row& balance) const {
    double total = 0.0;
    for (int p = 0; p < parts; ++p)
      total +=
          sum(slide_inverse_[w](p) * balance(p) - (row_answer_x_[w](p) * bend_x(p) + row_answer_y_[w](p) * bend_y(p)));
    PLANAR_CHAIN_SLIDES(v) {
      total += between_inverse_[w][v] * of[v].balance -
               (between_answer_x_[w][v] * of[v].bend_x + between_answer_y_[w][v] * of[v].bend_y);
      if (rides_on[v] >= 0) total += slide_inverse_[w].of[rides_on[v]] * of[v].torque;
    }
    return total;
  }

  // With (x_w'')_k and E_(k+2): x_(k+2), Y_(k+2), and Y'' whole.
  PLANAR_CHAIN_INLINE void move(int w, int k, const double* reciprocal, Known& of) {
    SlideSeries& s = slide[w];
    s.place[k + 2] = s.acceleration[k] * reciprocal[k + 1] * reciprocal[k + 2];
    if (const int i = rides_on[w]; i >= 0) s.unit_x[k + 2] = unit_x[k + 2].of[i], s.unit_y[k + 2] = unit_y[k + 2].of[i];
    s.arm_x[k + 2] = of.arm_x + (s.place[0] * s.unit_x[k + 2] + s.place[k + 2] * s.unit_x[0]);
    s.arm_y[k + 2] = of.arm_y + (s.place[0] * s.unit_y[k + 2] + s.place[k + 2] * s.unit_y[0]);
    const double factor = (k + 1) * (k + 2);
    of.bend_x = factor * s.arm_x[k + 2], of.bend_y = factor * s.arm_y[k + 2];
  }

  // Gamma_w of order k; B_wa = conj(B_aw).
  PLANAR_CHAIN_INLINE void pull(int w, int k, const Known* of, const Row& bend_x, const Row& bend_y) {
    SlideSeries& s = slide[w];
    double x = k == 0 ? slide_weight_x[w] : 0.0, y = k == 0 ? slide_weight_y[w] : 0.0;
    for (int p = 0; p < parts; ++p) {
      x += sum(slide_coupling_x[w](p) * bend_x(p) + slide_coupling_y[w](p) * bend_y(p));
      y += sum(slide_coupling_x[w](p) * bend_y(p) - slide_coupling_y[w](p) * bend_x(p));
    }
    PLANAR_CHAIN_SLIDES(v) {
      x += between_x[w][v] * of[v].bend_x - between_y[w][v] * of[v].bend_y;
      y += between_x[w][v] * of[v].bend_y + between_y[w][v] * of[v].bend_x;
    }
    s.pull_x[k] = x, s.pull_y[k] = y;
  }

  // Of the step: the inverse of H, and that times the arms, columns of angles and of slides with the lanes of the
  // angles; rows of slides over the angles; and between slides.
  Row inverse_[Angles], answer_x_[Angles], answer_y_[Angles];
  Row slide_inverse_[most_slides], slide_answer_x_[most_slides], slide_answer_y_[most_slides];
  Row row_answer_x_[most_slides] = {}, row_answer_y_[most_slides] = {};
  Numbers between_inverse_[most_slides], between_answer_x_[most_slides], between_answer_y_[most_slides];
};

#undef PLANAR_CHAIN_SLIDES

}  // namespace planar_chain
