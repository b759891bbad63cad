// Interrupts a long computation for a signal or for another thread.
//
// Integrators count their work and read the clock now and then. The clock decides only when a motion is interrupted,
// never where it goes: it ends at a whole tick, and going on from there gives the same bits.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <utility>

namespace planar_chain {

// Checks for an interruption every few milliseconds of work. Each thread has its own Lookout.
class Lookout {
 public:
  // `wanted`: set by any thread. `ask`: called now and then by the working thread; true interrupts.
  explicit Lookout(const std::atomic<bool>& wanted, std::function<bool()> ask = {})
      : wanted_(wanted), ask_(std::move(ask)) {}

  // To be called when a new call begins.
  void begin() {
    stopped_ = timed_ = false;
    if (wanted_.load(std::memory_order_relaxed)) left_ = 0;
  }

  // The same for a call during which `ask` is to be called.
  void begin(std::function<bool()> ask) { ask_ = std::move(ask), begin(); }

  // Whether to stop, after this much more work, in units of about one joint acceleration.
  bool stop(std::int64_t work) { return (left_ -= work) < 0 && check(); }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::int64_t most_work = 1 << 14;
  static constexpr std::chrono::microseconds soon{200}, late{2000}, ask_period{5000};
  static constexpr int least_gap = 20;  // times the duration of the last `ask`: a busy interpreter must cost little

  __attribute__((noinline)) bool check() {
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
  std::int64_t left_ = most_work, work_ = most_work;  // units until the next check; between two checks
  Clock::time_point looked_, ask_at_;
  bool stopped_ = false, timed_ = false;  // timed_: whether looked_ is of this call
};

}  // namespace planar_chain
