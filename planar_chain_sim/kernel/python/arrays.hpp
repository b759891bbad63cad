// Numbers from Python: the only place where they are checked and where the sentence about a wrong one is made.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace py = pybind11;

using Array = py::array_t<double, py::array::c_style>;
using Ints = py::array_t<int, py::array::c_style>;

// The type of NumPy's doubles, of which there is one.
inline PyObject* type_of_doubles() {
  static PyObject* const type = py::dtype::of<double>().release().ptr();
  return type;
}

// `size` numbers not yet set, made in half of the time of pybind11's own constructor.
inline Array new_array(py::ssize_t size) {
  static const py::detail::npy_api& api = py::detail::npy_api::get();
  const Py_intptr_t shape[] = {size};
  Py_INCREF(type_of_doubles());  // for the array to keep
  PyObject* const made =
      api.PyArray_NewFromDescr_(api.PyArray_Type_, type_of_doubles(), 1, shape, nullptr, nullptr, 0, nullptr);
  if (made == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<Array>(made);
}

inline Array make_array(const std::vector<double>& values) {
  Array made = new_array(static_cast<py::ssize_t>(values.size()));
  std::copy(values.begin(), values.end(), made.mutable_data());
  return made;
}

// Whether the numbers are aligned.
inline bool aligned(const py::array& array) { return (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0; }

// Finite numbers, C-ordered: the caller's own where they are that already, else as NumPy converts them. Strings, bytes,
// dates, structured, masked and complex arrays are no numbers. ValueError names the argument, what it is and what it
// must be.
class Numbers {
 public:
  // The required shape. `leading`: any axes may stand before it, and the sentence says so.
  Numbers(const char* name, const py::handle& given, std::initializer_list<py::ssize_t> shape, bool leading = false)
      : Numbers(name, given, shape.begin(), static_cast<int>(shape.size()), leading) {}

  Numbers(const char* name, const py::handle& given, const py::ssize_t* shape, int dimensions, bool leading = false)
      : array_(given) {
    if (!(is_plain(given) && has_shape(shape, dimensions)) && !(dimensions == 1 && take_list(given, shape[0])))
      convert_to(name, given, shape, dimensions, leading);
    look_through(name);
  }

  // Any axes, then one of `last` numbers.
  static Numbers rows(const char* name, const py::handle& given, py::ssize_t last) {
    Numbers made(given);
    const std::string wanted = text_of(&last, 1, true);
    if (!is_plain(given)) made.convert(name, given, wanted);
    const auto* array = py::detail::array_proxy(made.array_.ptr());
    if (array->nd < 1 || array->dimensions[array->nd - 1] != last) made.misfit(name, wanted);
    made.look_through(name);
    return made;
  }

  // (second,) numbers for all ticks, or (first, second), a row for each tick.
  static Numbers row_or_rows(const char* name, const py::handle& given, py::ssize_t first, py::ssize_t second) {
    const py::ssize_t shape[] = {first, second};
    const int skipped = is_row(given) ? 1 : 0;
    return {name, given, shape + skipped, 2 - skipped};
  }

  Numbers(const Numbers&) = delete;
  Numbers(Numbers&&) = default;

  const double* data() const { return data_; }
  int dimensions() const { return py::detail::array_proxy(array_.ptr())->nd; }
  py::object array() const { return py::reinterpret_borrow<py::object>(array_); }

 private:
  explicit Numbers(const py::handle& given) : array_(given) {}

  // A NumPy array of doubles as the processor has them, in C order: no subclass, no other byte order.
  static bool is_plain(const py::handle& given) {
    static const py::detail::npy_api& api = py::detail::npy_api::get();
    constexpr int wanted = py::detail::npy_api::NPY_ARRAY_C_CONTIGUOUS_ | py::detail::npy_api::NPY_ARRAY_ALIGNED_;
    if (Py_TYPE(given.ptr()) != api.PyArray_Type_) return false;
    const auto* array = py::detail::array_proxy(given.ptr());
    return array->descr == type_of_doubles() && (array->flags & wanted) == wanted;
  }

  // Whether it has one axis, before it is converted.
  static bool is_row(const py::handle& given) {
    if (py::isinstance<py::array>(given)) return py::detail::array_proxy(given.ptr())->nd == 1;
    if (!PyList_Check(given.ptr()) && !PyTuple_Check(given.ptr()))
      return py::hasattr(given, "ndim") && py::int_(1).equal(given.attr("ndim"));
    return PySequence_Size(given.ptr()) == 0 || PySequence_Check(PySequence_Fast_GET_ITEM(given.ptr(), 0)) == 0;
  }

  bool has_shape(const py::ssize_t* shape, int dimensions) const {
    const auto* array = py::detail::array_proxy(array_.ptr());
    return array->nd == dimensions && std::equal(shape, shape + dimensions, array->dimensions);
  }

  py::ssize_t count() const {
    const auto* array = py::detail::array_proxy(array_.ptr());
    py::ssize_t size = 1;
    for (int k = 0; k < array->nd; ++k) size *= array->dimensions[k];
    return size;
  }

  // A list or a tuple of so many Python floats and ints, for which NumPy would take a microsecond.
  bool take_list(const py::handle& given, py::ssize_t size) {
    const bool list = PyList_CheckExact(given.ptr());
    if (!list && !PyTuple_CheckExact(given.ptr())) return false;
    if ((list ? PyList_GET_SIZE(given.ptr()) : PyTuple_GET_SIZE(given.ptr())) != size) return false;
    Array made = new_array(size);
    double* const numbers = made.mutable_data();
    for (py::ssize_t i = 0; i < size; ++i) {
      PyObject* const item = list ? PyList_GET_ITEM(given.ptr(), i) : PyTuple_GET_ITEM(given.ptr(), i);
      if (PyFloat_CheckExact(item)) {
        numbers[i] = PyFloat_AS_DOUBLE(item);
      } else {
        if (!PyLong_CheckExact(item)) return false;
        numbers[i] = PyLong_AsDouble(item);
        if (PyErr_Occurred() == nullptr) continue;
        PyErr_Clear();  // too large: NumPy's to say
        return false;
      }
    }
    made_ = std::move(made), array_ = made_;
    return true;
  }

  // Whether NumPy makes real numbers of it, or objects that may be real numbers.
  static bool is_numeric(const py::handle& array) {
    return std::string("biufO").find(text(array.attr("dtype").attr("kind"))) != std::string::npos;
  }

  // Whether an object is not meant as a number, although float() may accept it.
  static bool is_no_number(const py::handle& each) {
    return each.is_none() || PyUnicode_Check(each.ptr()) || PyBytes_Check(each.ptr()) || PyComplex_Check(each.ptr()) ||
           (py::hasattr(each, "dtype") && !is_numeric(each));
  }

  // As NumPy converts it, if that gives numbers.
  __attribute__((noinline)) void convert(const char* name, const py::handle& given, const std::string& wanted) {
    const auto refuse = [&] {
      const py::object one_line = py::str(" ").attr("join")(py::repr(given).attr("split")());
      throw py::value_error(std::string(name) + " must be numbers of shape " + wanted + ", got " +
                            text(py::str("{:.80}").format(one_line)));
    };
    const py::module_ numpy = py::module_::import("numpy");
    try {
      if (PyByteArray_Check(given.ptr()) || py::isinstance(given, numpy.attr("ma").attr("MaskedArray"))) refuse();
      const py::object array = numpy.attr("asarray")(given);
      if (!is_numeric(array)) refuse();
      if (text(array.attr("dtype").attr("kind")) == "O")
        for (const py::handle each : array.attr("flat"))
          if (is_no_number(each)) refuse();
      made_ = numpy.attr("ascontiguousarray")(array, py::dtype::of<double>());
    } catch (py::error_already_set& error) {
      if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError) && !error.matches(PyExc_OverflowError))
        throw;
      refuse();
    }
    if (!aligned(py::reinterpret_borrow<py::array>(made_))) made_ = made_.attr("copy")();
    array_ = made_;
  }

  __attribute__((noinline)) void convert_to(const char* name, const py::handle& given, const py::ssize_t* shape,
                                            int dimensions, bool leading) {
    const std::string wanted = text_of(shape, dimensions, leading);
    convert(name, given, wanted);
    if (!has_shape(shape, dimensions)) misfit(name, wanted);
  }

  [[noreturn]] __attribute__((noinline)) void misfit(const char* name, const std::string& wanted) const {
    throw py::value_error(std::string(name) + " has shape " + text(array_.attr("shape")) + ", must have " + wanted);
  }

  void look_through(const char* name) {
    data_ = reinterpret_cast<const double*>(py::detail::array_proxy(array_.ptr())->data);
    const py::ssize_t size = count();
    for (py::ssize_t i = 0; i < size; ++i)
      if (!std::isfinite(data_[i])) refuse(name, i);
  }

  // The number at `place`, counted in C order, is not finite.
  [[noreturn]] __attribute__((noinline)) void refuse(const char* name, py::ssize_t place) const {
    const auto* array = py::detail::array_proxy(array_.ptr());
    const double value = data_[place];
    std::string where;
    for (int k = array->nd - 1; k >= 0; place /= array->dimensions[k--])
      where = std::to_string(place % array->dimensions[k]) + (where.empty() ? "" : ", ") + where;
    const char* const what = std::isnan(value) ? "nan" : value > 0.0 ? "inf" : "-inf";
    throw py::value_error(std::string(name) + "[" + where + "] is " + what + ", must be finite");
  }

  static std::string text(const py::handle& object) { return py::cast<std::string>(py::str(object)); }

  // As Python writes a tuple: (2,), (..., 2), (3, 2).
  static std::string text_of(const py::ssize_t* shape, int dimensions, bool leading) {
    std::string written = leading ? "(..." : "(";
    for (int k = 0; k < dimensions; ++k) written += (k > 0 || leading ? ", " : "") + std::to_string(shape[k]);
    return written + (dimensions == 1 && !leading ? ",)" : ")");
  }

  py::handle array_;
  py::object made_;
  const double* data_;
};
