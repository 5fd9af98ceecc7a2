// A lock of Python: other threads wait for it, and the thread that has it is told if it asks again.
#pragma once
#include <nanobind/nanobind.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>

namespace hsp {

// The GIL guards the members: taking a free lock needs no other one.
class StepLock {
 public:
  // What to raise, and its text: where this thread has the lock, and where the process was forked
  // while another one had it.
  StepLock(nanobind::object error, nanobind::object by_itself, nanobind::object by_fork)
      : error_(std::move(error)),
        by_itself_(std::move(by_itself)),
        by_fork_(std::move(by_fork)),
        line_(new Line) {}

  void enter() {
    const unsigned long me = PyThread_get_thread_ident();
    if (owner_ == me) refuse(by_itself_);
    while (owner_ != 0 && !broken_) wait();
    if (broken_) refuse(by_fork_);
    owner_ = me;
  }

  void exit() {
    owner_ = 0;
    if (waiting_ > 0) line_->freed.notify_one();
  }

  // In a child process, where no other thread is.
  void forked() {
    broken_ = broken_ || (owner_ != 0 && owner_ != PyThread_get_thread_ident());
    waiting_ = 0;
    (void)line_.release();  // a thread that is gone may have held it
    line_.reset(new Line);
  }

 private:
  struct Line {
    std::mutex mutex;
    std::condition_variable freed;
  };

  // Wait without the GIL. A signal, or a lock that was freed before the wait began, is seen a
  // little later.
  void wait() {
    ++waiting_;
    {
      const nanobind::gil_scoped_release others;
      std::unique_lock<std::mutex> lock(line_->mutex);
      line_->freed.wait_for(lock, std::chrono::milliseconds(1));
    }
    --waiting_;
    if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
  }

  [[noreturn]] void refuse(const nanobind::object& text) const {
    PyErr_SetObject(error_.ptr(), text.ptr());
    throw nanobind::python_error();
  }

  nanobind::object error_, by_itself_, by_fork_;
  std::unique_ptr<Line> line_;
  unsigned long owner_ = 0;  // the thread that has it
  int waiting_ = 0;
  bool broken_ = false;
};

}  // namespace hsp
