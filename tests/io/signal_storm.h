#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/time.h>

#include <atomic>

namespace surfeit {

// Signals every 100 us, whose handler interrupts system calls for real, until it goes.
class SignalStorm {
 public:
  SignalStorm() {
    count_ = 0;
    struct sigaction action = {};
    action.sa_handler = [](int) { ++count_; };  // without SA_RESTART
    EXPECT_EQ(::sigaction(SIGALRM, &action, &before_), 0);
    const itimerval every_100_us = {{0, 100}, {0, 100}};
    EXPECT_EQ(::setitimer(ITIMER_REAL, &every_100_us, nullptr), 0);
  }
  SignalStorm(const SignalStorm&) = delete;
  SignalStorm& operator=(const SignalStorm&) = delete;
  ~SignalStorm() {
    const itimerval never = {};
    ::setitimer(ITIMER_REAL, &never, nullptr);
    ::sigaction(SIGALRM, &before_, nullptr);
  }
  int count() const { return count_; }

 private:
  static inline std::atomic<int> count_{0};
  struct sigaction before_ = {};
};

}  // namespace surfeit
