// SPDX-License-Identifier: MIT
// What is being done, said in place on a terminal once it has lasted two seconds; nowhere else, where one sentence on
// standard error means an error.
#pragma once

#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace identify {

/// Is told what begins.
using Tell = std::function<void(const std::string& what)>;
inline void tell_nobody(const std::string&) {}

class Doing {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Doing(Clock::duration silent = std::chrono::seconds(2), bool terminal = isatty(STDERR_FILENO) != 0)
      : thread_([this, silent, terminal] {
          if (terminal) say_from(silent);
        }) {}
  Doing(const Doing&) = delete;
  ~Doing() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    changed_.notify_one();
    thread_.join();
  }

  void operator()(const std::string& what) {
    {
      const std::lock_guard lock(mutex_);
      what_ = what;
    }
    changed_.notify_one();
  }

 private:
  void say_from(Clock::duration silent) {
    const auto start = Clock::now();
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, silent, [&] { return ended_; });
    std::string said;
    const auto news = [&] { return ended_ || what_ != said; };
    while (!ended_) {
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - start).count();
      std::fprintf(stderr, "\r\033[K  %s, %ld s", what_.c_str(), static_cast<long>(seconds));
      std::fflush(stderr);
      said = what_;
      changed_.wait_for(lock, std::chrono::seconds(1), news);
    }
    if (!said.empty()) std::fputs("\r\033[K", stderr);
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::string what_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace identify
