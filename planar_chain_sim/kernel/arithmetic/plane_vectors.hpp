// Vectors of the plane and symmetric 2x2 matrices. `perp` is the rotation by +90 degrees, multiplication by j. Written
// for one scene, Real = double, and for several in lanes, Real = Lanes<n>.
#pragma once

namespace planar_chain {

template <class Real>
struct VecOf {
  Real x = 0.0, y = 0.0;
};
template <class Real>
inline VecOf<Real> operator+(const VecOf<Real>& a, const VecOf<Real>& b) {
  return {a.x + b.x, a.y + b.y};
}
template <class Real>
inline VecOf<Real> operator-(const VecOf<Real>& a, const VecOf<Real>& b) {
  return {a.x - b.x, a.y - b.y};
}
template <class Scale, class Real>
inline VecOf<Real> operator*(const Scale& s, const VecOf<Real>& a) {
  return {s * a.x, s * a.y};
}
template <class Real>
inline Real dot(const VecOf<Real>& a, const VecOf<Real>& b) {
  return a.x * b.x + a.y * b.y;
}
template <class Real>
inline VecOf<Real> perp(const VecOf<Real>& a) {
  return {-a.y, a.x};
}
template <class Real>
inline VecOf<Real> rotate(const Real& x, const Real& y, const Real& cosine, const Real& sine) {
  return {x * cosine - y * sine, x * sine + y * cosine};
}

template <class Real>
struct SymOf {  // symmetric 2x2 matrix
  Real xx = 0.0, xy = 0.0, yy = 0.0;
};
template <class Real>
inline VecOf<Real> operator*(const SymOf<Real>& a, const VecOf<Real>& v) {
  return {a.xx * v.x + a.xy * v.y, a.xy * v.x + a.yy * v.y};
}
template <class Real>
inline void subtract_outer(SymOf<Real>& a, const VecOf<Real>& u, const VecOf<Real>& v) {  // a -= u v^T = v u^T
  a.xx -= u.x * v.x;
  a.xy -= u.x * v.y;
  a.yy -= u.y * v.y;
}

}  // namespace planar_chain
