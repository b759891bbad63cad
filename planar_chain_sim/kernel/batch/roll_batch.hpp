// Many scenes at once. Blocks of scenes go to threads; in a block a method of fixed step runs all scenes in the lanes
// of vectors. Each lane sees the operations of a single run in their order, so each scene gets the bits of a single
// run, whatever the width of the vectors and the number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "../arithmetic/vector_width.hpp"
#include "batch.hpp"
#include "scenes_in_lanes.hpp"

namespace planar_chain {

// One worker for each thread; the next free one calls `run(worker, block)` for a block. The caller's thread calls `ask`
// now and then to see whether to stop; the others see `stop`. After a stop the results are of no use.
template <class Worker, class Run>
void share_out(std::vector<Worker>& workers, std::int64_t blocks, std::atomic<bool>& stop,
               const std::function<bool()>& ask, const Run& run) {
  std::atomic<std::int64_t> next{0};
  std::vector<std::exception_ptr> failures(workers.size());
  std::mutex mutex;
  std::condition_variable ended;
  std::size_t running = 0;
  const auto work = [&](std::size_t k) {
    try {
      for (std::int64_t block; !stop && (block = next++) < blocks;) run(workers[k], block);
    } catch (...) {
      failures[k] = std::current_exception();
      stop = true;
    }
  };
  const auto work_aside = [&](std::size_t k) {
    work(k);
    const std::lock_guard<std::mutex> guard(mutex);
    --running, ended.notify_all();
  };
  const auto asked = [&] {
    if (ask && ask()) stop = true;
    return stop.load();
  };
  std::vector<std::thread> threads;
  try {
    while (threads.size() + 1 < workers.size()) {
      {
        const std::lock_guard<std::mutex> guard(mutex);
        ++running;
      }
      threads.emplace_back(work_aside, threads.size() + 1);
    }
  } catch (const std::system_error&) {  // there are no more threads: fewer will do
    const std::lock_guard<std::mutex> guard(mutex);
    --running;
  }
  workers[0].lookout().begin(asked);
  work(0);
  {
    std::unique_lock<std::mutex> lock(mutex);
    while (running > 0) {
      if (ended.wait_for(lock, std::chrono::milliseconds(5)) != std::cv_status::timeout) continue;
      lock.unlock();
      asked();
      lock.lock();
    }
  }
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

// `lanes`: 1, or a width that this processor has.
inline void roll_batch(const Batch& batch, int threads, int lanes, const std::function<bool()>& ask = {}) {
  const auto workers_for = [&](std::int64_t blocks) { return std::clamp<std::int64_t>(blocks, 1, threads); };
  if (lanes == 1 || batch.method == LaneMethod::none) {
    std::vector<ScenesAlone> workers;
    for (std::int64_t k = workers_for(batch.count); k > 0; --k) workers.emplace_back(batch);
    return share_out(workers, batch.count, batch.stop, ask, [](ScenesAlone& worker, std::int64_t i) { worker.run(i); });
  }
  with_width(lanes, [&](auto width) {
    using Real = typename decltype(width)::Real;
    const std::int64_t blocks = (batch.count + lanes - 1) / lanes;
    std::vector<ScenesInLanes<Real>> workers;
    for (std::int64_t k = workers_for(blocks); k > 0; --k) workers.emplace_back(batch);
    share_out(workers, blocks, batch.stop, ask, [](ScenesInLanes<Real>& worker, std::int64_t block) {
      if (worker.prepare(block)) decltype(width)::Vectors::run(worker);
    });
  });
}

}  // namespace planar_chain
