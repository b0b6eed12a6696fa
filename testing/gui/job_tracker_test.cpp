#include "job_tracker.hpp"

#include <QCoreApplication>
#include <QElapsedTimer>
#include <QThread>
#include <QTimer>
#include <gtest/gtest.h>

#include <future>

namespace {

using palpate::core::Error;
using palpate::core::Progress;
using palpate::gui::JobLane;
using palpate::gui::JobTracker;

bool wait_for(const std::function<bool()>& reached) {
  QElapsedTimer clock;
  clock.start();
  while (!reached()) {
    if (clock.elapsed() > 10000) return false;
    QTimer::singleShot(10, qApp, [] {});
    QCoreApplication::processEvents(QEventLoop::WaitForMoreEvents);
  }
  return true;
}

TEST(JobTracker, DeliversInTheThreadThatOwnsIt) {
  JobTracker tracker;
  QThread* delivered_in = nullptr;
  QThread* worked_in = nullptr;
  tracker.start(JobLane::open, "job",
                [&](const Progress&) -> JobTracker::Delivery {
                  worked_in = QThread::currentThread();
                  return [&] { delivered_in = QThread::currentThread(); };
                },
                {});
  ASSERT_TRUE(wait_for([&] { return delivered_in != nullptr; }));
  EXPECT_EQ(delivered_in, QThread::currentThread());
  EXPECT_NE(worked_in, QThread::currentThread());
  EXPECT_TRUE(tracker.jobs().isEmpty());
}

TEST(JobTracker, DropsTheLateResultOfACancelledJob) {
  JobTracker tracker;
  std::promise<void> started;
  std::promise<void> go_on;
  bool late = false;
  const auto epoch = tracker.start(JobLane::open, "deaf to its cancel token",
                                   [&](const Progress&) -> JobTracker::Delivery {
                                     started.set_value();
                                     go_on.get_future().wait();
                                     return [&] { late = true; };
                                   },
                                   {});
  started.get_future().wait();
  tracker.cancel(epoch);
  EXPECT_TRUE(tracker.jobs().isEmpty()) << "a cancelled job leaves the list at once";
  go_on.set_value();
  // The worker takes jobs in order: when the second arrives the first has arrived.
  bool second = false;
  tracker.start(JobLane::filter, "next",
                [&](const Progress&) -> JobTracker::Delivery { return [&] { second = true; }; }, {});
  ASSERT_TRUE(wait_for([&] { return second; }));
  EXPECT_FALSE(late);
}

TEST(JobTracker, AJobReplacesThoseOfItsLane) {
  JobTracker tracker;
  std::promise<void> started;
  std::string delivered;
  const auto name = [&](const char* text) {
    return [&delivered, text](const Progress&) -> JobTracker::Delivery {
      return [&delivered, text] { delivered += text; };
    };
  };
  tracker.start(JobLane::estimate, "running until it is told to stop",
                [&](const Progress& progress) -> JobTracker::Delivery {
                  started.set_value();
                  for (;;) progress.report(0.5, "working");
                },
                {});
  started.get_future().wait();
  tracker.start(JobLane::estimate, "b", name("b"), {});
  tracker.start(JobLane::filter, "x", name("x"), {});
  tracker.start(JobLane::estimate, "c", name("c"), {});
  ASSERT_TRUE(wait_for([&] { return delivered.size() == 2; }));
  EXPECT_EQ(delivered, "xc") << "b was replaced by c, x is of another lane";
}

TEST(JobTracker, TellsWhatFailedButNotWhatWasCancelled) {
  JobTracker tracker;
  std::string codes;
  const auto fail = [](palpate::core::ErrorKind kind, const char* code) {
    return [kind, code](const Progress&) -> JobTracker::Delivery { throw Error(kind, code, "It failed."); };
  };
  const auto tell = [&](const Error& error) { codes += error.code() + " "; };
  tracker.start(JobLane::open, "a", fail(palpate::core::ErrorKind::cancelled, "cancelled"), tell);
  tracker.start(JobLane::filter, "b", fail(palpate::core::ErrorKind::input, "truncated"), tell);
  tracker.start(
      JobLane::tissue, "c", [](const Progress&) -> JobTracker::Delivery { throw std::runtime_error("oops"); },
      tell);
  tracker.start(
      JobLane::picture, "d", [](const Progress&) -> JobTracker::Delivery { throw std::bad_alloc(); }, tell);
  ASSERT_TRUE(wait_for([&] { return tracker.jobs().isEmpty(); }));
  EXPECT_EQ(codes, "truncated unexpected no-memory ");
}

TEST(JobTracker, EndsInTheMiddleOfAJob) {
  std::promise<void> started;
  bool delivered = false;
  QElapsedTimer clock;
  {
    JobTracker tracker;
    tracker.start(JobLane::open, "endless",
                  [&](const Progress& progress) -> JobTracker::Delivery {
                    started.set_value();
                    for (;;) progress.report(0.1, "working");
                  },
                  {});
    tracker.start(JobLane::filter, "never begun",
                  [&](const Progress&) -> JobTracker::Delivery { return [&] { delivered = true; }; }, {});
    started.get_future().wait();
    clock.start();
  }
  EXPECT_LT(clock.elapsed(), 2000) << "an endless job stops at its next report";
  QCoreApplication::processEvents();
  EXPECT_FALSE(delivered);
}

}  // namespace
