#include "job_tracker.hpp"

#include <QElapsedTimer>

#include <algorithm>
#include <atomic>

namespace palpate::gui {

struct JobTracker::Job {
  quint64 epoch = 0;
  JobLane lane = JobLane::open;
  QString title;
  Work work;
  Failure failed;
  core::CancelToken cancel;
  std::atomic<double> fraction{0.0};
  std::atomic<bool> running{false};
  QElapsedTimer clock;
  mutable std::mutex what_mutex;
  std::string what;
};

JobTracker::JobTracker(QObject* parent) : QObject(parent) {
  // Progress is looked at, not sent: a filter that reports a thousand times a
  // second does not flood the window.
  ticker_.setInterval(100);
  connect(&ticker_, &QTimer::timeout, this, &JobTracker::jobsChanged);
  worker_ = std::thread([this] { run(); });
}

JobTracker::~JobTracker() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
    queue_.clear();
  }
  for (const auto& job : current_) job->cancel.cancel();
  wake_.notify_all();
  worker_.join();
}

quint64 JobTracker::start(JobLane lane, const QString& title, Work work, Failure failed) {
  cancel_lane(lane);
  auto job = std::make_shared<Job>();
  job->epoch = ++last_epoch_;
  job->lane = lane;
  job->title = title;
  job->work = std::move(work);
  job->failed = std::move(failed);
  job->clock.start();
  current_.push_back(job);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    queue_.push_back(job);
  }
  wake_.notify_all();
  if (!title.isEmpty()) ticker_.start();
  emit jobsChanged();
  return job->epoch;
}

void JobTracker::cancel(quint64 epoch) {
  const auto found =
      std::find_if(current_.begin(), current_.end(), [&](const auto& job) { return job->epoch == epoch; });
  if (found == current_.end()) return;
  const auto job = *found;
  job->cancel.cancel();
  current_.erase(found);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    queue_.erase(std::remove(queue_.begin(), queue_.end(), job), queue_.end());
  }
  if (current_.empty()) ticker_.stop();
  emit jobCancelled(epoch);
  emit jobsChanged();
}

void JobTracker::cancel_lane(JobLane lane) {
  QVector<quint64> epochs;
  for (const auto& job : current_) {
    if (job->lane == lane) epochs.append(job->epoch);
  }
  for (const quint64 epoch : epochs) cancel(epoch);
}

void JobTracker::cancel_all() {
  while (!current_.empty()) cancel(current_.front()->epoch);
}

bool JobTracker::busy(JobLane lane) const {
  return std::any_of(current_.begin(), current_.end(), [&](const auto& job) { return job->lane == lane; });
}

QVector<JobStatus> JobTracker::jobs() const {
  QVector<JobStatus> list;
  for (const auto& job : current_) {
    if (job->title.isEmpty()) continue;
    JobStatus status;
    status.epoch = job->epoch;
    status.title = job->title;
    {
      std::lock_guard<std::mutex> lock(job->what_mutex);
      status.what = QString::fromStdString(job->what);
    }
    status.fraction = job->fraction.load();
    status.running = job->running.load();
    status.elapsed_s = static_cast<double>(job->clock.elapsed()) / 1000.0;
    list.append(status);
  }
  return list;
}

void JobTracker::run() {
  for (;;) {
    std::shared_ptr<Job> job;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [this] { return ending_ || !queue_.empty(); });
      if (ending_) return;
      job = queue_.front();
      queue_.pop_front();
    }
    job->running = true;
    const core::Progress progress(
        [raw = job.get()](double fraction, const std::string& what) {
          raw->fraction = fraction;
          std::lock_guard<std::mutex> lock(raw->what_mutex);
          raw->what = what;
        },
        job->cancel);
    Delivery delivery;
    std::shared_ptr<core::Error> error;
    try {
      delivery = job->work(progress);
    } catch (const core::Error& caught) {
      error = std::make_shared<core::Error>(caught);
    } catch (const std::bad_alloc&) {
      error =
          std::make_shared<core::Error>(core::ErrorKind::internal, "no-memory",
                                        "There is not enough memory for this. A larger stride or a smaller "
                                        "crop needs less.");
    } catch (const std::exception& caught) {
      error = std::make_shared<core::Error>(core::ErrorKind::internal, "unexpected",
                                            "Something went wrong inside the program.", caught.what());
    }
    job->work = nullptr;  // what it holds is freed here, not in the window's thread
    QMetaObject::invokeMethod(
        this, [this, job, delivery, error] { deliver(job, delivery, error); }, Qt::QueuedConnection);
  }
}

void JobTracker::deliver(const std::shared_ptr<Job>& job, const Delivery& delivery,
                         const std::shared_ptr<core::Error>& error) {
  const auto found = std::find(current_.begin(), current_.end(), job);
  if (found == current_.end()) return;  // cancelled or replaced: too late
  current_.erase(found);
  if (current_.empty()) ticker_.stop();
  emit jobsChanged();
  if (error) {
    if (error->kind() != core::ErrorKind::cancelled && job->failed) job->failed(*error);
  } else if (delivery) {
    delivery();
  }
}

}  // namespace palpate::gui
