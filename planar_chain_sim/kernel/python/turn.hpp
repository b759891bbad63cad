// Controls which threads may enter an object of the kernel while one thread computes in it without the interpreter's
// lock.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace py = pybind11;

// One lock for each object. Only a thread that has released the interpreter holds it. All others hold the interpreter,
// so they need only read a flag. They wait in the order in which they came, without the interpreter.
class Turn {
 public:
  // Returns when nobody computes in the object. Throws what a signal handler raises meanwhile, and an error if this
  // thread itself computes in it: then one of its signal handlers has called.
  void await() {
    if (taken_) wait();
  }

  bool busy() const { return busy_; }
  bool mine() const { return busy_ && owner_ == std::this_thread::get_id(); }

 private:
  friend class LongCall;

  void take() { busy_ = taken_ = true, owner_ = std::this_thread::get_id(); }

  void leave() {
    busy_ = false, owner_ = {};
    taken_ = !waiting_.empty();
    if (taken_) wake();
  }

  void wake() {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
    }
    left_.notify_all();
  }

  void wait() {
    if (mine())
      throw std::runtime_error(
          "the simulation is in the middle of a call of this thread: ask it again when that has returned");
    const std::uint64_t number = next_++;
    waiting_.push_back(number);
    while (busy_ || waiting_.front() != number) {
      {
        py::gil_scoped_release release;
        std::unique_lock<std::mutex> lock(mutex_);
        left_.wait_for(lock, std::chrono::milliseconds(20));
      }
      remove(number);  // a signal handler may have to wait here too
      const bool raised = PyErr_CheckSignals() != 0;
      if (!raised) put_back(number);
      if (!raised) continue;
      taken_ = busy_ || !waiting_.empty();
      throw py::error_already_set();
    }
    waiting_.pop_front();
    taken_ = !waiting_.empty();
    if (taken_) wake();
  }

  void remove(std::uint64_t number) {
    for (auto at = waiting_.begin(); at != waiting_.end(); ++at)
      if (*at == number) {
        waiting_.erase(at);
        return;
      }
  }

  void put_back(std::uint64_t number) {
    auto at = waiting_.begin();
    while (at != waiting_.end() && *at < number) ++at;
    waiting_.insert(at, number);
    taken_ = true;
  }

  // All under the interpreter's lock.
  bool taken_ = false, busy_ = false;  // computed in, or waited for; computed in
  std::thread::id owner_;
  std::deque<std::uint64_t> waiting_;
  std::uint64_t next_ = 0;

  std::mutex mutex_;  // of the condition alone
  std::condition_variable left_;
};

// A call that may take long: releases the interpreter, and lets signal handlers run now and then.
class LongCall {
 public:
  explicit LongCall(Turn* turn = nullptr) : turn_(turn) {}
  LongCall(const LongCall&) = delete;
  ~LongCall() { take_back(); }

  void let_go() {
    if (turn_ != nullptr) turn_->take();
    thread_ = PyEval_SaveThread();
  }

  void take_back() {
    if (thread_ == nullptr) return;
    PyEval_RestoreThread(thread_);
    thread_ = nullptr;
    if (turn_ != nullptr) turn_->leave();
  }

  // To be called from the thread that made this: whether a signal handler has raised something. The call is then long.
  bool ask() {
    if (thread_ != nullptr) PyEval_RestoreThread(thread_);
    else if (turn_ != nullptr) turn_->take();
    const bool raised = PyErr_CheckSignals() != 0;
    if (raised) error_ = std::make_exception_ptr(py::error_already_set());
    thread_ = PyEval_SaveThread();
    return raised;
  }

  // With the interpreter: throws what the handler raised.
  void raise() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  Turn* turn_;
  PyThreadState* thread_ = nullptr;
  std::exception_ptr error_;
};
