// The border between Python and the kernel: numbers in, arrays and status codes out. Numbers are checked once:
// python/arrays.hpp does it where calls are short; of batches and messages the caller has done it. Long calls hold no
// GIL.
#include <complex>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "arithmetic/trigonometry.hpp"
#include "messages/command.hpp"
#include "messages/log_chunk.hpp"
#include "python/batch.hpp"
#include "python/model.hpp"
#include "python/stepper.hpp"

namespace {

// The names of an enum that counts from 0 to `last`.
template <class Enum>
py::tuple names_to(Enum last) {
  py::list names;
  for (int code = 0; code <= static_cast<int>(last); ++code) names.append(name_of(static_cast<Enum>(code)));
  return py::tuple(names);
}

}  // namespace

PYBIND11_MODULE(_kernel, module) {
  module.doc() = "Compiled twin of equations_of_motion.py and joint_forces.py; batches are checked by the caller.";
  module.def("unit_vector", [](double angle) {
    double sine, cosine;
    pc::sine_cosine(angle, sine, cosine);
    return std::complex<double>(cosine, sine);
  });
#ifdef __VERSION__
  module.attr("compiler") = __VERSION__;
#else
  module.attr("compiler") = "unknown compiler";
#endif

  // `values` as finite C-ordered float64 of this shape; ValueError names argument, got and wanted.
  module.def("finite_array",
             [](const std::string& name, const py::handle& values, const std::vector<py::ssize_t>& shape) {
               return Numbers(name.c_str(), values, shape.data(), static_cast<int>(shape.size())).array();
             });

  // The same of any shape that ends in `last`.
  module.def("finite_rows", [](const std::string& name, const py::handle& values, py::ssize_t last) {
    return Numbers::rows(name.c_str(), values, last).array();
  });

  // Two finite numbers [x, y] as x + j y.
  module.def("plane_vector", [](const std::string& name, const py::handle& values) {
    const Numbers given(name.c_str(), values, {2});
    return std::complex<double>(given.data()[0], given.data()[1]);
  });

  py::class_<Model>(module, "Model")
      .def(py::init<const Ints&, const Array&, std::tuple<double, double>, int>())
      .def("add_law", &Model::add_law)
      .def("place_bodies", &Model::place_bodies)
      .def("forward_dynamics", &Model::forward_dynamics, py::arg("position"), py::arg("velocity"), py::arg("effort"),
           py::arg("dense") = false)
      .def("evaluate_repeatedly", &Model::evaluate_repeatedly, py::arg("position"), py::arg("velocity"),
           py::arg("effort"), py::arg("count"), py::arg("dense") = false)
      .def("repeat", &Model::repeat)
      .def("largest_rate", &Model::largest_rate)
      .def_property_readonly("refined", [](const Model& m) { return m.chain().refined; })
      .def("inverse_dynamics", &Model::inverse_dynamics)
      .def("mass_matrix", &Model::mass_matrix)
      .def("derivatives", &Model::derivatives)
      .def("energy", py::overload_cast<const py::handle&, const py::handle&>(&Model::energy))
      .def("linearize", py::overload_cast<const py::handle&, const py::handle&, const py::handle&>(&Model::linearize));

  py::class_<StateBatch>(module, "StateBatch")
      .def(py::init<const Model&, const Array&, const Array&, const Array&, bool>(), py::keep_alive<1, 2>())
      .def("evaluate", &StateBatch::evaluate)
      .def("accelerations", &StateBatch::accelerations);

  py::class_<pc::Tableau>(module, "Tableau")
      .def(py::init(
          [](int stages, std::vector<double> a, std::vector<double> b, std::vector<double> error,
             std::vector<double> interpolation_a, std::vector<double> interpolation, std::vector<double> c,
             double gamma) { return pc::Tableau{stages, a, b, error, interpolation_a, interpolation, c, gamma}; }));

  py::class_<pc::MethodData>(module, "MethodData")
      .def(py::init([](std::string family, int order, bool adaptive, double tolerance, double fixed,
                       const pc::Tableau& tableau) {
             const auto known = pc::family_of(family);
             if (!known) throw py::value_error("family '" + family + "' is none of FAMILIES");
             return pc::MethodData{*known, order, adaptive, tableau, tolerance, fixed};
           }),
           py::arg("family"), py::arg("order"), py::arg("adaptive"), py::arg("tolerance"), py::arg("fixed") = 0.0,
           py::arg("tableau") = pc::Tableau());

  py::class_<Stepper>(module, "Stepper")
      .def(py::init([](const py::object& model, const pc::MethodData& method, double step, bool dense) {
        if (!py::isinstance<Model>(model)) throw py::type_error("the kernel got no Model");
        return std::make_unique<Stepper>(model, method, step, dense);
      }))
      .def("advance", &Stepper::advance)
      .def("advance_to", &Stepper::advance_to)
      .def("interrupt", &Stepper::interrupt)
      .def("wait", &Stepper::await)
      .def("put_state", &Stepper::put_state)
      .def("set_wrench", &Stepper::set_wrench)
      .def("clear_wrenches", &Stepper::clear_wrenches)
      .def("wrenches", &Stepper::wrenches)
      .def("wrench_effort", &Stepper::wrench_effort)
      .def("adopt", &Stepper::adopt)
      .def("take_coarse_step", &Stepper::take_coarse_step)
      .def("save", &Stepper::save)
      .def("load", &Stepper::load)
      .def_property_readonly("tick", &Stepper::tick)
      .def_property_readonly("time", &Stepper::now)
      .def_property_readonly("position", &Stepper::position)
      .def_property_readonly("velocity", &Stepper::velocity)
      .def_property_readonly("effort", &Stepper::effort)
      .def_property_readonly("counts", &Stepper::counts)
      .def_property("told", &Stepper::told, &Stepper::set_told)
      .def("acceleration", &Stepper::acceleration)
      .def("take_events", &Stepper::take_events);

  py::class_<LogChunk>(module, "LogChunk")
      .def(py::init<>())
      .def("add_record", &LogChunk::add_record)
      .def("add_message", &LogChunk::add_message)
      .def("take", &LogChunk::take)
      .def_property_readonly("size", &LogChunk::size)
      .def_readonly("messages", &LogChunk::messages);

  // Names in the order of their enums, which the kernel's codes count.
  module.attr("FAMILIES") = names_to(pc::Family::taylor);
  module.attr("OUTCOMES") = names_to(pc::Outcome::interrupted);
  module.attr("EVENT_KINDS") = names_to(pc::EventKind::slipped);
  module.attr("REFUSALS") = names_to(Model::Refusal::standing);

  // Limits that the caller has to know.
  module.attr("UNROLLED_SERIES") = pc::most_unrolled_series;
  module.attr("DENSE_LINKS") = pc::most_dense_links;
  module.attr("MOST_TICKS") = pc::most_ticks;
  module.attr("CHECKPOINT_FORMAT") = checkpoint_format;

  module.def("roll_batch", &roll_batch);
  module.def("json_list", &json_list);
  module.def("plain_command", &plain_command);
  module.def("vector_widths", &pc::vector_widths);
}
