// Python's view of a simulation.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstring>
#include <deque>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "../events/events.hpp"
#include "../integrators/integrator.hpp"
#include "../integrators/methods.hpp"
#include "../integrators/rollout.hpp"
#include "model.hpp"
#include "turn.hpp"

// Format of the result of save(); a checkpoint of another format is refused.
constexpr int checkpoint_format = 2;

// State, method and workspace of one simulation. Any thread may call at any time: while one computes without the
// interpreter, the others wait. Only interrupt() does not wait.
//
// A bad argument is refused by a ValueError, before anything is changed. The reason why a motion ends is a code, for
// which Python has a sentence.
class Stepper {
 public:
  Stepper(const py::object& model, const pc::MethodData& method, double step, bool dense)
      : scene_(std::make_unique<Scene>(model, method, checked(step, method), dense)),
        state_(model.cast<const Model&>().chain().joint_count), effort_(state_.position.size()),
        latched_(state_.position.size()), zero_(state_.position.size()), step_(step),
        joints_(static_cast<py::ssize_t>(effort_.size())), adaptive_(method.adaptive), lookout_(stop_wanted_) {
    scene_->integrator->set_lookout(&lookout_);
  }
  Stepper(const Stepper&) = delete;

  // Advances a whole number of ticks, under None or efforts (joints,) or (ticks, joints), into None or three arrays
  // (ticks, joints) for position, velocity and effort. Returns None, or (outcome, joint) if it stopped early or a
  // coarse step is to be reported. Throws what a signal handler has raised meanwhile, with the state at the last whole
  // tick.
  py::object advance(const py::handle& ticks_given, const py::handle& effort_given, const py::handle& record_given) {
    turn_.await();
    const std::int64_t ticks = whole("ticks", ticks_given, pc::most_ticks - tick_);
    std::optional<Numbers> effort;
    if (!effort_given.is_none()) effort.emplace(Numbers::row_or_rows("effort", effort_given, ticks, joints()));
    pc::Record record;
    if (!record_given.is_none()) record = record_in(record_given, ticks);
    return go_on(ticks, std::nullopt, efforts_of(effort), record);
  }

  // Advances to a tick, and then to `time`, s behind that tick, if it is not None.
  py::object advance_to(const py::handle& tick_given, const py::handle& time_given, const py::handle& effort_given) {
    turn_.await();
    const std::int64_t tick = whole("tick", tick_given, pc::most_ticks);
    std::optional<double> until;
    if (!behind(time_given, tick, until) || (until && !adaptive_))
      throw py::value_error("the kernel got a time that is not behind tick " + std::to_string(tick));
    if (tick < tick_ || (until ? *until < time() : tick == tick_ && between_))
      refuse("time is {!r} s, must not lie before the present {!r} s",
             until ? *until : static_cast<double>(tick) * step_, time());
    std::optional<Numbers> effort;
    if (!effort_given.is_none() && until) effort.emplace("effort", effort_given, std::initializer_list{joints()});
    else if (!effort_given.is_none())
      effort.emplace(Numbers::row_or_rows("effort", effort_given, tick - tick_, joints()));
    return go_on(tick - tick_, until, efforts_of(effort), {});
  }

  // Ends the call under way, or else the next one, at the last whole tick.
  void interrupt() { stop_wanted_.store(true, std::memory_order_relaxed); }

  // Fails if this thread is in a call already; waits if another thread is.
  void await() { turn_.await(); }

  // Returns, once, the first step that was found to be far off: (tick, error, rad or m, joint, whether it is the error
  // of all steps up to it); else None.
  py::object take_coarse_step() {
    turn_.await();
    const pc::CoarseStep& coarse = scene_->integrator->coarse;
    if (told_ || coarse.joint < 0) return py::none();
    told_ = true;
    return py::make_tuple(coarse.tick, coarse.error, coarse.joint, coarse.summed);
  }

  // -1; or, with nothing changed, the joint whose position lies beyond a stop. ValueError: a bad array.
  int put_state(const py::handle& position, const py::handle& velocity) {
    const Numbers q("position", position, {joints()}), v("velocity", velocity, {joints()});
    pc::JointState fresh(static_cast<int>(joints_));  // arrays may change while another call is waited for
    std::copy_n(q.data(), joints_, fresh.position.begin());
    std::copy_n(v.data(), joints_, fresh.velocity.begin());
    turn_.await();
    for (const auto& stop : scene_->forces.all<pc::StopOf>())
      if (fresh.position[stop.joint] < stop.lower || fresh.position[stop.joint] > stop.upper) return stop.joint;
    scene_->integrator->forget();
    std::swap(state_, fresh);
    return -1;
  }

  // Tick, s of the time between two ticks or None, and arrays: position, velocity, their remainders, effort, and what
  // the integrator keeps, between the number of the format and a sum of the bits before.
  py::tuple save() {
    turn_.await();
    std::vector<double> kept = {checkpoint_format};
    scene_->integrator->save(kept);
    kept.push_back(sum_of_bits(kept.data(), kept.size()));
    const std::int64_t tick = tick_;  // a tuple may set off the garbage collector, and that another thread
    return py::make_tuple(
        tick, between_ ? py::object(py::float_(*between_)) : py::none(),
        py::make_tuple(make_array(state_.position), make_array(state_.velocity), make_array(state_.position_remainder),
                       make_array(state_.velocity_remainder), make_array(effort_), make_array(kept)));
  }

  // Restores the result of save(); `anew`: that of a stepper with another method, so the method starts afresh here.
  void load(const py::handle& tick_given, const py::handle& between_given, const py::handle& parts, bool anew) {
    turn_.await();
    const std::int64_t tick = whole("tick of the checkpoint", tick_given, pc::most_ticks);
    std::optional<double> between;
    if (!behind(between_given, tick, between) || (between && !adaptive_)) damaged("time");
    if (!PyTuple_CheckExact(parts.ptr()) || PyTuple_GET_SIZE(parts.ptr()) != 6) damaged("state");
    pc::JointState state(static_cast<int>(effort_.size()));
    std::vector<double> effort(effort_);
    std::vector<double>* const into[] = {&state.position, &state.velocity, &state.position_remainder,
                                         &state.velocity_remainder, &effort};
    const char* const words[] = {"position", "velocity", "position remainder", "velocity remainder", "effort"};
    for (py::ssize_t i = 0; i < 5; ++i) {
      const py::handle part(PyTuple_GET_ITEM(parts.ptr(), i));
      if (!is_joint_array(part)) damaged(words[i]);
      std::copy_n(py::reinterpret_borrow<Array>(part).data(), effort_.size(), into[i]->begin());
    }
    // The remainder of a rounded sum is too small to change it.
    for (std::size_t i = 0; i < effort_.size(); ++i) {
      if (state.position[i] + state.position_remainder[i] != state.position[i]) damaged(words[2]);
      if (state.velocity[i] + state.velocity_remainder[i] != state.velocity[i]) damaged(words[3]);
    }
    if (anew) {
      scene_->integrator->forget();
    } else if (!load_steps(py::handle(PyTuple_GET_ITEM(parts.ptr(), 5)), tick, between, state)) {
      damaged("steps");
    }
    state_ = state, effort_ = effort, tick_ = tick, between_ = between;
  }

  // Replaces the wrench on a body; one of zeros removes it, and an equal one changes nothing. `axes`: 'body' or 'world'.
  // ValueError: a bad argument.
  void set_wrench(const py::handle& body, const py::handle& force_given, const py::handle& moment_given,
                  const py::handle& axes) {
    const bool turns = is_text(axes, "body");
    if (!turns && !is_text(axes, "world")) refuse("axes is {!r:.80}, must be 'body' or 'world'", axes);
    const Numbers force("force", force_given, {2});
    const double x = force.data()[0], y = force.data()[1];
    double moment = PyFloat_CheckExact(moment_given.ptr()) ? PyFloat_AS_DOUBLE(moment_given.ptr()) : NAN;
    if (!std::isfinite(moment)) moment = one_number("moment", moment_given);
    const py::object name = plain_text(body);
    turn_.await();
    const Model& model = scene_->model.cast<const Model&>();
    const Load load{model.body(name), turns, x, y, moment};
    const pc::Wrench on_link = pc::on_link(model.place_of(load.body), turns, x, y, moment);
    if (!std::isfinite(on_link.force_x) || !std::isfinite(on_link.force_y) || !std::isfinite(on_link.moment))
      refuse("force is {!r}, moment {!r}, must be smaller: about the link's joint point they are not finite",
             force_given, moment);
    std::vector<Load>& loads = scene_->loads;
    const auto old = std::find_if(loads.begin(), loads.end(), [&](const Load& each) { return each.body == load.body; });
    if (old != loads.end() ? load == *old : !load.acts()) return;
    if (old != loads.end()) loads.erase(old);
    if (load.acts()) loads.push_back(load);
    scene_->put_wrenches();
  }

  void clear_wrenches() {
    turn_.await();
    if (scene_->loads.empty()) return;
    scene_->loads.clear();
    scene_->put_wrenches();
  }

  // (body, (force as a complex number, moment, axes)) of the wrenches that act, the newest last.
  py::list wrenches() const {
    const py::object kept = scene_->model;  // making Python objects may let another thread call, see take()
    const std::vector<Load> loads = scene_->loads;
    py::list list;
    for (const Load& load : loads) {
      const py::tuple wrench =
          py::make_tuple(Complex(load.force_x, load.force_y), load.moment, load.turns ? "body" : "world");
      list.append(py::make_tuple(kept.cast<const Model&>().name_of(load.body), wrench));
    }
    return list;
  }

  // Joint efforts that do the work of the wrenches in this state.
  Array wrench_effort() {
    turn_.await();
    std::vector<double> effort(effort_.size());
    scene_->right_hand_side.wrench_efforts(state_, effort.data());
    return make_array(effort);
  }

  // Takes over the chain, the wrenches and the method of `fresh`, which nobody else uses; its chain has the same
  // joints. `with_state`: its time and state too. Returns counts and events up to here.
  py::tuple adopt(Stepper& fresh, bool with_state) {
    turn_.await();
    if (fresh.turn_.busy()) throw py::value_error("the kernel got a stepper that is at work");
    if (&fresh == this || fresh.effort_.size() != effort_.size())
      throw py::value_error("the kernel got a chain with other joints");
    const pc::Counts counted = scene_->integrator->counts;
    const std::deque<pc::JointEvent> events = take();
    std::swap(scene_, fresh.scene_);
    scene_->integrator->set_lookout(&lookout_), fresh.scene_->integrator->set_lookout(&fresh.lookout_);
    step_ = fresh.step_, adaptive_ = fresh.adaptive_;
    if (with_state) {
      state_ = fresh.state_, effort_ = fresh.effort_, tick_ = fresh.tick_, between_ = fresh.between_;
    } else {
      const pc::EventDriven* const former = fresh.scene_->integrator->event_driven();
      pc::EventDriven* const driven = scene_->integrator->event_driven();
      if (driven != nullptr && former != nullptr) driven->adopt(*former);
    }
    return py::make_tuple(tuple_of(counted), list_of(events));
  }

  std::int64_t tick() { return turn_.await(), tick_; }
  double now() { return turn_.await(), time(); }
  Array position() { return turn_.await(), make_array(state_.position); }
  Array velocity() { return turn_.await(), make_array(state_.velocity); }
  Array effort() { return turn_.await(), make_array(effort_); }
  bool told() const { return told_; }
  void set_told(bool told) { told_ = told; }
  py::tuple counts() {
    turn_.await();
    return tuple_of(scene_->integrator->counts);
  }

  // Accelerations under the last efforts, zero for standing joints; -1, or the joint whose pivot vanished.
  py::tuple acceleration() {
    turn_.await();
    Array out(static_cast<py::ssize_t>(effort_.size()));
    int joint;
    if (pc::EventDriven* const driven = scene_->integrator->event_driven()) {
      joint = driven->accelerate(state_, effort_.data(), out.mutable_data());
    } else {
      std::vector<double> position = state_.position;
      pc::RightHandSide& right_hand_side = scene_->right_hand_side;
      right_hand_side.start(position.data());
      joint = right_hand_side.accelerate(*scene_->form, state_.position.data(), state_.position_remainder.data(),
                                         position.data(), state_.velocity.data(), effort_.data(), out.mutable_data());
    }
    return py::make_tuple(out, joint);
  }

  // (tick, s behind it, kind, joint, speed) of each event since the last call, the newest few thousand.
  py::list take_events() {
    turn_.await();
    return list_of(take());
  }

 private:
  // A wrench on a body, as it was given.
  struct Load {
    std::size_t body;
    bool turns;
    double force_x, force_y, moment;

    bool acts() const { return force_x != 0.0 || force_y != 0.0 || moment != 0.0; }
    bool operator==(const Load& other) const {
      return turns == other.turns && force_x == other.force_x && force_y == other.force_y && moment == other.moment;
    }
  };

  static bool is_text(const py::handle& given, const char* text) {
    return PyUnicode_Check(given.ptr()) && PyUnicode_CompareWithASCIIString(given.ptr(), text) == 0;
  }

  static double one_number(const char* name, const py::handle& given) {
    py::list list;
    list.append(given);
    return Numbers(name, list, {1}).data()[0];
  }

  // Below this, some microseconds, releasing the interpreter would cost more than it gains.
  static constexpr std::int64_t few_joint_ticks = 32;

  // The parts that a changed chain replaces; they point at each other.
  struct Scene {
    py::object model;
    pc::JointForces forces;   // the model's, and wrenches
    std::vector<Load> loads;  // those wrenches, the newest last
    pc::RightHandSide right_hand_side;
    std::unique_ptr<pc::Form> form;
    std::unique_ptr<pc::Integrator> integrator;

    Scene(const py::object& made, const pc::MethodData& method, double step, bool dense)
        : model(made), forces(made.cast<const Model&>().forces), right_hand_side(chain(), forces),
          form(pc::make_form<double>(chain(), dense)) {
      forces.chain = &chain();
      integrator = pc::make_integrator(method, chain(), *form, forces, step, dense);
    }
    const pc::Chain& chain() const { return model.cast<const Model&>().chain(); }

    // One on a body that is welded to the base moves nothing.
    void put_wrenches() {
      const Model& made = model.cast<const Model&>();
      forces.wrenches.clear();
      for (const Load& load : loads)
        if (made.place_of(load.body).link > 0)
          forces.wrenches.push_back(
              pc::on_link(made.place_of(load.body), load.turns, load.force_x, load.force_y, load.moment));
      integrator->forces_changed();
    }
  };

  static py::tuple tuple_of(const pc::Counts& counts) {
    return py::make_tuple(counts.evaluations, counts.steps, counts.rejected_steps, counts.events);
  }

  // Takes the events out first: making Python objects may start the garbage collector, which may let another thread
  // call.
  std::deque<pc::JointEvent> take() {
    std::deque<pc::JointEvent> events;
    if (pc::EventDriven* const driven = scene_->integrator->event_driven()) std::swap(events, driven->events);
    return events;
  }
  static py::list list_of(const std::deque<pc::JointEvent>& events) {
    py::list list;
    for (const pc::JointEvent& event : events)
      list.append(py::make_tuple(event.tick, event.offset, static_cast<int>(event.kind), event.joint, event.speed));
    return list;
  }

  static double checked(double step, const pc::MethodData& method) {
    if (const char* word = pc::misfit(method))
      throw py::value_error(std::string("the kernel got a method with a bad ") + word);
    if (!std::isfinite(step) || !(step > 0.0)) throw py::value_error("the kernel got a bad step");
    return step;
  }

  template <class... Values>
  [[noreturn]] static void refuse(const char* sentence, const Values&... values) {
    throw py::value_error(py::cast<std::string>(py::str(sentence).format(values...)));
  }
  [[noreturn]] static void damaged(const char* part) {
    throw py::value_error(std::string("checkpoint is damaged: its ") + part + " cannot be what was saved");
  }

  // A whole number from 0 to `most`.
  static std::int64_t whole(const char* name, const py::handle& given, std::int64_t most) {
    int overflow = 0;
    std::int64_t number = -1;
    if (PyLong_CheckExact(given.ptr())) {
      number = PyLong_AsLongLongAndOverflow(given.ptr(), &overflow);
    } else if (PyIndex_Check(given.ptr()) && !PyBool_Check(given.ptr())) {  // as NumPy's
      const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(given.ptr()));
      if (index) number = PyLong_AsLongLongAndOverflow(index.ptr(), &overflow);
      else PyErr_Clear();
    }
    if (overflow > 0 || number > most)
      refuse("{} is {!r}, must be at most {}: no more can be counted", name, given, most);
    if (number < 0) refuse("{} is {!r:.80}, must be a whole number >= 0", name, given);
    return number;
  }

  // None, or a float between a tick and the next.
  bool behind(const py::handle& given, std::int64_t tick, std::optional<double>& time) const {
    if (given.is_none()) return true;
    if (!PyFloat_CheckExact(given.ptr())) return false;
    time = PyFloat_AS_DOUBLE(given.ptr());
    return std::isfinite(*time) && *time >= static_cast<double>(tick) * step_ &&
           *time <= static_cast<double>(tick + 1) * step_;
  }

  static bool finite(const Array& array) {
    const double* numbers = array.data();
    for (py::ssize_t i = 0; i < array.size(); ++i)
      if (!std::isfinite(numbers[i])) return false;
    return true;
  }

  bool is_joint_array(const py::handle& given) const {
    if (!py::isinstance<Array>(given)) return false;
    const Array array = py::reinterpret_borrow<Array>(given);
    return array.ndim() == 1 && array.size() == joints() && aligned(array) && finite(array);
  }

  pc::Efforts efforts_of(const std::optional<Numbers>& given) const {
    if (!given) return {zero_.data(), 0};
    return {given->data(), given->dimensions() == 2 ? effort_.size() : 0};
  }

  pc::Record record_in(const py::handle& given, std::int64_t ticks) const {
    const bool three =
        (PyTuple_CheckExact(given.ptr()) || PyList_CheckExact(given.ptr())) && PySequence_Size(given.ptr()) == 3;
    pc::Record record;
    double** const fields[] = {&record.position, &record.velocity, &record.effort};
    for (py::ssize_t i = 0; i < 3; ++i) {
      const py::handle part(three ? PySequence_Fast_GET_ITEM(given.ptr(), i) : nullptr);
      if (!three || !py::isinstance<py::array>(part))
        refuse("record is {!r:.80}, must be three arrays, for position, velocity and effort", given);
      py::array rows = py::reinterpret_borrow<py::array>(part);
      if (!py::isinstance<Array>(part) || rows.ndim() != 2 || rows.shape(0) != ticks || rows.shape(1) != joints() ||
          !rows.writeable() || !aligned(rows))
        refuse("record has an array of {} and shape {}, must be C-ordered writeable float64 of shape ({}, {})",
               rows.dtype(), rows.attr("shape"), ticks, joints());
      *fields[i] = static_cast<double*>(rows.mutable_data());
    }
    return record;
  }

  py::object go_on(std::int64_t ticks, const std::optional<double>& until, const pc::Efforts& efforts,
                   const pc::Record& record) {
    pc::Integrator& integrator = *scene_->integrator;
    pc::Progress progress;
    LongCall call(&turn_);
    lookout_.begin([&call] { return call.ask(); });
    if (until || ticks >= few_joint_ticks || ticks * joints() >= few_joint_ticks) call.let_go();
    if (ticks > 0)
      progress =
          pc::roll(integrator, scene_->forces, state_, step_, time(), tick_, ticks, efforts, record, effort_, latched_);
    const bool there = progress.outcome == pc::Outcome::good;
    if (progress.ticks > 0) tick_ += progress.ticks, between_.reset();
    if (there && until) {
      std::copy_n(efforts.data, effort_.size(), latched_.begin());
      scene_->forces.clamp(latched_.data());
      integrator.advance_to(time(), tick_, *until, state_, latched_.data(), progress);
      if (progress.outcome == pc::Outcome::good) effort_ = latched_, between_ = until;
    }
    call.take_back();
    if (progress.outcome == pc::Outcome::interrupted) {
      call.raise();
      stop_wanted_.store(false, std::memory_order_relaxed);
    }
    if (progress.outcome == pc::Outcome::good && (told_ || integrator.coarse.joint < 0)) return py::none();
    return py::make_tuple(static_cast<int>(progress.outcome), progress.joint);
  }

  bool load_steps(const py::handle& given, std::int64_t tick, const std::optional<double>& between,
                  const pc::JointState& state) {
    if (!py::isinstance<Array>(given)) return false;
    const Array kept = py::reinterpret_borrow<Array>(given);
    const py::ssize_t count = kept.size() - 1;
    if (kept.ndim() != 1 || count < 1 || !aligned(kept) || kept.data()[0] != checkpoint_format ||
        kept.data()[count] != sum_of_bits(kept.data(), static_cast<std::size_t>(count)))
      return false;
    std::vector<double> before;
    pc::Integrator& integrator = *scene_->integrator;
    integrator.save(before);
    pc::KeptNumbers numbers(kept.data() + 1, kept.data() + count);
    if (integrator.load(numbers, tick, between ? *between : static_cast<double>(tick) * step_, &state)) return true;
    pc::KeptNumbers former(before.data(), before.data() + before.size());
    if (!integrator.load(former, tick_, time(), &state_)) integrator.forget();
    return false;
  }

  // A whole number below 2^52 (FNV-1a, by 64 bits).
  static double sum_of_bits(const double* numbers, std::size_t count) {
    std::uint64_t sum = 0xcbf29ce484222325u;
    for (std::size_t i = 0; i < count; ++i) {
      std::uint64_t bits;
      std::memcpy(&bits, numbers + i, sizeof bits);
      sum = (sum ^ bits) * 0x100000001b3u;
      sum ^= sum >> 29;
    }
    return static_cast<double>(sum >> 12);
  }

  py::ssize_t joints() const { return joints_; }
  double time() const { return between_ ? *between_ : static_cast<double>(tick_) * step_; }

  std::unique_ptr<Scene> scene_;
  pc::JointState state_;
  std::int64_t tick_ = 0;
  std::optional<double> between_;  // s, the time where that is behind the tick
  std::vector<double> effort_, latched_, zero_;
  double step_;
  const py::ssize_t joints_;      // also read by callers that do not wait
  bool adaptive_, told_ = false;  // told_: whether a coarse step was reported
  std::atomic<bool> stop_wanted_{false};
  pc::Lookout lookout_;
  Turn turn_;
};
