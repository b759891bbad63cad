// Many scenes at once. Blocks of scenes go to threads; in a block a method of fixed step runs all scenes in the lanes of
// vectors. Each lane sees the operations of a single run in their order, so each scene gets the bits of a single run,
// whatever the width of the vectors and the number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

#include "batch.hpp"
#include "scenes_in_lanes.hpp"
#include "vector_width.hpp"

namespace planar_chain {

// One worker for each thread; `run(worker, block)` for every block, by whoever is free.
template <class Worker, class Run>
void share_out(std::vector<Worker>& workers, std::int64_t blocks, const Run& run) {
  std::atomic<std::int64_t> next{0};
  std::vector<std::exception_ptr> failures(workers.size());
  const auto work = [&](std::size_t k) {
    try {
      for (std::int64_t block; (block = next++) < blocks;) run(workers[k], block);
    } catch (...) {
      failures[k] = std::current_exception();
      next = blocks;
    }
  };
  std::vector<std::thread> threads;
  try {
    while (threads.size() + 1 < workers.size()) threads.emplace_back(work, threads.size() + 1);
  } catch (const std::system_error&) {  // no more threads to be had: fewer do it too
  }
  work(0);
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

// `lanes`: 1, or a width that this processor has.
inline void roll_batch(const Batch& batch, int threads, int lanes) {
  const auto workers_for = [&](std::int64_t blocks) { return std::clamp<std::int64_t>(blocks, 1, threads); };
  if (lanes == 1 || batch.method == LaneMethod::none) {
    std::vector<ScenesAlone> workers;
    for (std::int64_t k = workers_for(batch.count); k > 0; --k) workers.emplace_back(batch);
    return share_out(workers, batch.count, [](ScenesAlone& worker, std::int64_t i) { worker.run(i); });
  }
  with_width(lanes, [&](auto width) {
    using Real = typename decltype(width)::Real;
    const std::int64_t blocks = (batch.count + lanes - 1) / lanes;
    std::vector<ScenesInLanes<Real>> workers;
    for (std::int64_t k = workers_for(blocks); k > 0; --k) workers.emplace_back(batch);
    share_out(workers, blocks, [](ScenesInLanes<Real>& worker, std::int64_t block) {
      if (worker.prepare(block)) decltype(width)::Vectors::run(worker);
    });
  });
}

}  // namespace planar_chain
