// A stop that somebody asks for while a long motion is computed: a signal, or another thread.
//
// Integrators count their work and read the clock now and then. The clock decides only when a motion ends early, never
// where it goes: it ends at a whole tick, and going on from there gives the same bits.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <utility>

namespace planar_chain {

// Looks for a stop every few milliseconds of work. Each thread has its own.
class Lookout {
 public:
  // `wanted`: set by any thread. `ask`: called now and then by the thread that works; true is a stop.
  explicit Lookout(const std::atomic<bool>& wanted, std::function<bool()> ask = {})
      : wanted_(wanted), ask_(std::move(ask)) {}

  // A new call begins.
  void begin() {
    stopped_ = timed_ = false;
    if (wanted_.load(std::memory_order_relaxed)) left_ = 0;
  }

  // A call that somebody else is to be asked about.
  void begin(std::function<bool()> ask) { ask_ = std::move(ask), begin(); }

  // Whether to stop, after so much more work: about the number of joint accelerations.
  bool stop(std::int64_t work) { return (left_ -= work) < 0 && look(); }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::int64_t most_work = 1 << 14;
  static constexpr std::chrono::microseconds soon{200}, late{2000}, ask_period{5000};
  static constexpr int least_gap = 20;  // times what the last question took: a busy interpreter must not slow us down

  __attribute__((noinline)) bool look() {
    left_ = 0;
    if (stopped_ || wanted_.load(std::memory_order_relaxed)) return stopped_ = true;
    const Clock::time_point now = Clock::now();
    if (timed_ && now - looked_ > late) work_ = std::max<std::int64_t>(1, work_ / 2);
    if (timed_ && now - looked_ < soon) work_ = std::min(most_work, 2 * work_);
    if (!timed_) ask_at_ = now + late;
    timed_ = true, looked_ = now;
    if (ask_ && now >= ask_at_) {
      stopped_ = ask_();
      looked_ = Clock::now();
      ask_at_ = looked_ + std::max<Clock::duration>(ask_period, least_gap * (looked_ - now));
    }
    if (!stopped_) left_ = work_;
    return stopped_;
  }

  const std::atomic<bool>& wanted_;
  std::function<bool()> ask_;
  std::int64_t left_ = most_work, work_ = most_work;  // units until the next look; between two looks
  Clock::time_point looked_, ask_at_;
  bool stopped_ = false, timed_ = false;  // the last: whether looked_ is of this call
};

}  // namespace planar_chain
