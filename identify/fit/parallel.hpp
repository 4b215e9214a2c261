// SPDX-License-Identifier: MIT
// Work that falls into independent parts, on as many cores as there are.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace identify {

/// Threads at most. No result depends on it.
inline std::atomic<unsigned> most_threads = std::clamp(std::thread::hardware_concurrency(), 1u, 16u);

/// Calls part(0) .. part(count - 1), each once, in no order. A part may write only what belongs to its index. Throws
/// what the first part threw, after the others have ended; those not begun by then are left out.
template <class Part>
void in_parallel(std::size_t count, const Part& part) {
  std::atomic<std::size_t> next = 0;
  std::exception_ptr thrown;
  std::once_flag first;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < count; i = next++) part(i);
    } catch (...) {
      std::call_once(first, [&] { thrown = std::current_exception(); });
      next = count;
    }
  };
  {
    std::vector<std::jthread> others;
    while (others.size() + 1 < std::min<std::size_t>(most_threads, count)) others.emplace_back(work);
    work();
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace identify
